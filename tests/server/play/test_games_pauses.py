"""Pauses of games that a researcher or the database holds: what participants are told, and when a game continues."""

import asyncio

import pytest

from server.play import games
from server.play import messages as m
from server.play.episode_spec import PauseLimits
from server.play.game import Game
from server.play.pause_reasons import DATABASE, RESEARCHER
from tests.support.live_fakes import QuietConnection, make_spec
from tests.support.running_games import SPEED, RunningGames, until


async def test_a_game_that_may_not_start_yet_tells_the_participant_why(running: RunningGames) -> None:
    connection = QuietConnection()
    game = await running.games.join("e1", 0, connection)
    game.pause(RESEARCHER, "researcher")
    assert not connection.of(m.Paused), "the page still offers to start"
    game.receive(0, connection, m.Ready())
    assert connection.of(m.Paused) == [m.Paused("researcher", 0.0)]
    game.release(RESEARCHER)
    await until(lambda: connection.closed)
    assert running.ticks() == 41


async def test_a_pause_in_the_first_countdown_is_shown(running: RunningGames) -> None:
    connection = await running.play()
    game = running.games.get("e1")
    assert game is not None
    game.pause(RESEARCHER, "researcher")
    await until(lambda: connection.of(m.Paused) == [m.Paused("researcher", 0.0)])


async def test_a_database_that_stops_at_the_first_commit_is_shown(running: RunningGames) -> None:
    running.recorder.down = True
    connection = await running.play()
    await until(lambda: connection.of(m.Paused))
    assert set(connection.of(m.Paused)) == {m.Paused("database", 0.0)}
    running.recorder.down = False
    await until(lambda: connection.closed)
    assert running.ticks() == 41


@pytest.mark.parametrize("holder", [RESEARCHER, DATABASE])
@pytest.mark.parametrize("started", [True, False])
async def test_a_game_does_not_continue_before_a_participant_who_left_during_its_pause_is_back(
    running: RunningGames, holder: str, started: bool
) -> None:
    connection = await running.play()
    game = running.games.get("e1")
    assert game is not None
    await until(lambda: running.ticks() > 5 if started else game.session.phase == "countdown")
    game.pause(holder, holder)
    game.receive(0, connection, m.Away("hidden"))
    await until(lambda: not game.busy)
    stood = running.ticks()
    game.release(holder)
    await asyncio.sleep(0.3)  # six seconds of the game
    assert not game.session.moving
    assert running.ticks() == stood
    game.receive(0, connection, m.Ready())
    await until(lambda: connection.closed)
    assert running.ticks() == 41


async def paused_and_left(running: RunningGames) -> Game:
    """A game that the researcher pauses, and whose participant has been away for ten seconds since."""
    connection, game = await running.under_way()
    game.pause(RESEARCHER, "researcher")
    game.leave(0, connection)
    await asyncio.sleep(10.0 / SPEED)
    return game


async def test_an_absence_while_the_researcher_pauses_a_game_does_not_end_it(running: RunningGames) -> None:
    running.specs["e1"] = make_spec(pause=PauseLimits(2.0, 60.0))
    game = await paused_and_left(running)
    assert game.session.phase == "paused"
    game.release(RESEARCHER)
    await until(lambda: running.recorder.results)
    assert running.recorder.results["e1"].reason == "away"


async def test_what_is_stored_of_a_pause_is_how_much_of_it_was_absence(running: RunningGames) -> None:
    """An absence that becomes the researcher's pause, and a researcher's pause that becomes an absence."""
    connection, game = await running.under_way()
    game.receive(0, connection, m.Away("hidden"))
    await asyncio.sleep(4.0 / SPEED)
    game.pause(RESEARCHER, "researcher")
    await asyncio.sleep(40.0 / SPEED)
    game.receive(0, connection, m.Ready())
    game.release(RESEARCHER)
    await until(lambda: game.session.phase == "running")
    game.pause(RESEARCHER, "researcher")
    game.receive(0, connection, m.Away("blur"))
    game.release(RESEARCHER)
    await asyncio.sleep(2.0 / SPEED)
    await running.games.stop()
    first, second = running.recorder.pauses.values()
    assert (first.reason, second.reason) == ("hidden", "researcher")
    assert first.duration_ms is not None
    assert first.away_ms is not None
    assert second.away_ms is not None
    assert 4000 <= first.away_ms < first.duration_ms - 30_000
    assert 2000 <= second.away_ms < 30_000


async def test_a_game_that_a_researcher_pauses_is_not_unloaded(
    running: RunningGames, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(games, "FORGET_AFTER_S", 1.0)
    game = await paused_and_left(running)
    assert running.games.get("e1") is game, "it would continue without the researcher"


async def test_a_server_that_stops_says_so(running: RunningGames) -> None:
    connection, _ = await running.under_way()
    await running.games.stop()
    assert {message.reason for message in connection.sent if isinstance(message, m.Paused)} == {"server"}


async def test_a_game_that_continues_tells_how_long_the_next_absence_may_last(running: RunningGames) -> None:
    running.specs["e1"] = make_spec(pause=PauseLimits(10.0, 12.0))
    connection, game = await running.under_way()
    game.receive(0, connection, m.Away("hidden"))
    await asyncio.sleep(5.0 / SPEED)
    game.receive(0, connection, m.Ready())
    await until(lambda: len(connection.of(m.Countdown)) == 2)
    first, second = connection.of(m.Countdown)
    assert first.away_s == round(10.0 / SPEED, 1)
    assert 0 < second.away_s <= round(7.0 / SPEED, 1)


@pytest.mark.parametrize("holder", [RESEARCHER, DATABASE])
async def test_the_wait_for_a_participant_who_leaves_after_pressing_start_is_limited(
    running: RunningGames, holder: str
) -> None:
    running.specs["e1"] = make_spec(agents=(None, None), pause=PauseLimits(each_s=6.0, episode_s=6.0))
    game = await running.games.join("e1", 0, ann := QuietConnection("tab-0001"))
    await running.games.join("e1", 1, bob := QuietConnection("tab-0002"))
    game.pause(holder, holder)
    game.receive(0, ann, m.Ready())
    game.receive(1, bob, m.Ready())
    game.leave(0, ann)
    game.release(holder)
    game.tell_paused()
    assert bob.of(m.Paused)[-1].reason == "partner"
    assert bob.of(m.Paused)[-1].left_s > 0, "nobody tells for how long"
    await until(lambda: bob.closed)
    assert running.recorder.results["e1"].reason == "away"


async def test_the_wait_for_a_participant_who_leaves_in_the_first_countdown_is_limited(running: RunningGames) -> None:
    running.specs["e1"] = make_spec(agents=(None, None), pause=PauseLimits(each_s=6.0, episode_s=6.0))
    running.recorder.down = True
    game = await running.games.join("e1", 0, ann := QuietConnection("tab-0001"))
    await running.games.join("e1", 1, bob := QuietConnection("tab-0002"))
    game.receive(0, ann, m.Ready())
    game.receive(1, bob, m.Ready())
    game.leave(0, ann)  # before the start state is stored
    running.recorder.down = False
    await until(lambda: bob.closed)
    assert running.recorder.results["e1"].reason == "away"
