"""Makes the timesteps of all games when they are due: each in a slot of its tick, a slot's games in one batch.

A slot's batch costs one call to the models and one transaction. Errors of one game stay with it.
"""

import asyncio
import logging
import math
from collections.abc import Callable, Collection, Coroutine, Sequence
from typing import Any, Final

from models.protocols import Models, Question
from overcooked.layout import Layout
from server.play.clock import Clock
from server.play.game import Game
from server.play.lateness import Lateness
from server.play.model_answers import ask_together
from server.play.pause_reasons import DATABASE, SERVER
from server.play.recorder import GamesLost, Recorder, RecorderDown, TickRecord
from server.play.session import COUNTDOWN_S, Session
from server.play.simulation import step_together
from server.play.slots import Slot, between_batches, slots_of

log = logging.getLogger(__name__)
COMMIT_S: Final = 1.0  # a commit that takes longer counts as RecorderDown
PROBE_S: Final = 0.5
STALLED_S: Final = 1.0  # a server that was suspended for longer counts down again instead of catching up


class Loop:
    """Drives games from `start` until `over` is told that one has nothing left to play."""

    def __init__(
        self,
        clock: Clock,
        models: Models,
        recorder: Recorder,
        over: Callable[[Game, str], None],
        lost: Callable[[Game], None],
    ) -> None:
        """`over(game, error)`: the episode was played to its end (error empty) or cannot continue. `lost(game)`:
        another process plays it now."""
        self.clock = clock
        self.lateness = Lateness()
        self.made = self.waits = 0  # ticks since the start; those whose partner had to wait
        self._models, self._recorder, self._over, self._lost = models, recorder, over, lost
        self._slots: dict[int, list[Slot]] = {}  # by tick_ms
        self._slot_of: dict[Game, Slot] = {}
        self._unstored: set[Game] = set()
        self._tasks: set[asyncio.Task[None]] = set()
        self._prober: asyncio.Task[None] | None = None

    @property
    def moving(self) -> int:
        """How many games count down or run."""
        return len(self._slot_of)

    def start(self, game: Game) -> None:
        """Count down and continue the game, in the slot with the fewest games."""
        tick_ms = game.session.spec.tick_ms
        if tick_ms not in self._slots:
            self._slots[tick_ms] = slots_of(tick_ms, patient=self.clock.patience_s > 0)
        self.stop(game)
        slot = min(self._slots[tick_ms], key=lambda slot: len(slot.games))
        now = self.clock.now()
        game.store(game.session.count_down(now, slot.first_after(now + COUNTDOWN_S)))
        game.tell_countdown()
        slot.games.add(game)
        self._slot_of[game] = slot
        if slot.driver is None or slot.driver.done():
            slot.driver = self._spawn(self._drive(slot))
        if game.session.stored:
            game.show()
        elif not game.busy:
            game.busy = True  # at once: neither its driver nor another start may come before the start state
            self._spawn(self._make_start(game))

    def stop(self, game: Game) -> None:
        """Stop driving a game that is paused or over."""
        slot = self._slot_of.pop(game, None)
        if slot is not None:
            slot.games.discard(game)

    async def between_batches(self) -> None:
        """Wait until no batch is due for a while: for work that can wait and would delay timesteps."""
        await between_batches([slot for slots in self._slots.values() for slot in slots], self.clock)

    async def close(self) -> None:
        """End all driving; what is being stored is finished first."""
        for slots in self._slots.values():
            for slot in slots:
                slot.games.clear()
                if slot.driver is not None and slot.asleep:
                    slot.driver.cancel()
        self._slot_of.clear()
        if self._prober is not None:
            self._prober.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def _spawn(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    async def _drive(self, slot: Slot) -> None:
        while slot.games:
            slot.asleep = True
            if not self.clock.patience_s:
                await self.clock.sleep_until(min(game.session.next_deadline for game in slot.games))
            slot.asleep = False
            now = self.clock.now()
            due = self._due(slot, now)
            if due:
                await self._play(due, now)
            else:
                await self.clock.sleep(0.001)

    def _due(self, slot: Slot, now: float) -> list[Game]:
        """Return the games whose next timestep is due."""
        still = [game for game in slot.games if not game.busy]
        if self.clock.patience_s:
            return [game for game in still if self._have_acted(game.session, now)]
        due = [game for game in still if game.session.next_deadline <= now]
        stalled = now - STALLED_S if self.clock.speed == 1 else -math.inf
        for game in [game for game in due if game.session.next_deadline <= stalled]:
            due.remove(game)
            game.pause(SERVER, "server")
            game.release(SERVER)
        return due

    def _have_acted(self, session: Session, now: float) -> bool:
        """Return whether the timestep of a patient clock is due: all players have acted, or waited long enough."""
        late_s = now - session.next_deadline
        given_up = late_s >= self.clock.patience_s * self.clock.speed
        if late_s < -session.tick_s or not (given_up or session.heard_from_all):
            return False
        session.start_at(now - session.tick_s)
        return True

    async def _make_start(self, game: Game) -> None:
        """Record and predict the start state while the countdown runs."""
        await self._finish([(game, game.session.begin_start())])
        go = game.session.next_deadline - game.session.tick_s
        slot = self._slot_of.get(game)
        if slot is not None and self.clock.now() > go:
            game.session.start_at(slot.first_after(self.clock.now()))

    async def _play(self, games: Sequence[Game], now: float) -> None:
        self.lateness.add_batch([(now - game.session.next_deadline) * 1000 for game in games])
        due: dict[Layout, list[tuple[Game, tuple[int, int]]]] = {}
        for game in games:
            try:
                due.setdefault(game.session.simulation.layout, []).append((game, game.session.decide(now)))
            except Exception as error:  # noqa: BLE001 - a fault in one game must not reach the others
                self._broken(game, error)
        begun: list[tuple[Game, list[Question]]] = []
        for together in due.values():
            steps = step_together(
                [game.session.simulation for game, _ in together], [actions for _, actions in together]
            )
            for (game, _), step in zip(together, steps, strict=True):
                try:
                    begun.append((game, game.session.follow(step)))
                except Exception as error:  # noqa: BLE001 - as above
                    self._broken(game, error)
        await self._finish(begun)

    async def _finish(self, begun: Sequence[tuple[Game, list[Question]]]) -> None:
        """Finish new states: call the models, store, and show them."""
        for game, _ in begun:
            game.busy = True
        grace_ms = self.clock.patience_s * 1000
        asked = [(game.session.spec.deadline_ms + grace_ms, questions) for game, questions in begun]
        answered = await ask_together(self._models, asked)
        made: list[tuple[Game, TickRecord]] = []
        unix_ms = self.clock.unix_ms()
        for (game, _), (decisions, models_ms) in zip(begun, answered, strict=True):
            try:
                made.append((game, game.session.finish_tick(decisions, models_ms, grace_ms, unix_ms)))
            except Exception as error:  # noqa: BLE001 - as above
                self._broken(game, error)
        self.made += len(made)
        self.waits += sum(record.late for _, record in made)
        await self._store(made)

    async def _store(self, made: Sequence[tuple[Game, TickRecord]]) -> None:
        try:
            lost = await self._commit([record for _, record in made])
        except RecorderDown as down:
            self._wait_for_database(made, down)
        except Exception:
            log.exception("a batch of %d ticks was refused; each is stored by itself", len(made))
            for game, record in made:
                await self._store_one(game, record)
        else:
            for game, _ in made:
                self._settle(game, lost)

    async def _store_one(self, game: Game, record: TickRecord) -> None:
        try:
            lost = await self._commit([record])
        except RecorderDown as down:
            self._wait_for_database([(game, record)], down)
        except Exception as error:  # noqa: BLE001 - as above
            self._broken(game, error)
        else:
            self._settle(game, lost)

    async def _commit(self, records: Sequence[TickRecord]) -> Collection[str]:
        """Store all but those of episodes that another process plays now, which are returned."""
        if records:
            try:
                async with asyncio.timeout(COMMIT_S):
                    await self._recorder.ticks(records)
            except TimeoutError:
                raise RecorderDown(f"no commit within {COMMIT_S} s") from None
            except GamesLost as lost:
                return lost.episodes
        return ()

    def _settle(self, game: Game, lost: Collection[str]) -> None:
        try:
            if lost and game.episode in lost:
                game.busy = False
                self._lost(game)
            else:
                self._stored(game)
        except Exception as error:  # noqa: BLE001 - as above
            self._broken(game, error)

    def _stored(self, game: Game) -> None:
        """Show a state, now that it is stored."""
        game.busy, game.unstored, game.session.stored = False, None, True
        game.show()
        if game.session.over:
            self.stop(game)
            self._over(game, "")
        elif not game.session.moving:
            game.tell_paused()

    def _broken(self, game: Game, error: Exception) -> None:
        log.error("episode %s cannot continue", game.episode, exc_info=error)
        self.stop(game)
        self._over(game, f"{type(error).__name__}: {error}")

    # While the database is away

    def _wait_for_database(self, made: Sequence[tuple[Game, TickRecord]], down: RecorderDown) -> None:
        log.error("the database does not commit, %d games pause: %s", len(made), down)
        for game, record in made:
            game.unstored = record
            self._unstored.add(game)
            game.pause(DATABASE, "database")
            game.tell_paused()
        if self._prober is None or self._prober.done():
            self._prober = self._spawn(self._probe())

    async def _probe(self) -> None:
        """Repeat the commits that failed until they arrive; then the games continue by themselves."""
        while self._unstored:
            await self.clock.sleep(PROBE_S)
            games = [(game, game.unstored) for game in self._unstored if game.unstored is not None]
            try:
                lost = await self._commit([record for _, record in games])
            except RecorderDown:
                continue
            except Exception:
                log.exception("a batch of %d ticks was refused; each is stored by itself", len(games))
                for game, record in games:
                    self._unstored.discard(game)
                    game.release(DATABASE)
                    await self._store_one(game, record)
                continue
            log.warning("the database commits again, %d games continue", len(games))
            for game, _ in games:
                self._unstored.discard(game)
                if game.session.over:  # its last timestep is about to be shown: it is no longer paused
                    game.tell_countdown(0)
                elif game.episode not in lost:
                    game.release(DATABASE)  # first: the countdown comes before its timestep
                self._settle(game, lost)
