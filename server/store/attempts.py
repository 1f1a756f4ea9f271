"""Limits on guessing passwords and completion codes. A try is counted before it is checked, so that the limit holds for
simultaneous requests in any number of server processes. A correct try is given back.
"""

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from sqlalchemy import ColumnElement, Connection, delete, func, or_, select

from server.store.tables import attempts

WINDOW: Final = timedelta(minutes=15)
LIMIT: Final = 5  # wrong tries in the window of one name from one origin
ATTACKED_AFTER: Final = 50  # tries in the window on one name from all origins: then each origin has only one


@dataclass(frozen=True)
class Reserved:
    """A try that is counted; `left`: how many more there are if it is wrong."""

    id: int
    left: int


def reserve(connection: Connection, kind: str, name: str, origin: str, now: datetime) -> Reserved | None:
    """Count a try, or return None if this origin has none left for this name.

    `kind`: what is tried. `origin`: who tries, as a hash. No origin can use up the tries of another one.
    """
    a = attempts.c
    connection.execute(delete(attempts).where(a.kind == kind, is_out_of(WINDOW, now)))
    same = (a.kind == kind, a.name == name)
    of_all = _count(connection, *same)
    mine = _count(connection, *same, a.origin == origin)
    limit = LIMIT if of_all - mine < ATTACKED_AFTER else 1
    if mine >= limit:
        return None
    row = {"kind": kind, "name": name, "origin": origin, "at": now}
    number = connection.execute(attempts.insert().values(row)).inserted_primary_key
    assert number is not None  # noqa: S101 - an insert of one row has a key
    return Reserved(number[0], limit - mine - 1)


def release(connection: Connection, reserved: Reserved) -> None:
    """Take a try back: it was right, or it was never checked."""
    connection.execute(delete(attempts).where(attempts.c.id == reserved.id))


def forget(connection: Connection, name: str) -> None:
    """Forget every try on a name: the next one need not wait."""
    connection.execute(delete(attempts).where(attempts.c.name == name))


def is_out_of(window: timedelta, now: datetime) -> ColumnElement[bool]:
    """Return the condition for tries that no longer count. Those from the future do not count either: the machine's
    clock was set back since then, perhaps by days."""
    return or_(attempts.c.at <= now - window, attempts.c.at > now + window)


def _count(connection: Connection, *where: object) -> int:
    query = select(func.count()).select_from(attempts).where(*where)  # type: ignore[arg-type]
    return connection.execute(query).scalar_one()
