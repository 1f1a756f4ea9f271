"""Games after a restart of the server: the same timestep, and the time without a server as a pause."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest

from server.play import messages as m
from server.play.clock import Clock
from server.play.games import Games, NoGame
from server.play.pause_reasons import RESEARCHER
from server.play.recorder import EpisodeRecord
from tests.support.live_fakes import make_spec
from tests.support.running_games import SPEED, RunningGames, until


async def test_restart_continues_after_the_last_stored_tick(running: RunningGames) -> None:
    running.specs["e1"] = make_spec(horizon=400)
    connection = await running.play()
    await until(lambda: running.ticks() > 10)
    await running.games.stop()
    assert connection.closed == 1012
    stood = running.ticks() - 1
    assert [pause.reason for pause in running.recorder.pauses.values()] == ["server"]
    running.games = Games(Clock(SPEED), running.models, running.recorder, running.load)
    again = await running.play()
    welcome = again.sent[0]
    assert isinstance(welcome, m.Welcome)
    assert (welcome.state.t, welcome.resumed) == (stood, True)
    await until(lambda: again.closed)
    assert running.ticks() == 401
    assert [pause.reason for pause in running.recorder.pauses.values()] == ["server", "server"]
    assert all(pause.duration_ms is not None for pause in running.recorder.pauses.values())


def taken_up_later(running: RunningGames, gap_s: float) -> None:
    """A new process takes the episodes up this long after the last stored state; the old one ended without notice."""
    running.games = Games(Clock(1.0), running.models, running.recorder, running.load)
    known = datetime.now(UTC) - timedelta(seconds=gap_s)
    load = running.load

    async def load_later(episode: str) -> EpisodeRecord | None:
        record = await load(episode)
        return None if record is None else replace(record, known_at=known)

    running.games._load = load_later


@pytest.mark.parametrize("timestep", [0, 10])
async def test_the_time_without_a_server_is_a_pause_with_its_length(running: RunningGames, timestep: int) -> None:
    connection = await running.play()
    await until(lambda: running.ticks() > timestep)
    killed = running.games
    killed.loop._over = lambda *_: None
    await killed.loop.close()  # as a kill does: nothing more is stored
    running.recorder.ticks_of["e1"] = {n: tick for n, tick in running.recorder.ticks_of["e1"].items() if n <= timestep}
    assert not running.recorder.pauses
    taken_up_later(running, 20.0)
    connection = await running.play(tab="tab-0002")
    await until(lambda: any(pause.duration_ms is not None for pause in running.recorder.pauses.values()))
    (pause,) = running.recorder.pauses.values()
    assert (pause.reason, pause.timestep) == ("server", timestep)
    assert pause.duration_ms is not None
    assert 20_000 <= pause.duration_ms < 30_000
    assert connection.of(m.Countdown)
    await killed.stop()


async def test_an_episode_whose_last_state_is_stored_ends_with_the_interruption_before_its_end(
    running: RunningGames,
) -> None:
    await running.play()
    await until(lambda: "e1" in running.recorder.results)
    running.recorder.results.clear()
    taken_up_later(running, 20.0)
    with pytest.raises(NoGame):
        await running.play()
    await until(lambda: "e1" in running.recorder.results)
    (pause,) = running.recorder.pauses.values()
    assert pause.duration_ms is not None
    assert 20_000 <= pause.duration_ms < 30_000


async def test_a_wall_clock_that_was_set_back_makes_no_pause_of_less_than_nothing(running: RunningGames) -> None:
    await running.play()
    await until(lambda: running.ticks() > 3)
    await running.games.stop()
    running.recorder.pauses.clear()
    taken_up_later(running, -3600.0)
    await running.play()
    await until(lambda: any(pause.duration_ms is not None for pause in running.recorder.pauses.values()))
    (pause,) = running.recorder.pauses.values()
    assert pause.duration_ms is not None
    assert 0 <= pause.duration_ms < 10_000


async def test_finished_or_unknown_episode_is_not_a_game(running: RunningGames) -> None:
    connection = await running.play()
    await until(lambda: connection.closed)
    with pytest.raises(NoGame):
        await running.play()
    with pytest.raises(NoGame):
        await running.play("nobody")


@pytest.mark.parametrize("begins", [False, True])
async def test_a_game_that_a_researcher_paused_stays_paused_in_the_next_process(
    running: RunningGames, begins: bool
) -> None:
    if begins:
        await running.under_way()
        await running.games.stop()
        taken_up_later(running, 1.0)
    load = running.games._load

    async def load_paused(episode: str) -> EpisodeRecord | None:
        record = await load(episode)
        return None if record is None else replace(record, is_paused=True)

    running.games._load = load_paused
    connection = await running.play()
    game = running.games.get("e1")
    assert game is not None
    assert not game.session.moving
    assert connection.of(m.Paused)[-1] == m.Paused("researcher", 0.0)
    game.release(RESEARCHER)
    assert game.session.moving
