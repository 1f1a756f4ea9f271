"""Faults in any order against the real application, its database and its sockets: hypothesis searches and shrinks.

The models answer by rule and the server lives in this process, so that a sequence takes seconds. At the end of a
sequence all faults are repaired, every game must continue, and the journals are compared with the database.
"""

import asyncio
import os
import sqlite3
import tempfile
import time
from pathlib import Path
from typing import Any, ClassVar

import pytest
from hypothesis import HealthCheck, Phase, seed, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from tests.support.faults.fault_proxy import FaultProxy, Weather
from tests.support.faults.group import LONG_STUDY, ClientGroup
from tests.support.faults.invariants import held_against
from tests.support.live_server import LiveServer

WEATHERS = (Weather(), Weather(latency_ms=30, jitter_ms=20), Weather(loss=0.05), Weather(bytes_per_s=20_000))


class FaultMachine(RuleBasedStateMachine):
    """Two people at their games; each rule causes a fault, or lets some time pass."""

    compared: ClassVar[list[int]] = []  # at the end of each sequence, how many states were looked up in the database

    @initialize(number=st.integers(0, 2**16))
    def begin(self, number: int) -> None:
        self.folder = tempfile.TemporaryDirectory()
        self.live = LiveServer(Path(self.folder.name), study=LONG_STUDY, speed=20.0)
        self.live.start()
        self.up = True
        self.runner = asyncio.Runner()
        self.intruder: sqlite3.Connection | None = None
        self.runner.run(self._open(number))

    async def _open(self, number: int) -> None:
        self.proxy = FaultProxy(self.live.port, number)
        await self.proxy.__aenter__()
        self.group = ClientGroup(self.proxy.url, 2, number)
        await self.group.__aenter__()

    @rule(seconds=st.sampled_from([0.02, 0.1, 0.4]))
    def time_passes(self, seconds: float) -> None:
        self.runner.run(asyncio.sleep(seconds))

    @rule(weather=st.sampled_from(WEATHERS))
    def weather_changes(self, weather: Weather) -> None:
        self.proxy.weather = weather

    @rule()
    def lines_are_reset(self) -> None:
        async def reset() -> None:
            self.proxy.reset()

        self.runner.run(reset())

    @rule(up=st.booleans(), down=st.booleans(), seconds=st.sampled_from([0.1, 0.7]))
    def lines_stand_still(self, up: bool, down: bool, seconds: float) -> None:
        self.proxy.freeze(up, down)
        self.runner.run(asyncio.sleep(seconds))
        self.proxy.thaw()

    @rule(person=st.integers(0, 1), same_tab=st.booleans())
    def page_is_opened_again(self, person: int, same_tab: bool) -> None:
        """A reload, or another tab while the first is still open."""

        async def again() -> None:
            old, client = self.group._games[person], self.group.clients[person]
            new = client.game()
            if same_tab:
                self.group._playing[person].cancel()
                new.tab = old.tab
            self.group._games[person] = new
            self.group._playing.append(self.group._playing[person])
            self.group._playing[person] = asyncio.create_task(new.play())
            await asyncio.sleep(0.05)

        self.runner.run(again())

    @precondition(lambda self: self.up)
    @rule(politely=st.booleans())
    def server_goes_down(self, politely: bool) -> None:
        self._unlock()
        self.up = False
        self.live.stop() if politely else self.live.kill()

    @precondition(lambda self: not self.up)
    @rule()
    def server_comes_back(self) -> None:
        self.live.start()
        self.up = True

    @precondition(lambda self: self.up and self.intruder is None)
    @rule()
    def database_is_locked(self) -> None:
        self.intruder = sqlite3.connect(self.live.database.removeprefix("sqlite:///"), isolation_level=None, timeout=10)
        self.intruder.execute("BEGIN IMMEDIATE")

    @precondition(lambda self: self.intruder is not None)
    @rule()
    def database_is_free_again(self) -> None:
        self._unlock()

    @rule(how=st.sampled_from(["well", "broken", "silent"]))
    def models_change(self, how: str) -> None:
        self.live.models.broken, self.live.models.silent = how == "broken", how == "silent"

    @invariant()
    def nobody_was_told_two_things(self) -> None:
        assert not [one for client in self.group.clients for one in client.log.violations]

    @invariant()
    def one_seat_is_taken_once(self) -> None:
        if self.up:
            for game in self.live.app.state.services.games:
                assert len(game.connections) <= 1

    def _unlock(self) -> None:
        if self.intruder is not None:
            self.intruder.execute("ROLLBACK")
            self.intruder.close()
            self.intruder = None

    def teardown(self) -> None:
        if not hasattr(self, "group"):
            return
        try:
            self._unlock()
            self.live.models.broken = self.live.models.silent = False
            self.proxy.weather = Weather()
            if not self.up:
                self.server_comes_back()
            self.runner.run(self._end())
        finally:
            self.runner.close()
            self.live.stop()
        found = held_against(self.live.database, self.group.clients, silence_s=60)
        self.folder.cleanup()
        assert found.ok, found
        self.compared.append(found.compared)

    async def _end(self) -> None:
        try:
            await self.group.moving(time.monotonic(), within_s=40)
        finally:
            await self.group.__aexit__()
            await self.proxy.__aexit__()


_QUIET = {"deadline": None, "suppress_health_check": list(HealthCheck), "database": None}


def search(machine: type[FaultMachine], sequences: int, steps: int, **how: Any) -> None:
    """Try this many sequences of faults; each of them must have shown states to compare."""
    FaultMachine.compared.clear()
    tried = settings(max_examples=sequences, stateful_step_count=steps, **how, **_QUIET)
    run_state_machine_as_test(machine, settings=tried)
    assert len(FaultMachine.compared) >= sequences
    assert min(FaultMachine.compared) > 0


def test_a_few_sequences_of_faults_lose_nothing() -> None:
    search(FaultMachine, 3, 8, derandomize=True, phases=[Phase.generate])


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_many_sequences_of_faults_lose_nothing() -> None:
    number = int.from_bytes(os.urandom(4))
    print(f"seed {number}")
    searched = seed(number)(FaultMachine)
    search(searched, 30, 15)
