"""The moments at which games tick: a tick has several slots, and each makes the timesteps of its games in one batch."""

import asyncio
import math
from collections.abc import Iterable, Sequence
from typing import Final

from server.play.clock import Clock
from server.play.game import Game

SLOT_MS: Final = 40  # five batches in a tick of 200 ms: each costs the same 4 ms, however few games are in it
PATIENT_SLOTS: Final = 3  # a patient clock has no fixed moments, and large batches are more efficient
GAP_S: Final = 0.012  # work that can wait begins only with so much time until the next batch
BATCH_S: Final = 0.006  # a batch of a quiet server is made and stored by then
MAX_WAITS: Final = 3


class Slot:
    """The games that tick at the same moments."""

    def __init__(self, tick_ms: int, index: int) -> None:
        self.tick_s = tick_ms / 1000
        self.offset_s = index * SLOT_MS / 1000
        self.games: set[Game] = set()
        self.driver: asyncio.Task[None] | None = None
        self.asleep = False  # the driver waits for a deadline and may be stopped without harm

    def first_after(self, moment: float) -> float:
        """Return the slot's first moment at or after `moment`."""
        return math.ceil((moment - self.offset_s) / self.tick_s) * self.tick_s + self.offset_s


def slots_of(tick_ms: int, patient: bool) -> list[Slot]:
    """Return the slots of games with this tick. `patient`: their clock waits for its players."""
    count = PATIENT_SLOTS if patient else max(1, tick_ms // SLOT_MS)
    return [Slot(tick_ms, index) for index in range(count)]


def until_next_s(slots: Iterable[Slot], clock: Clock) -> float:
    """Return the seconds until the next batch is due; infinity if none is, or if the games do not follow the wall
    clock."""
    if clock.patience_s or clock.speed != 1:
        return math.inf
    now = clock.now()
    return min((slot.first_after(now) for slot in slots if slot.games), default=math.inf) - now


async def between_batches(slots: Sequence[Slot], clock: Clock) -> None:
    """Return when no batch is due for GAP_S; a server too busy for such moments returns after MAX_WAITS batches."""
    for _ in range(MAX_WAITS):
        left_s = until_next_s(slots, clock)
        if left_s >= GAP_S:
            return
        await clock.sleep(left_s + BATCH_S)
