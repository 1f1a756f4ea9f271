"""Faults in every order: lost sockets, second tabs, absences, a database and models that come and go, kill -9.

hypothesis searches sequences; time is the test's own, so a sequence of minutes takes milliseconds. After each step and
at the end the clients' journals are compared with what is stored.
"""

import asyncio
import heapq
import itertools

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from overcooked.constants import STAY
from server.play import messages as m
from server.play.clock import Clock
from server.play.episode_spec import PauseLimits
from server.play.game import Game
from server.play.games import Games, NoGame
from server.play.pause_reasons import RESEARCHER
from server.play.recorder import EpisodeRecord, RecorderDown
from server.play.session import Session
from tests.support.live_fakes import MemoryRecorder, QuietConnection, RuleModels, make_spec

HORIZON = 30


class HandClock(Clock):
    """Time that moves only when the test moves it."""

    def __init__(self) -> None:
        super().__init__(1.0)
        self.time = 1000.0
        self._sleepers: list[tuple[float, int, asyncio.Future[None]]] = []
        self._order = itertools.count()

    def now(self) -> float:
        return self.time

    async def sleep(self, seconds: float) -> None:
        await self.sleep_until(self.time + seconds)

    async def sleep_until(self, moment: float) -> None:
        if moment > self.time:
            awake: asyncio.Future[None] = asyncio.get_running_loop().create_future()
            heapq.heappush(self._sleepers, (moment, next(self._order), awake))
            await awake

    async def advance(self, seconds: float) -> None:
        end = self.time + seconds
        while self._sleepers and self._sleepers[0][0] <= end:
            self.time, _, awake = heapq.heappop(self._sleepers)
            if not awake.done():
                awake.set_result(None)
            await settle()
        self.time = end
        await settle()


async def settle() -> None:
    for _ in range(12):
        await asyncio.sleep(0)


class FaultyTab(QuietConnection):
    """A browser tab that keeps what it saw."""

    game: Game | None = None


class Faults(RuleBasedStateMachine):
    def __init__(self) -> None:
        super().__init__()
        self.runner = asyncio.Runner()
        self.clock, self.recorder, self.models = HandClock(), MemoryRecorder(), RuleModels()
        self.spec = make_spec(horizon=HORIZON, pause=PauseLimits(30.0, 60.0))
        self.tabs: list[FaultyTab] = []
        self.seq = 0
        self.seen: dict[int, str] = {}

    @initialize()
    def begin(self) -> None:
        self.start_server()
        self.open_tab(new=True)

    def start_server(self) -> None:
        self.games = Games(self.clock, self.models, self.recorder, self.load)

    async def load(self, episode: str) -> EpisodeRecord:
        record = self.recorder.load(self.spec, episode)
        if episode in self.recorder.results:
            return EpisodeRecord(**{**record.__dict__, "status": self.recorder.results[episode].status})
        return record

    @property
    def tab(self) -> FaultyTab | None:
        return next((tab for tab in reversed(self.tabs) if tab.closed is None), None)

    @rule(new=st.booleans())
    def open_tab(self, new: bool) -> None:
        async def join() -> None:
            name = f"tab-{len(self.tabs):05d}" if new or not self.tabs else self.tabs[-1].tab
            tab = FaultyTab(name)
            self.tabs.append(tab)
            try:
                tab.game = await self.games.join("e1", 0, tab)
            except NoGame:
                tab.close(4004, "")
            except RecorderDown:
                tab.close(1013, "")
            await settle()

        self.runner.run(join())

    @precondition(lambda self: self.tab is not None)
    @rule()
    def ready(self) -> None:
        self.say(m.Ready())

    @rule()
    def play_on(self) -> None:
        """Play like a patient person; without this, most sequences would never have a moving game."""
        if self.tab is None:
            self.open_tab(new=False)
        if self.tab is not None:
            self.say(m.Ready())
        self.runner.run(self.clock.advance(3.7))

    @precondition(lambda self: self.tab is not None)
    @rule()
    def take_over_and_play_on(self) -> None:
        self.open_tab(new=True)
        self.play_on()

    @precondition(lambda self: self.tab is not None)
    @rule(held=st.none() | st.integers(0, 3), tap=st.none() | st.sampled_from([0, 1, 2, 3, 5]), old=st.booleans())
    def press(self, held: int | None, tap: int | None, old: bool) -> None:
        self.seq += 0 if old else 1
        self.say(m.Input(self.seq, held, tap, 0.0))

    @rule()
    def old_tabs_keep_talking(self) -> None:
        async def talk() -> None:
            for tab in self.tabs:
                if tab.closed == 4001 and tab.game is not None:
                    tab.game.receive(0, tab, m.Away("hidden"))
                    tab.game.receive(0, tab, m.Ready())
                    tab.game.receive(0, tab, m.Input(10**6, 1, 1, 0.0))

        self.runner.run(talk())

    @precondition(lambda self: self.tab is not None)
    @rule(reason=st.sampled_from(["hidden", "blur"]))
    def away(self, reason: str) -> None:
        self.say(m.Away(reason))  # type: ignore[arg-type]

    @precondition(lambda self: self.tab is not None)
    @rule()
    def lose_the_socket(self) -> None:
        async def leave() -> None:
            tab = self.tab
            assert tab is not None
            tab.closed = 1006
            if tab.game is not None:
                tab.game.leave(0, tab)
            await settle()

        self.runner.run(leave())

    def say(self, message: m.Incoming) -> None:
        async def receive() -> None:
            tab = self.tab
            assert tab is not None
            if tab.game is not None:
                tab.game.receive(0, tab, message)
            await settle()

        self.runner.run(receive())

    @rule(seconds=st.sampled_from([0.05, 0.2, 1.0, 3.3, 12.0]))
    def time_passes(self, seconds: float) -> None:
        self.runner.run(self.clock.advance(seconds))

    @rule(down=st.booleans())
    def database(self, down: bool) -> None:
        self.recorder.down = down

    @rule(holds=st.booleans())
    def researcher(self, holds: bool) -> None:
        self.hold(holds)

    def hold(self, holds: bool) -> None:
        async def command() -> None:
            for game in self.games:
                if game.session.phase == "ended":
                    continue
                if holds:
                    game.pause(RESEARCHER, "researcher")
                else:
                    game.release(RESEARCHER)
                    game.tell_paused()
            await settle()

        self.runner.run(command())

    @rule(how=st.sampled_from(["well", "broken", "silent"]))
    def change_models(self, how: str) -> None:
        self.models.broken, self.models.silent = how == "broken", how == "silent"

    @rule()
    def kill_the_server(self) -> None:
        async def kill() -> None:
            for task in asyncio.all_tasks() - {asyncio.current_task()}:
                task.cancel()
            await settle()
            for tab in self.tabs:
                tab.closed = tab.closed or 1006
            self.start_server()

        self.runner.run(kill())

    @precondition(lambda self: not self.recorder.down)
    @rule()
    def stop_the_server(self) -> None:
        async def stop() -> None:
            await asyncio.gather(self.games.stop(), self.clock.advance(1.0))
            assert all(tab.closed is not None for tab in self.tabs if tab.game is not None)
            self.start_server()

        self.runner.run(stop())

    @invariant()
    def what_was_shown_is_stored_and_never_changes(self) -> None:
        stored = self.recorder.ticks_of.get("e1", {})
        assert sorted(stored) == list(range(len(stored)))
        for tab in self.tabs:
            for message in tab.sent:
                if isinstance(message, m.Tick):
                    assert message.state.t in stored
                    assert message.prediction == stored[message.state.t].displayed
                if isinstance(message, m.Welcome):
                    assert message.state.t in stored or message.state.t == 0
                if isinstance(message, m.Ended):
                    assert "e1" in self.recorder.results

    @invariant()
    def one_tab_plays_at_most(self) -> None:
        assert sum(tab.closed is None for tab in self.tabs) <= 1

    @invariant()
    def partner_did_what_was_decided_or_waited(self) -> None:
        stored = self.recorder.ticks_of.get("e1", {})
        for timestep in range(1, len(stored)):
            decided, actions = stored[timestep - 1].next_actions[1], stored[timestep].actions
            assert actions is not None
            assert actions[1] == (STAY if decided is None else decided)

    @invariant()
    def nothing_moves_while_something_holds_it(self) -> None:
        for game in self.games:
            assert not (game.session.moving and game.session.pause_reasons)

    @invariant()
    def old_tabs_decided_nothing(self) -> None:
        for record in self.recorder.ticks_of.get("e1", {}).values():
            assert all(key.seq < 10**6 for key in record.keys)

    def teardown(self) -> None:
        try:
            self.heal_and_finish()
            self.runner.run(self.end())
        finally:
            self.runner.close()

    async def end(self) -> None:
        await asyncio.gather(self.games.stop(), self.clock.advance(1.0))

    def heal_and_finish(self) -> None:
        """Once everything is well again, a person who presses on gets to the end."""
        self.recorder.down = self.models.broken = self.models.silent = False
        self.hold(False)
        for _ in range(40):
            if "e1" in self.recorder.results:
                break
            if self.tab is None:
                self.open_tab(new=False)
            if self.tab is not None:
                self.say(m.Ready())
            self.runner.run(self.clock.advance(4.0))
        result = self.recorder.results["e1"]
        stored = self.recorder.ticks_of.get("e1", {})
        if result.status == "done":
            assert len(stored) == HORIZON + 1
        else:
            assert result.reason == "away"
        again = Session(self.recorder.load(self.spec), 0.0)
        assert again.simulation.hash() == result.final_hash


Faults.TestCase.settings = settings(
    max_examples=60, stateful_step_count=30, deadline=None, suppress_health_check=list(HealthCheck)
)
TestFaultSequences = Faults.TestCase
