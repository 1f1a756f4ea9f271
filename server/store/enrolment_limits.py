"""How many new participants an address may bring in an hour, counted in the database.

The count is part of the transaction that enrols somebody: parallel requests and several processes share it, a place
from which nobody came is not counted, and a restart does not forget it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from sqlalchemy import Connection, delete, func, not_, select

from server.store.attempts import is_out_of
from server.store.tables import attempts

WINDOW: Final = timedelta(hours=1)
NEW: Final = "new participant"
TURNED_AWAY: Final = "turned away"
MAX_TURNED_AWAY: Final = 1000  # rows of one study: more people are not counted


class EnrolmentLimitReached(Exception):
    """The address has brought as many new participants as it may in an hour."""


@dataclass(frozen=True)
class EnrolmentLimit:
    """How many new participants a network may bring in an hour. `network`: a keyed hash of it."""

    network: str
    most: int


def check(connection: Connection, limits: Sequence[EnrolmentLimit], now: datetime) -> None:
    """Raise EnrolmentLimitReached if one of the limits is used up."""
    for limit in limits:
        if _count(connection, NEW, limit.network, now) >= limit.most:
            raise EnrolmentLimitReached


def take(connection: Connection, limits: Sequence[EnrolmentLimit], now: datetime) -> None:
    """Count a new participant in every limit."""
    for limit in limits:
        _add(connection, NEW, limit.network, now)


def turn_away(connection: Connection, study: str, now: datetime) -> None:
    """Count somebody who was refused, for the alert."""
    if _count(connection, TURNED_AWAY, study, now) < MAX_TURNED_AWAY:
        _add(connection, TURNED_AWAY, study, now)


def turned_away(connection: Connection, study: str, now: datetime) -> int:
    """Return how many were refused within the last hour."""
    return _count(connection, TURNED_AWAY, study, now)


def forget_turned_away(connection: Connection, study: str) -> None:
    """Forget how many were refused."""
    connection.execute(delete(attempts).where(attempts.c.kind == TURNED_AWAY, attempts.c.name == study))


def _add(connection: Connection, kind: str, name: str, now: datetime) -> None:
    a = attempts.c
    connection.execute(delete(attempts).where(a.kind == kind, is_out_of(WINDOW, now)))
    connection.execute(attempts.insert().values(kind=kind, name=name, origin="", at=now))


def _count(connection: Connection, kind: str, name: str, now: datetime) -> int:
    a = attempts.c
    query = (
        select(func.count()).select_from(attempts).where(a.kind == kind, a.name == name, not_(is_out_of(WINDOW, now)))
    )
    return connection.execute(query).scalar_one()
