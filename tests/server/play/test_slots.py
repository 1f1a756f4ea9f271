"""The moments at which games tick, and the moments between them."""

import math
from typing import Any

import pytest

from server.play.clock import Clock
from server.play.slots import BATCH_S, GAP_S, MAX_WAITS, Slot, between_batches, slots_of, until_next_s


class StoppedClock(Clock):
    """Stands at a moment; sleeping moves it, by as much and `overslept` more."""

    def __init__(self, moment: float, speed: float = 1.0, patience_s: float = 0.0, overslept: float = 0.0) -> None:
        super().__init__(speed, patience_s)
        self.moment, self.overslept, self.slept = moment, overslept, 0

    def now(self) -> float:
        return self.moment

    async def sleep(self, seconds: float) -> None:
        self.moment += seconds + self.overslept
        self.slept += 1


def occupied(*indices: int) -> list[Slot]:
    game: Any = object()
    slots = slots_of(200, patient=False)
    for index in indices:
        slots[index].games.add(game)
    return slots


def test_tick_has_five_slots_and_a_patient_one_three() -> None:
    assert [slot.offset_s for slot in slots_of(200, patient=False)] == [0, 0.04, 0.08, 0.12, 0.16]
    assert len(slots_of(200, patient=True)) == 3


def test_next_batch_is_that_of_the_next_slot_with_games() -> None:
    assert until_next_s(occupied(1, 3), StoppedClock(10.05)) == pytest.approx(0.07)
    assert until_next_s(occupied(1), StoppedClock(10.05)) == pytest.approx(0.19)
    assert until_next_s(occupied(), StoppedClock(10.05)) == math.inf


def test_no_batch_is_waited_for_where_games_do_not_follow_the_wall_clock() -> None:
    assert until_next_s(occupied(1), StoppedClock(10.05, speed=20)) == math.inf
    assert until_next_s(occupied(1), StoppedClock(10.05, patience_s=5)) == math.inf


async def test_other_work_waits_only_for_a_batch_that_is_due_soon() -> None:
    clock = StoppedClock(10.035)
    await between_batches(occupied(1, 2), clock)
    assert clock.moment == pytest.approx(10.04 + BATCH_S)
    early = StoppedClock(10.04 - GAP_S - 0.001)
    await between_batches(occupied(1, 2), early)
    assert early.slept == 0


async def test_other_work_of_a_busy_server_waits_for_a_few_batches_only() -> None:
    clock = StoppedClock(10.039, overslept=0.04 - BATCH_S - 0.001)  # wakes up shortly before each next batch
    await between_batches(occupied(0, 1, 2, 3, 4), clock)
    assert clock.slept == MAX_WAITS
