"""All games together against a fast clock: starts, deadlines, faults of models and database, takeovers, ends."""

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest

from overcooked.constants import EAST, STAY
from server.play import messages as m
from server.play.clock import Clock
from server.play.episode_spec import EpisodeSpec, PauseLimits
from server.play.games import Games, NoGame
from server.play.recorder import EpisodeRecord, TickRecord
from server.play.slots import SLOT_MS
from tests.support.live_fakes import MemoryRecorder, QuietConnection, RuleModels, make_spec

SPEED = 20.0


class House:
    """Games with their surroundings; `specs` by episode."""

    def __init__(self, speed: float = SPEED) -> None:
        self.recorder, self.models = MemoryRecorder(), RuleModels()
        self.specs: dict[str, EpisodeSpec] = {"e1": make_spec()}
        self.games = Games(Clock(speed), self.models, self.recorder, self.load)

    async def load(self, episode: str) -> EpisodeRecord | None:
        if episode not in self.specs:
            return None
        record = self.recorder.load(self.specs[episode], episode)
        result = self.recorder.results.get(episode)
        return record if result is None else replace(record, status=result.status)

    async def play(self, episode: str = "e1", tab: str = "tab-0001") -> QuietConnection:
        connection = QuietConnection(tab)
        game = await self.games.join(episode, 0, connection)
        game.receive(0, connection, m.Ready())
        return connection

    def ticks(self, episode: str = "e1") -> int:
        return len(self.recorder.ticks_of.get(episode, {}))


@pytest.fixture
async def house() -> AsyncIterator[House]:
    made = House()
    yield made
    await made.games.stop()


async def until(condition: Callable[[], object], within_s: float = 10.0) -> None:
    async with asyncio.timeout(within_s):
        while not condition():
            await asyncio.sleep(0.002)


async def test_episode_is_played_to_its_end_and_only_then_the_page_goes_on(house: House) -> None:
    connection = await house.play()
    await until(lambda: connection.closed)
    assert connection.closed == 1000
    assert house.ticks() == 41
    assert house.recorder.results["e1"].status == "done"
    (ended,) = connection.of(m.Ended)
    assert isinstance(ended, m.Ended)
    assert ended.next == "/s/test/now"
    assert house.models.forgotten == ["e1"]
    assert len(house.games) == 0


async def test_page_hears_welcome_countdown_then_every_state_in_order(house: House) -> None:
    connection = await house.play()
    await until(lambda: connection.closed)
    kinds = [type(message) for message in connection.sent]
    assert kinds[:3] == [m.Welcome, m.Countdown, m.Tick]
    assert kinds[-1] is m.Ended
    shown = [message.state.t for message in connection.sent if isinstance(message, m.Tick)]
    assert shown == list(range(41))


async def test_every_frame_was_stored_before_it_was_sent(house: House) -> None:
    connection = QuietConnection()
    send = connection.send

    def check(message: m.Outgoing) -> None:
        if isinstance(message, m.Tick):
            assert message.state.t in house.recorder.ticks_of["e1"]
        if isinstance(message, m.Ended):
            assert "e1" in house.recorder.results
        send(message)

    connection.send = check  # type: ignore[method-assign]
    game = await house.games.join("e1", 0, connection)
    game.receive(0, connection, m.Ready())
    await until(lambda: connection.closed)
    assert len(connection.of(m.Tick)) == 41


async def test_machine_that_stood_still_at_the_start_stores_the_start_state_first(house: House) -> None:
    await house.play()
    time.sleep(5.0 / SPEED)
    await until(lambda: house.ticks() > 5)
    assert list(house.recorder.ticks_of["e1"]) == list(range(house.ticks()))


async def test_page_that_changes_its_mind_at_once_starts_one_game(house: House) -> None:
    connection = QuietConnection()
    game = await house.games.join("e1", 0, connection)
    for message in (m.Ready(), m.Away("blur"), m.Ready()):  # in one packet: nothing else runs in between
        game.receive(0, connection, message)
    await until(lambda: connection.closed)
    assert connection.closed == 1000
    assert list(house.recorder.ticks_of["e1"]) == list(range(41))
    assert [message.state.t for message in connection.of(m.Tick)] == list(range(41))


async def test_games_share_batches_and_spread_over_the_slots(house: House) -> None:
    for number in range(40):
        house.specs[f"e{number}"] = make_spec(seed=number)
    connections = await asyncio.gather(*(house.play(f"e{number}") for number in range(40)))
    slots = set(house.games.loop._slot_of.values())
    assert {len(slot.games) for slot in slots} == {40 * SLOT_MS // make_spec().tick_ms}
    await until(lambda: all(connection.closed for connection in connections))
    assert all(house.ticks(f"e{number}") == 41 for number in range(40))
    assert max(house.models.batches) >= 2


async def test_deadlines_are_absolute_so_a_slow_model_moves_no_later_tick() -> None:
    house = House(speed=5.0)
    house.specs["e1"] = make_spec(horizon=6, tick_ms=50, deadline_ms=20)
    house.models.hang_s = 0.03
    connection = await house.play()
    await until(lambda: connection.closed)
    records = [house.recorder.ticks_of["e1"][n] for n in range(7)]
    assert [record.scheduled_ms for record in records] == [50.0 * n for n in range(7)]
    assert all(record.late for record in records[:-1])
    assert all(record.actions is not None and record.actions[1] == 4 for record in records[1:])
    await house.games.stop()


async def test_broken_models_leave_the_game_running_with_a_waiting_partner(house: House) -> None:
    house.models.broken = True
    connection = await house.play()
    await until(lambda: connection.closed)
    assert all(record.late for record in list(house.recorder.ticks_of["e1"].values())[:-1])


async def test_database_that_is_away_pauses_the_game_and_it_goes_on_by_itself(house: House) -> None:
    connection = await house.play()
    await until(lambda: house.ticks() > 5)
    house.recorder.down = True
    await until(lambda: connection.of(m.Paused))
    (paused,) = connection.of(m.Paused)
    assert isinstance(paused, m.Paused)
    assert (paused.reason, paused.left_s) == ("database", 0.0)
    frames, stored = len(connection.of(m.Tick)), house.ticks()
    assert frames == stored
    await asyncio.sleep(0.2)
    assert (len(connection.of(m.Tick)), house.ticks()) == (frames, stored)
    house.recorder.down = False
    await until(lambda: connection.closed)
    assert house.ticks() == 41
    (pause,) = house.recorder.pauses.values()
    assert pause.reason == "database"
    assert pause.duration_ms is not None
    assert pause.duration_ms > 0


async def test_database_away_at_the_start_delays_the_start(house: House) -> None:
    house.recorder.down = True
    connection = await house.play()
    await asyncio.sleep(0.1)
    assert not connection.of(m.Tick)
    house.recorder.down = False
    await until(lambda: connection.closed)
    assert house.ticks() == 41


async def test_database_away_at_the_end_delays_the_end(house: House) -> None:
    house.specs["e1"] = make_spec(horizon=5)
    connection = await house.play()
    ticks = house.recorder.ticks

    async def then_down(records: list[object]) -> None:
        await ticks(records)  # type: ignore[arg-type]
        house.recorder.down = house.ticks() == 6

    house.recorder.ticks = then_down  # type: ignore[method-assign, assignment]
    await until(lambda: house.ticks() == 6)
    await asyncio.sleep(0.1)
    assert not connection.of(m.Ended)
    house.recorder.ticks = ticks  # type: ignore[method-assign]
    house.recorder.down = False
    await until(lambda: connection.closed)
    assert connection.of(m.Ended)


async def test_last_timestep_that_could_not_be_stored_at_once_is_not_shown_while_the_game_is_said_to_stand(
    house: House,
) -> None:
    house.specs["e1"] = make_spec(horizon=5)
    connection = await house.play()
    ticks = house.recorder.ticks

    async def not_the_last(records: list[TickRecord]) -> None:
        house.recorder.down = records[-1].timestep == 5
        await ticks(records)

    house.recorder.ticks = not_the_last  # type: ignore[method-assign, assignment]
    await until(lambda: connection.of(m.Paused))
    assert house.ticks() == 5
    house.recorder.ticks = ticks  # type: ignore[method-assign]
    house.recorder.down = False
    await until(lambda: connection.closed)
    assert [type(message) for message in connection.sent[-4:]] == [m.Paused, m.Countdown, m.Tick, m.Ended]


async def test_tick_that_is_refused_ends_only_its_own_game(house: House) -> None:
    house.specs["e2"] = make_spec(seed=2)
    good, bad = await house.play("e1"), await house.play("e2")
    ticks = house.recorder.ticks

    async def refuse(records: list[object]) -> None:
        if any(record.episode == "e2" and record.timestep > 3 for record in records):  # type: ignore[attr-defined]
            raise ValueError("another tick is stored already")
        await ticks(records)  # type: ignore[arg-type]

    house.recorder.ticks = refuse  # type: ignore[method-assign, assignment]
    await until(lambda: good.closed and bad.closed)
    assert house.ticks("e1") == 41
    assert house.recorder.results["e1"].status == "done"
    assert (house.recorder.results["e2"].status, house.recorder.results["e2"].reason) == ("aborted", "error")


async def test_blur_stops_at_once_and_coming_back_counts_down_to_the_same_timestep(house: House) -> None:
    connection = await house.play()
    game = house.games.get("e1")
    assert game is not None
    await until(lambda: house.ticks() > 5)
    game.receive(0, connection, m.Input(0, EAST, EAST, 1.0))
    game.receive(0, connection, m.Away("blur"))
    await until(lambda: not game.busy)
    stood = game.session.simulation.timestep
    await asyncio.sleep(0.1)
    assert game.session.simulation.timestep == stood
    game.receive(0, connection, m.Ready())
    await until(lambda: connection.closed)
    actions = house.recorder.ticks_of["e1"][stood + 1].actions
    assert actions is not None
    assert actions[0] == STAY
    assert [type(message) for message in connection.sent].count(m.Countdown) == 2
    assert len(house.recorder.pauses) == 1


async def test_newest_tab_plays_and_the_old_one_is_told_and_changes_nothing(house: House) -> None:
    house.specs["e1"] = make_spec(horizon=200)  # long enough for a busy machine
    old = await house.play(tab="tab-old-1")
    game = house.games.get("e1")
    assert game is not None
    await until(lambda: house.ticks() > 3)
    new = await house.play(tab="tab-new-1")
    assert old.closed == 4001
    assert isinstance(old.sent[-1], m.Superseded)
    assert new.of(m.Welcome)
    game.receive(0, old, m.Input(0, EAST, EAST, 1.0))
    game.receive(0, old, m.Away("hidden"))
    game.leave(0, old)
    assert game.connections[0] is new
    await until(lambda: new.closed)
    assert new.closed == 1000
    assert all(not record.keys for record in house.recorder.ticks_of["e1"].values())
    assert {pause.reason for pause in house.recorder.pauses.values()} == {"other_tab"}


async def test_lost_connection_comes_back_to_the_same_timestep(house: House) -> None:
    connection = await house.play()
    game = house.games.get("e1")
    assert game is not None
    await until(lambda: house.ticks() > 3)
    game.leave(0, connection)
    await until(lambda: not game.busy)
    stood = game.session.simulation.timestep
    back = QuietConnection()
    await house.games.join("e1", 0, back)
    welcome = back.sent[0]
    assert isinstance(welcome, m.Welcome)
    assert (welcome.state.t, welcome.resumed) == (stood, True)
    assert isinstance(back.sent[1], m.Paused)
    game.receive(0, back, m.Ready())
    await until(lambda: back.closed)
    assert house.ticks() == 41


async def test_who_stays_away_too_long_forfeits_the_episode(house: House) -> None:
    house.specs["e1"] = make_spec(pause=PauseLimits(5.0, 60.0))
    connection = await house.play()
    await until(lambda: house.ticks() > 3)
    game = house.games.get("e1")
    assert game is not None
    game.receive(0, connection, m.Away("hidden"))
    await until(lambda: connection.closed)
    result = house.recorder.results["e1"]
    assert (result.status, result.reason, result.passed) == ("aborted", "away", False)
    assert connection.of(m.Ended)


async def test_restart_goes_on_where_the_last_stored_tick_left_it(house: House) -> None:
    house.specs["e1"] = make_spec(horizon=200)
    connection = await house.play()
    await until(lambda: house.ticks() > 10)
    await house.games.stop()
    assert connection.closed == 1012
    stood = house.ticks() - 1
    assert [pause.reason for pause in house.recorder.pauses.values()] == ["server"]
    house.games = Games(Clock(SPEED), house.models, house.recorder, house.load)
    again = await house.play()
    welcome = again.sent[0]
    assert isinstance(welcome, m.Welcome)
    assert (welcome.state.t, welcome.resumed) == (stood, True)
    await until(lambda: again.closed)
    assert house.ticks() == 201
    assert [pause.reason for pause in house.recorder.pauses.values()] == ["server", "server"]
    assert all(pause.duration_ms is not None for pause in house.recorder.pauses.values())


def taken_up_later(house: House, gap_s: float) -> None:
    """A new process takes the episodes up so long after the last stored state, without a word from the one before."""
    house.games = Games(Clock(1.0), house.models, house.recorder, house.load)
    known = datetime.now(UTC) - timedelta(seconds=gap_s)
    load = house.load

    async def load_later(episode: str) -> EpisodeRecord | None:
        record = await load(episode)
        return None if record is None else replace(record, known_at=known)

    house.games._load = load_later


@pytest.mark.parametrize("timestep", [0, 10])
async def test_the_time_without_a_server_is_a_pause_with_its_length(house: House, timestep: int) -> None:
    connection = await house.play()
    await until(lambda: house.ticks() > timestep)
    killed = house.games
    killed.loop._over = lambda *_: None
    await killed.loop.close()  # as a kill does: nothing more is stored
    house.recorder.ticks_of["e1"] = {n: tick for n, tick in house.recorder.ticks_of["e1"].items() if n <= timestep}
    assert not house.recorder.pauses
    taken_up_later(house, 20.0)
    connection = await house.play(tab="tab-0002")
    await until(lambda: any(pause.duration_ms is not None for pause in house.recorder.pauses.values()))
    (pause,) = house.recorder.pauses.values()
    assert (pause.reason, pause.timestep) == ("server", timestep)
    assert pause.duration_ms is not None
    assert 20_000 <= pause.duration_ms < 30_000
    assert connection.of(m.Countdown)
    await killed.stop()


async def test_an_episode_whose_last_state_is_stored_ends_with_the_interruption_before_its_end(house: House) -> None:
    await house.play()
    await until(lambda: "e1" in house.recorder.results)
    house.recorder.results.clear()
    taken_up_later(house, 20.0)
    with pytest.raises(NoGame):
        await house.play()
    await until(lambda: "e1" in house.recorder.results)
    (pause,) = house.recorder.pauses.values()
    assert pause.duration_ms is not None
    assert 20_000 <= pause.duration_ms < 30_000


async def test_a_wall_clock_that_was_set_back_makes_no_pause_of_less_than_nothing(house: House) -> None:
    await house.play()
    await until(lambda: house.ticks() > 3)
    await house.games.stop()
    house.recorder.pauses.clear()
    taken_up_later(house, -3600.0)
    await house.play()
    await until(lambda: any(pause.duration_ms is not None for pause in house.recorder.pauses.values()))
    (pause,) = house.recorder.pauses.values()
    assert pause.duration_ms is not None
    assert 0 <= pause.duration_ms < 10_000


async def test_the_end_says_why(house: House) -> None:
    connection = await house.play()
    await until(lambda: connection.closed)
    (ended,) = connection.of(m.Ended)
    assert isinstance(ended, m.Ended)
    assert ended.reason == "horizon"
    house.recorder.results.clear()
    house.recorder.ticks_of.clear()
    again = await house.play()
    game = house.games.get("e1")
    assert game is not None
    house.games.abort(game, "researcher")
    await until(lambda: again.closed)
    (ended,) = again.of(m.Ended)
    assert isinstance(ended, m.Ended)
    assert ended.reason == "researcher"


async def test_finished_or_unknown_episode_is_no_game(house: House) -> None:
    connection = await house.play()
    await until(lambda: connection.closed)
    with pytest.raises(NoGame):
        await house.play()
    with pytest.raises(NoGame):
        await house.play("nobody")


async def test_many_pages_at_once_open_one_game(house: House) -> None:
    connections = [QuietConnection(f"tab-{number:04d}") for number in range(50)]
    games = await asyncio.gather(*(house.games.join("e1", 0, connection) for connection in connections))
    assert len({id(game) for game in games}) == 1
    assert sum(connection.closed is None for connection in connections) == 1


async def test_ready_twice_and_messages_out_of_turn_are_refused_without_harm(house: House) -> None:
    connection = await house.play()
    game = house.games.get("e1")
    assert game is not None
    game.receive(0, connection, m.Ready())
    refused = connection.of(m.Refused)
    assert [message.code for message in refused if isinstance(message, m.Refused)] == ["not_now"]
    await until(lambda: connection.closed)
    assert house.ticks() == 41
