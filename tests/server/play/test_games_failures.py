"""Games whose models or database fail: they wait, and lose and repeat nothing."""

import asyncio

import pytest

from server.play import messages as m
from server.play.episode_spec import PauseLimits
from server.play.recorder import RecorderDown, TickRecord
from tests.support.live_fakes import QuietConnection, make_spec
from tests.support.running_games import RunningGames, until


async def test_broken_models_leave_the_game_running_with_a_waiting_partner(running: RunningGames) -> None:
    running.models.broken = True
    connection = await running.play()
    await until(lambda: connection.closed)
    assert all(record.late for record in list(running.recorder.ticks_of["e1"].values())[:-1])


async def test_an_unavailable_database_pauses_the_game_which_then_resumes_by_itself(running: RunningGames) -> None:
    connection = await running.play()
    await until(lambda: running.ticks() > 5)
    running.recorder.down = True
    await until(lambda: connection.of(m.Paused))
    (paused,) = connection.of(m.Paused)
    assert isinstance(paused, m.Paused)
    assert (paused.reason, paused.left_s) == ("database", 0.0)
    frames, stored = len(connection.of(m.Tick)), running.ticks()
    assert frames == stored
    await asyncio.sleep(0.2)
    assert (len(connection.of(m.Tick)), running.ticks()) == (frames, stored)
    running.recorder.down = False
    await until(lambda: connection.closed)
    assert running.ticks() == 41
    (pause,) = running.recorder.pauses.values()
    assert pause.reason == "database"
    assert pause.duration_ms is not None
    assert pause.duration_ms > 0


async def test_a_page_that_comes_in_the_middle_of_a_commit_sees_what_is_stored(running: RunningGames) -> None:
    first = await running.play()
    await until(lambda: running.ticks() > 5)
    ticks, may_go_on = running.recorder.ticks, asyncio.Event()

    async def slowly(records: list[TickRecord]) -> None:
        await may_go_on.wait()
        await ticks(records)

    running.recorder.ticks = slowly  # type: ignore[method-assign, assignment]
    game = running.games.get("e1")
    assert game is not None
    await until(lambda: game.busy)
    second = QuietConnection("tab-0002")
    joining = asyncio.create_task(running.games.join("e1", 0, second))
    await asyncio.sleep(0.05)
    assert not second.sent
    may_go_on.set()
    await joining
    (welcome,) = second.of(m.Welcome)
    assert isinstance(welcome, m.Welcome)
    assert welcome.state.t == running.ticks() - 1
    assert welcome.resumed
    assert first.of(m.Superseded)


async def test_a_page_that_comes_while_the_database_is_away_is_asked_to_come_back(running: RunningGames) -> None:
    connection = await running.play()
    await until(lambda: running.ticks() > 5)
    running.recorder.down = True
    await until(lambda: connection.of(m.Paused))
    with pytest.raises(RecorderDown):
        await running.games.join("e1", 0, QuietConnection("tab-0002"))


async def test_nobody_loses_a_game_because_they_could_not_come_back_while_the_database_was_away() -> None:
    running = RunningGames(speed=100.0)
    running.specs["e1"] = make_spec(pause=PauseLimits(each_s=60.0, episode_s=120.0))
    connection = await running.play()
    await until(lambda: running.ticks() > 5)
    running.recorder.down = True
    await until(lambda: connection.of(m.Paused))
    game = running.games.get("e1")
    assert game is not None
    game.leave(0, connection)
    await asyncio.sleep(0.8)  # longer than an absence may last, on this clock
    running.recorder.down = False
    await until(lambda: not game.busy)
    await asyncio.sleep(0.3)  # until absences were looked at
    back = await running.play(tab="tab-0002")
    await until(lambda: back.closed)
    assert running.recorder.results["e1"].status == "done"
    await running.games.stop()


async def test_an_unavailable_database_at_the_start_delays_the_start(running: RunningGames) -> None:
    running.recorder.down = True
    connection = await running.play()
    await asyncio.sleep(0.1)
    assert not connection.of(m.Tick)
    running.recorder.down = False
    await until(lambda: connection.closed)
    assert running.ticks() == 41


async def test_an_unavailable_database_at_the_end_delays_the_end(running: RunningGames) -> None:
    running.specs["e1"] = make_spec(horizon=5)
    connection = await running.play()
    ticks = running.recorder.ticks

    async def then_down(records: list[object]) -> None:
        await ticks(records)  # type: ignore[arg-type]
        running.recorder.down = running.ticks() == 6

    running.recorder.ticks = then_down  # type: ignore[method-assign, assignment]
    await until(lambda: running.ticks() == 6)
    await asyncio.sleep(0.1)
    assert not connection.of(m.Ended)
    running.recorder.ticks = ticks  # type: ignore[method-assign]
    running.recorder.down = False
    await until(lambda: connection.closed)
    assert connection.of(m.Ended)


async def test_a_last_timestep_that_is_not_stored_yet_is_not_shown_while_the_game_is_paused(
    running: RunningGames,
) -> None:
    running.specs["e1"] = make_spec(horizon=5)
    connection = await running.play()
    ticks = running.recorder.ticks

    async def not_the_last(records: list[TickRecord]) -> None:
        running.recorder.down = records[-1].timestep == 5
        await ticks(records)

    running.recorder.ticks = not_the_last  # type: ignore[method-assign, assignment]
    await until(lambda: connection.of(m.Paused))
    assert running.ticks() == 5
    running.recorder.ticks = ticks  # type: ignore[method-assign]
    running.recorder.down = False
    await until(lambda: connection.closed)
    assert [type(message) for message in connection.sent[-4:]] == [m.Paused, m.Countdown, m.Tick, m.Ended]


async def test_tick_that_is_refused_ends_only_its_own_game(running: RunningGames) -> None:
    running.specs["e2"] = make_spec(seed=2)
    good, bad = await running.play("e1"), await running.play("e2")
    ticks = running.recorder.ticks

    async def refuse(records: list[object]) -> None:
        if any(record.episode == "e2" and record.timestep > 3 for record in records):  # type: ignore[attr-defined]
            raise ValueError("another tick is stored already")
        await ticks(records)  # type: ignore[arg-type]

    running.recorder.ticks = refuse  # type: ignore[method-assign, assignment]
    await until(lambda: good.closed and bad.closed)
    assert running.ticks("e1") == 41
    assert running.recorder.results["e1"].status == "done"
    assert (running.recorder.results["e2"].status, running.recorder.results["e2"].reason) == ("aborted", "error")


async def test_a_frame_that_cannot_be_sent_ends_only_its_own_game(running: RunningGames) -> None:
    running.specs = {name: make_spec(tick_ms=40) for name in ("e1", "e2")}  # one slot for both
    good, bad = await running.play("e1"), await running.play("e2")
    await until(lambda: running.ticks("e1") > 3 and running.ticks("e2") > 3)
    game = running.games.get("e2")
    assert game is not None
    game.session.tick_message = lambda _: 1 / 0  # type: ignore[method-assign, assignment, return-value]
    await until(lambda: good.closed and bad.closed)
    assert running.ticks("e1") == 41
    assert running.recorder.results["e1"].status == "done"
    assert (running.recorder.results["e2"].status, running.recorder.results["e2"].reason) == ("aborted", "error")
