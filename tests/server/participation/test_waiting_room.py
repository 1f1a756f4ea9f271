"""The waiting room alone: who is paired when, whatever happens during seating."""

import asyncio
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from server.participation import waiting_room
from server.participation.waiting_room import Outlook, PairingRequest, WaitingRoom
from server.play.clock import Clock
from server.play.close_codes import CloseCode
from server.store.database import DatabaseDown

ROOM = (1, "tom", "episode-1", False)


class WaitingTab:
    """A socket that keeps what it is told."""

    tab, is_new_page, next_url = "tab", True, "/s/pairs/now"

    def __init__(self) -> None:
        self.told: list[Any] = []
        self.closed: int | None = None

    def send(self, message: Any) -> None:
        self.told.append(message)

    def close(self, code: int, reason: str) -> None:
        self.closed = self.closed or code


class Seats:
    """Stands for the database; `before` runs while somebody is being seated."""

    def __init__(self) -> None:
        self.pairs: list[tuple[str, str]] = []
        self.alone: list[str] = []
        self.without_partner: set[str] = set()  # whose partner has left
        self.paused = False  # the study
        self.before: list[Callable[[], None]] = []

    async def two(self, first: str, second: str) -> bool:
        await self._meanwhile()
        self.pairs.append((first, second))
        return True

    async def one(self, participant: str) -> None:
        await self._meanwhile()
        self.alone.append(participant)

    async def outlook(self, participant: str) -> Outlook:
        await self._meanwhile()
        if participant in self.without_partner:
            return "gone"
        return "stopped" if self.paused else "open"

    async def _meanwhile(self) -> None:
        await asyncio.sleep(0)
        if self.before:
            self.before.pop(0)()


@pytest.fixture
def seats() -> Seats:
    return Seats()


@pytest.fixture
def room(seats: Seats) -> WaitingRoom:
    return WaitingRoom(Clock(), seats.two, seats.one, seats.outlook)


def request(limit_s: float = 600.0) -> PairingRequest:
    return PairingRequest(ROOM, datetime.now(UTC), limit_s)


async def until(condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(20):
        while not condition():
            await asyncio.sleep(0.01)


def come(room: WaitingRoom, *people: str, limit_s: float = 600.0) -> list[WaitingTab]:
    tabs = [WaitingTab() for _ in people]
    for person, tab in zip(people, tabs, strict=True):
        room.enter(person, request(limit_s), tab)
    return tabs


async def test_a_pairing_request_from_before_the_seat_was_stored_is_dismissed_at_once(
    room: WaitingRoom, seats: Seats
) -> None:
    asked_before = request()
    tabs = come(room, "ann", "bob")
    await until(lambda: all(tab.closed for tab in tabs))
    late = WaitingTab()  # another socket of hers: what it knows is older than the seat
    room.enter("ann", asked_before, late)
    assert late.closed == CloseCode.GAME_READY
    again = WaitingTab()  # and who has no game after all waits, without an endless circle
    room.enter("ann", request(), again)
    assert again.closed is None
    assert seats.pairs == [("ann", "bob")]


async def test_after_the_database_was_away_both_are_seated_together(room: WaitingRoom, seats: Seats) -> None:
    def away() -> None:
        raise DatabaseDown("away")

    seats.before.append(away)
    tabs = come(room, "ann", "bob")
    await until(lambda: all(tab.closed for tab in tabs))
    assert [tab.closed for tab in tabs] == [CloseCode.GAME_READY] * 2
    assert seats.pairs == [("ann", "bob")]


async def test_a_fault_in_seating_lets_both_come_back_and_the_others_are_served(
    room: WaitingRoom, seats: Seats
) -> None:
    def fault() -> None:
        raise RuntimeError("a fault")

    seats.before.append(fault)
    tabs = come(room, "ann", "bob", "cleo", "dora")
    await until(lambda: all(tab.closed for tab in tabs))
    assert [tab.closed for tab in tabs] == [CloseCode.FAILED] * 2 + [CloseCode.GAME_READY] * 2
    assert seats.pairs == [("cleo", "dora")]


async def test_a_participant_who_left_during_seating_is_not_paired(room: WaitingRoom, seats: Seats) -> None:
    tabs = come(room, "ann", "bob", "cleo", "dora", "eve")
    seats.before.append(lambda: room.leave("cleo", tabs[2]))
    await until(lambda: len(seats.pairs) == 2)
    assert seats.pairs == [("ann", "bob"), ("dora", "eve")]


async def test_a_participant_who_left_the_waiting_room_early_is_not_seated_alone(
    room: WaitingRoom, seats: Seats
) -> None:
    first, second = come(room, "ann", limit_s=0.0) + come(room, "bob", limit_s=0.0)
    room.leave("bob", second)
    second = WaitingTab()
    room.enter("bob", PairingRequest((1, "none", "episode-1", False), datetime.now(UTC), 0.0), second)
    seats.before.append(lambda: room.leave("bob", second))
    await until(lambda: first.closed is not None and len(room) == 0)
    await asyncio.sleep(0)
    assert seats.alone == ["ann"]


def wait_for(room: WaitingRoom, person: str, partner: str) -> WaitingTab:
    tab = WaitingTab()
    room.enter(person, PairingRequest(ROOM, datetime.now(UTC), 600.0, partner), tab)
    return tab


async def test_a_participant_whose_partner_has_left_the_study_does_not_wait_any_longer(
    room: WaitingRoom, seats: Seats
) -> None:
    seats.without_partner.add("ann")
    ann, bob = wait_for(room, "ann", "gone"), wait_for(room, "bob", "late")
    await until(lambda: ann.closed is not None)
    assert ann.closed == CloseCode.GAME_READY
    assert seats.alone == ["ann"]
    await until(lambda: bool(bob.told))
    assert bob.closed is None, "the partner may still come"


@pytest.mark.parametrize("error", [DatabaseDown("away"), RuntimeError("a fault")])
async def test_a_question_that_the_database_does_not_answer_changes_nothing(
    room: WaitingRoom, seats: Seats, error: Exception
) -> None:
    def fail() -> None:
        raise error

    seats.before.append(fail)
    ann = wait_for(room, "ann", "late")
    await until(lambda: bool(ann.told))
    assert (ann.closed, seats.alone) == (None, [])


async def test_a_participant_who_leaves_while_the_partner_is_looked_for_is_not_seated_alone(
    room: WaitingRoom, seats: Seats
) -> None:
    seats.without_partner.add("ann")
    tab = WaitingTab()
    seats.before.append(lambda: room.leave("ann", tab))
    room.enter("ann", PairingRequest(ROOM, datetime.now(UTC), 600.0, "gone"), tab)
    await until(lambda: len(room) == 0)
    await asyncio.sleep(0)
    assert seats.alone == []


async def test_time_in_which_the_study_is_paused_does_not_count_as_waiting(
    room: WaitingRoom, seats: Seats, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(waiting_room, "ASK_EVERY_S", 0.05)
    seats.paused = True
    (ann,) = come(room, "ann", limit_s=0.4)
    await asyncio.sleep(1.0)
    assert seats.alone == []
    seats.paused = False
    await until(lambda: ann.closed is not None)
    assert seats.alone == ["ann"]


async def test_two_who_can_play_are_seated_also_while_the_study_is_paused(room: WaitingRoom, seats: Seats) -> None:
    seats.paused = True
    tabs = come(room, "ann", "bob")
    await until(lambda: all(tab.closed for tab in tabs))
    assert seats.pairs == [("ann", "bob")]


async def test_a_pause_of_which_the_room_has_not_heard_yet_sends_nobody_on_alone(
    room: WaitingRoom, seats: Seats
) -> None:
    (ann,) = come(room, "ann", limit_s=0.3)
    await until(lambda: bool(ann.told))
    seats.paused = True
    await asyncio.sleep(0.8)
    assert seats.alone == []


@pytest.mark.parametrize("days", [-1, 1])
async def test_a_wall_clock_that_is_set_does_not_change_how_long_somebody_waits(seats: Seats, days: int) -> None:
    class SetClock(Clock):
        moved = timedelta()

        def wall(self) -> datetime:
            return super().wall() + self.moved

    clock = SetClock()
    room = WaitingRoom(clock, seats.two, seats.one, seats.outlook)
    (ann,) = come(room, "ann", limit_s=0.5)
    await until(lambda: bool(ann.told))
    clock.moved = timedelta(days=days)
    await asyncio.sleep(0.2)
    assert seats.alone == []
    await until(lambda: ann.closed is not None)
    assert seats.alone == ["ann"]


async def test_the_wait_of_an_earlier_page_counts(room: WaitingRoom, seats: Seats) -> None:
    tab = WaitingTab()
    room.enter("ann", PairingRequest(ROOM, datetime.now(UTC), 600.0, waited_s=599.8), tab)
    await until(lambda: tab.closed is not None)
    assert seats.alone == ["ann"]
