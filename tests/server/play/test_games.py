"""All games together against a fast clock: starts, order of messages, deadlines, tabs, ends."""

import asyncio
import time

from overcooked.constants import EAST, STAY
from server.play import messages as m
from server.play.episode_spec import PauseLimits
from server.play.slots import SLOT_MS
from tests.support.live_fakes import QuietConnection, make_spec
from tests.support.running_games import SPEED, RunningGames, until


async def test_episode_is_played_to_its_end_and_only_then_the_page_advances(running: RunningGames) -> None:
    connection = await running.play()
    await until(lambda: connection.closed)
    assert connection.closed == 1000
    assert running.ticks() == 41
    assert running.recorder.results["e1"].status == "done"
    (ended,) = connection.of(m.Ended)
    assert isinstance(ended, m.Ended)
    assert ended.next == "/s/test/now"
    assert running.models.forgotten == ["e1"]
    assert len(running.games) == 0


async def test_page_receives_welcome_countdown_then_every_state_in_order(running: RunningGames) -> None:
    connection = await running.play()
    await until(lambda: connection.closed)
    kinds = [type(message) for message in connection.sent]
    assert kinds[:3] == [m.Welcome, m.Countdown, m.Tick]
    assert kinds[-1] is m.Ended
    shown = [message.state.t for message in connection.sent if isinstance(message, m.Tick)]
    assert shown == list(range(41))


async def test_every_frame_was_stored_before_it_was_sent(running: RunningGames) -> None:
    connection = QuietConnection()
    send = connection.send

    def check(message: m.Outgoing) -> None:
        if isinstance(message, m.Tick):
            assert message.state.t in running.recorder.ticks_of["e1"]
        if isinstance(message, m.Ended):
            assert "e1" in running.recorder.results
        send(message)

    connection.send = check  # type: ignore[method-assign]
    game = await running.games.join("e1", 0, connection)
    game.receive(0, connection, m.Ready())
    await until(lambda: connection.closed)
    assert len(connection.of(m.Tick)) == 41


async def test_machine_that_stood_still_at_the_start_stores_the_start_state_first(running: RunningGames) -> None:
    await running.play()
    time.sleep(5.0 / SPEED)
    await until(lambda: running.ticks() > 5)
    assert list(running.recorder.ticks_of["e1"]) == list(range(running.ticks()))


async def test_a_quick_second_choice_starts_one_game(running: RunningGames) -> None:
    connection = QuietConnection()
    game = await running.games.join("e1", 0, connection)
    for message in (m.Ready(), m.Away("blur"), m.Ready()):  # in one packet: nothing else runs in between
        game.receive(0, connection, message)
    await until(lambda: connection.closed)
    assert connection.closed == 1000
    assert list(running.recorder.ticks_of["e1"]) == list(range(41))
    assert [message.state.t for message in connection.of(m.Tick)] == list(range(41))


async def test_games_share_batches_and_spread_over_the_slots(running: RunningGames) -> None:
    for number in range(40):
        running.specs[f"e{number}"] = make_spec(seed=number)
    connections = await asyncio.gather(*(running.play(f"e{number}") for number in range(40)))
    slots = set(running.games.loop._slot_of.values())
    assert {len(slot.games) for slot in slots} == {40 * SLOT_MS // make_spec().tick_ms}
    await until(lambda: all(connection.closed for connection in connections))
    assert all(running.ticks(f"e{number}") == 41 for number in range(40))
    assert max(running.models.batches) >= 2


async def test_deadlines_are_absolute_so_a_slow_model_moves_no_later_tick() -> None:
    running = RunningGames(speed=5.0)
    running.specs["e1"] = make_spec(horizon=6, tick_ms=50, deadline_ms=20)
    running.models.hang_s = 0.03
    connection = await running.play()
    await until(lambda: connection.closed)
    records = [running.recorder.ticks_of["e1"][n] for n in range(7)]
    assert [record.scheduled_ms for record in records] == [50.0 * n for n in range(7)]
    assert all(record.late for record in records[:-1])
    assert all(record.actions is not None and record.actions[1] == 4 for record in records[1:])
    await running.games.stop()


async def test_a_slow_model_of_one_game_costs_no_other_game_its_partner() -> None:
    running = RunningGames(speed=5.0)
    for episode, agent in (("e1", "sp"), ("slow", "theirs")):
        spec = make_spec(horizon=6, tick_ms=40, deadline_ms=20, agents=(None, agent))  # one slot for all games
        running.specs[episode] = spec
    running.models.slow = "theirs"
    connections = await asyncio.gather(running.play("e1"), running.play("slow"))
    await until(lambda: all(connection.closed for connection in connections))
    assert max(running.models.batches) == 2, "both games are in one batch"
    late = {name: [running.recorder.ticks_of[name][n].late for n in range(6)] for name in ("e1", "slow")}
    assert late == {"e1": [False] * 6, "slow": [True] * 6}
    await running.games.stop()


async def test_the_longer_deadline_of_one_study_is_not_that_of_another() -> None:
    running = RunningGames(speed=5.0)
    for episode, deadline_ms in (("e1", 10), ("long", 30)):
        running.specs[episode] = make_spec(horizon=6, tick_ms=40, deadline_ms=deadline_ms)
    running.models.hang_s = 0.02
    connections = await asyncio.gather(running.play("e1"), running.play("long"))
    await until(lambda: all(connection.closed for connection in connections))
    late = {name: [running.recorder.ticks_of[name][n].late for n in range(6)] for name in ("e1", "long")}
    assert late == {"e1": [True] * 6, "long": [False] * 6}
    await running.games.stop()


async def test_blur_stops_at_once_and_coming_back_counts_down_to_the_same_timestep(running: RunningGames) -> None:
    connection = await running.play()
    game = running.games.get("e1")
    assert game is not None
    await until(lambda: running.ticks() > 5)
    game.receive(0, connection, m.Input(0, EAST, EAST, 1.0))
    game.receive(0, connection, m.Away("blur"))
    await until(lambda: not game.busy)
    stood = game.session.simulation.timestep
    await asyncio.sleep(0.1)
    assert game.session.simulation.timestep == stood
    game.receive(0, connection, m.Ready())
    await until(lambda: connection.closed)
    actions = running.recorder.ticks_of["e1"][stood + 1].actions
    assert actions is not None
    assert actions[0] == STAY
    assert [type(message) for message in connection.sent].count(m.Countdown) == 2
    assert len(running.recorder.pauses) == 1


async def test_newest_tab_plays_and_the_old_one_gets_a_message_and_changes_nothing(running: RunningGames) -> None:
    running.specs["e1"] = make_spec(horizon=200)  # long enough for a busy machine
    old = await running.play(tab="tab-old-1")
    game = running.games.get("e1")
    assert game is not None
    await until(lambda: running.ticks() > 3)
    new = await running.play(tab="tab-new-1")
    assert old.closed == 4001
    assert isinstance(old.sent[-1], m.Superseded)
    assert new.of(m.Welcome)
    game.receive(0, old, m.Input(0, EAST, EAST, 1.0))
    game.receive(0, old, m.Away("hidden"))
    game.leave(0, old)
    assert game.connections[0] is new
    await until(lambda: new.closed)
    assert new.closed == 1000
    assert all(not record.keys for record in running.recorder.ticks_of["e1"].values())
    assert {pause.reason for pause in running.recorder.pauses.values()} == {"other_tab"}


async def test_lost_connection_comes_back_to_the_same_timestep(running: RunningGames) -> None:
    connection = await running.play()
    game = running.games.get("e1")
    assert game is not None
    await until(lambda: running.ticks() > 3)
    game.leave(0, connection)
    await until(lambda: not game.busy)
    stood = game.session.simulation.timestep
    back = QuietConnection()
    await running.games.join("e1", 0, back)
    welcome = back.sent[0]
    assert isinstance(welcome, m.Welcome)
    assert (welcome.state.t, welcome.resumed) == (stood, True)
    assert isinstance(back.sent[1], m.Paused)
    game.receive(0, back, m.Ready())
    await until(lambda: back.closed)
    assert running.ticks() == 41


async def test_a_too_long_absence_forfeits_the_episode(running: RunningGames) -> None:
    running.specs["e1"] = make_spec(pause=PauseLimits(5.0, 60.0))
    connection, game = await running.under_way()
    game.receive(0, connection, m.Away("hidden"))
    await until(lambda: connection.closed)
    result = running.recorder.results["e1"]
    assert (result.status, result.reason, result.passed) == ("aborted", "away", False)
    (pause,) = running.recorder.pauses.values()
    assert pause.duration_ms is not None, "it is over with the episode"
    assert connection.of(m.Ended)


async def test_the_last_page_gives_the_reason(running: RunningGames) -> None:
    connection = await running.play()
    await until(lambda: connection.closed)
    (ended,) = connection.of(m.Ended)
    assert isinstance(ended, m.Ended)
    assert ended.reason == "horizon"
    running.recorder.results.clear()
    running.recorder.ticks_of.clear()
    again = await running.play()
    game = running.games.get("e1")
    assert game is not None
    running.games.abort(game, "researcher")
    await until(lambda: again.closed)
    (ended,) = again.of(m.Ended)
    assert isinstance(ended, m.Ended)
    assert ended.reason == "researcher"


async def test_many_pages_at_once_open_one_game(running: RunningGames) -> None:
    connections = [QuietConnection(f"tab-{number:04d}") for number in range(50)]
    games = await asyncio.gather(*(running.games.join("e1", 0, connection) for connection in connections))
    assert len({id(game) for game in games}) == 1
    assert sum(connection.closed is None for connection in connections) == 1


async def test_ready_twice_and_messages_out_of_turn_are_refused_without_harm(running: RunningGames) -> None:
    connection = await running.play()
    game = running.games.get("e1")
    assert game is not None
    game.receive(0, connection, m.Ready())
    refused = connection.of(m.Refused)
    assert [message.code for message in refused if isinstance(message, m.Refused)] == ["not_now"]
    await until(lambda: connection.closed)
    assert running.ticks() == 41
