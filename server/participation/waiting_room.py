"""The waiting room: pair people of one condition who have reached the same round, as they arrive. It has sockets but no
database: functions given to it store the seats, and look whether somebody can still come.
"""

import asyncio
import logging
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from datetime import datetime
from typing import Final, Literal

from server.play.clock import Clock
from server.play.close_codes import CloseCode
from server.play.game import Connection
from server.play.messages import Superseded, Waiting
from server.store.database import DatabaseDown

log = logging.getLogger(__name__)
LOOK_EVERY_S: Final = 0.1
TELL_EVERY_S: Final = 1.0
ASK_EVERY_S: Final = 2.0  # whether somebody can still come
MAX_SEATED: Final = 10_000  # people whose last seat is remembered
Room = tuple[int, str, str, bool]  # study version, condition, step, simulated or not
# Whether somebody can still come; "stopped": not now, but later, so the time does not count.
Outlook = Literal["open", "stopped", "gone"]


@dataclass(frozen=True)
class PairingRequest:
    """A request for a round of two. People with equal `room`s can be seated together. `waited_s`: how long they have
    waited on earlier pages, without the pauses of the study."""

    room: Room
    since: datetime  # when they first came to this round
    limit_s: float
    partner: str | None = None  # only this person: they have played together before
    waited_s: float = 0.0


@dataclass
class _Waiter:
    participant: str
    request: PairingRequest
    connection: Connection
    counted_at: float  # until when the wait is counted, by the clock: setting the machine's time does not change it
    waited_s: float = 0.0  # since they entered
    told_at: float = -TELL_EVERY_S
    asked_at: float = -ASK_EVERY_S
    outlook: Outlook = "open"
    busy: bool = False  # being seated


SeatTwo = Callable[[str, str], Awaitable[bool]]  # False: one of them can no longer play this round
SeatAlone = Callable[[str], Awaitable[None]]
LookOut = Callable[[str], Awaitable[Outlook]]  # for this person


class WaitingRoom:
    """All people who wait for a partner. Made once in server.main."""

    def __init__(self, clock: Clock, seat_two: SeatTwo, seat_alone: SeatAlone, look_out: LookOut) -> None:
        self._clock, self._seat_two, self._seat_alone, self._look_out = clock, seat_two, seat_alone, look_out
        self._waiting: dict[str, _Waiter] = {}  # by participant, in order of arrival
        self._seated: dict[str, Room] = {}  # by participant: where they got a seat last
        self._keeper: asyncio.Task[None] | None = None

    def __len__(self) -> int:
        return len(self._waiting)

    def enter(self, participant: str, request: PairingRequest, connection: Connection) -> None:
        """Add a waiting participant; the newest tab takes over. A participant who got a seat after the request was read
        is dismissed at once, because they have a game already.
        """
        if self._seated.pop(participant, None) == request.room:
            connection.close(CloseCode.GAME_READY, "there is a game now")
            return
        before = self._waiting.get(participant)
        if before is not None and before.connection is not connection:
            before.connection.send(Superseded())
            before.connection.close(CloseCode.SUPERSEDED, "another tab has taken over")
        busy = before is not None and before.busy
        self._waiting[participant] = _Waiter(participant, request, connection, self._clock.now(), busy=busy)
        if self._keeper is None or self._keeper.done():
            self._keeper = asyncio.create_task(self._keep())

    def leave(self, participant: str, connection: Connection) -> None:
        """Handle a closed socket; nothing happens if another one has taken over."""
        waiter = self._waiting.get(participant)
        if waiter is not None and waiter.connection is connection:
            del self._waiting[participant]

    async def _keep(self) -> None:
        while self._waiting:
            self._count()
            waiting = sorted(self._waiting.values(), key=lambda waiter: waiter.request.since)
            for index, waiter in enumerate(waiting):
                if not self._is_free(waiter):
                    continue
                other = next((one for one in waiting[index + 1 :] if self._is_free(one) and fit(waiter, one)), None)
                await self._serve(waiter, other)
            await self._clock.sleep(LOOK_EVERY_S)

    def _count(self) -> None:
        """Count the time in which people wait and somebody can come."""
        now = self._clock.now()
        for waiter in self._waiting.values():
            if waiter.outlook != "stopped":
                waiter.waited_s += now - waiter.counted_at
            waiter.counted_at = now

    def _is_free(self, waiter: _Waiter) -> bool:
        """Return whether they still wait in this tab and are not being seated (seating awaits the database)."""
        return self._waiting.get(waiter.participant) is waiter and not waiter.busy

    async def _serve(self, waiter: _Waiter, other: _Waiter | None) -> None:
        if other is None and not await self._continues_alone(waiter):
            self._tell(waiter)
            return
        if not self._is_free(waiter):  # they left while the database was read
            return
        some = [waiter] if other is None else [waiter, other]
        for one in some:
            one.busy = True
        try:
            seated = await self._seat(some)
        except DatabaseDown:
            for one in some:
                self._waiting.get(one.participant, one).busy = False
            log.warning("people cannot be paired while the database is unavailable")
        except Exception:
            log.exception("%d waiting people cannot be paired", len(some))
            for one in some:
                self._dismiss(one, CloseCode.FAILED, "the server failed")
        else:
            for one in some:
                if seated:
                    self._remember(one)
                self._dismiss(one, CloseCode.GAME_READY, "there is a game now")

    async def _continues_alone(self, waiter: _Waiter) -> bool:
        """Return whether nobody else can come, or nobody has come in time. At the end of the time the outlook is
        read once more, because a pause of the study may be newer."""
        now = self._clock.now() / self._clock.speed
        is_late = self._left_s(waiter) <= 0
        if now - waiter.asked_at >= ASK_EVERY_S or (is_late and waiter.outlook == "open"):
            waiter.asked_at, waiter.outlook = now, await self._outlook(waiter)
        return waiter.outlook == "gone" or (is_late and waiter.outlook == "open")

    async def _outlook(self, waiter: _Waiter) -> Outlook:
        try:
            return await self._look_out(waiter.participant)
        except DatabaseDown:
            return "stopped"  # nobody's page can be opened either
        except Exception:
            log.exception("it is not known whether somebody can come to a participant who waits")
            return "open"

    async def _seat(self, some: list[_Waiter]) -> bool:
        """Seat two people; return whether they have a game now."""
        if len(some) == 2:
            return await self._seat_two(some[0].participant, some[1].participant)
        await self._seat_alone(some[0].participant)
        return True

    def _remember(self, waiter: _Waiter) -> None:
        self._seated.pop(waiter.participant, None)
        self._seated[waiter.participant] = waiter.request.room
        if len(self._seated) > MAX_SEATED:
            del self._seated[next(iter(self._seated))]

    def _dismiss(self, waiter: _Waiter, code: CloseCode, reason: str) -> None:
        """Close their current socket: the page connects again and finds the game."""
        now = self._waiting.pop(waiter.participant, waiter)
        now.connection.close(code, reason)

    def _tell(self, waiter: _Waiter) -> None:
        now = self._clock.now() / self._clock.speed
        if now - waiter.told_at >= TELL_EVERY_S:
            waiter.told_at = now
            left_s = max(0.1, self._left_s(waiter) / self._clock.speed)
            waiter.connection.send(Waiting(round(left_s, 1)))

    def _left_s(self, waiter: _Waiter) -> float:
        return waiter.request.limit_s - waiter.request.waited_s * self._clock.speed - waiter.waited_s


def fit(one: _Waiter, other: _Waiter) -> bool:
    """Return whether two people may be seated together."""
    if one.request.room != other.request.room:
        return False
    return one.request.partner in (None, other.participant) and other.request.partner in (None, one.participant)
