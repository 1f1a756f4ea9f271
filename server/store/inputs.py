"""Every input that arrived in a game: stored with the tick, pause or end that knows its outcome; while the game stands
still, on their own."""

from collections.abc import Iterable, Mapping
from functools import cache
from operator import attrgetter
from typing import Final

from sqlalchemy import Connection, func, select

from server.play.recorder import REPEATED, InputRecord, StoredInputs
from server.store.tables import episodes, inputs

_NAMES: Final = [column.name for column in inputs.c]
_row_of: Final = attrgetter(*("episode" if name == "episode_id" else name for name in _NAMES))


def insert(connection: Connection, records: Iterable[InputRecord]) -> None:
    """Store inputs of episodes that are in the database. What is stored already is left as it is."""
    rows = list(map(_row_of, records))
    if rows:
        connection.exec_driver_sql(_insert_text(connection.dialect.name), rows)


def insert_of_known(connection: Connection, episode_id: str, records: Iterable[InputRecord]) -> None:
    """As `insert`, for one episode, of which nothing is stored if it was deleted (its participant withdrew)."""
    if connection.execute(select(episodes.c.id).where(episodes.c.id == episode_id)).first() is not None:
        insert(connection, records)


def of_episode(connection: Connection, episode_id: str) -> list[InputRecord]:
    """Return the episode's inputs, in the order of their arrival."""
    order = (inputs.c.received_unix_ms, inputs.c.seat, inputs.c.number)
    rows = connection.execute(select(inputs).where(inputs.c.episode_id == episode_id).order_by(*order))
    return [InputRecord(*row) for row in rows]


def stored(connection: Connection, episode_id: str) -> Mapping[int, StoredInputs]:
    """Return by seat how many inputs are stored, and the newest `seq` of each tab."""
    here = inputs.c.episode_id == episode_id
    counted = select(inputs.c.seat, func.max(inputs.c.number)).where(here).group_by(inputs.c.seat)
    last = select(inputs.c.seat, inputs.c.tab, func.max(inputs.c.number).label("number"))
    last_of_tab = last.where(here, inputs.c.outcome != REPEATED).group_by(inputs.c.seat, inputs.c.tab).subquery()
    same = (inputs.c.seat == last_of_tab.c.seat) & (inputs.c.number == last_of_tab.c.number)
    newest = select(inputs.c.seat, inputs.c.tab, inputs.c.seq).join_from(inputs, last_of_tab, same).where(here)
    seqs: dict[int, dict[str, int]] = {}
    for seat, tab, seq in connection.execute(newest.order_by(inputs.c.number)):
        seqs.setdefault(seat, {})[tab] = seq
    return {seat: StoredInputs(count, seqs.get(seat, {})) for seat, count in connection.execute(counted)}


@cache
def _insert_text(dialect: str) -> str:
    """Return the statement as text for the driver, as for ticks."""
    place = "%s" if dialect == "postgresql" else "?"
    places = ", ".join([place] * len(_NAMES))
    conflict = "ON CONFLICT (episode_id, seat, number) DO NOTHING"
    return f"INSERT INTO inputs ({', '.join(_NAMES)}) VALUES ({places}) {conflict}"  # noqa: S608 - our own names only
