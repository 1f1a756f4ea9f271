"""The most used table: convert TickRecord to a row and back, and insert the ticks of all games of a slot at once.

A tick may be stored twice (a commit may succeed although its answer got lost), but not another one in its place.
"""

import struct
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from functools import cache
from itertools import chain
from typing import Any

from sqlalchemy import Connection, Row, select, tuple_, update

from server.play.recorder import KeyRecord, TickRecord
from server.store import inputs, packed_intentions
from server.store.tables import episodes, ticks

PREDICTION = struct.Struct("<18f")  # 3 steps x 6 actions
_ACTIONS = 6
_NAMES = [column.name for column in ticks.c]
_NO_KEY = (None, None, None)

Values = tuple[Any, ...]


def insert(connection: Connection, records: Sequence[TickRecord]) -> tuple[tuple[str, int], ...]:
    """Store ticks of any episodes; tick 0 starts its episode. What is stored already and equal counts as stored.

    Returns (episode, timestep) where another tick is stored already: those are left as they are. Raises IntegrityError
    if an episode is not in the database: nothing is stored then, see `insert_of_known`.
    """
    starting = [record.episode for record in records if record.timestep == 0]
    if starting:
        start = update(episodes).where(episodes.c.id.in_(starting), episodes.c.status == "new")
        connection.execute(start.values(status="running", started_at=datetime.now(UTC)))
    rows = list(map(row_of, records))
    if not rows:
        return ()
    inserted = connection.exec_driver_sql(_insert_text(connection.dialect.name), rows).rowcount
    inputs.insert(connection, chain.from_iterable(record.inputs for record in records))
    return () if inserted == len(rows) else _conflicts(connection, rows)


def insert_of_known(connection: Connection, records: Sequence[TickRecord]) -> tuple[tuple[str, int], ...]:
    """Insert the ticks except those of deleted episodes: nothing is kept of a participant who withdrew."""
    wanted = {record.episode for record in records}
    known = set(connection.execute(select(episodes.c.id).where(episodes.c.id.in_(wanted))).scalars())
    return insert(connection, [record for record in records if record.episode in known])


def of_episode(connection: Connection, episode_id: str, after: int = -1) -> list[TickRecord]:
    """Return all ticks of an episode that follow timestep `after`, in order. Predictions come back as rounded to 32
    bits."""
    query = select(ticks).where(ticks.c.episode_id == episode_id, ticks.c.timestep > after).order_by(ticks.c.timestep)
    return [record_of(row) for row in connection.execute(query)]


def row_of(record: TickRecord) -> Values:
    """Return the values of a tick in the order of the table's columns. Raises ValueError for two keys of one seat."""
    keys: list[Values] = [_NO_KEY, _NO_KEY]
    for key in record.keys:
        if keys[key.seat] is not _NO_KEY:
            raise ValueError(f"tick {record.timestep} of episode {record.episode} has two keys of seat {key.seat}")
        keys[key.seat] = (key.seq, key.client_ms, key.received_ms)
    prediction = None
    if record.prediction:
        first, second, third = record.prediction
        prediction = PREDICTION.pack(*first, *second, *third)
    return (
        record.episode,
        record.timestep,
        *(record.actions or (None, None)),
        bytes.fromhex(record.state_hash),
        *record.rewards,
        *record.shaped,
        *record.events,
        *record.next_actions,
        prediction,
        bytes(chain.from_iterable(record.displayed)),
        record.late,
        record.scheduled_ms,
        record.late_ms,
        record.models_ms,
        *keys[0],
        *keys[1],
        record.made_unix_ms,
        record.asked,
        record.misleading,
        record.in_sight,
        packed_intentions.pack(record.intentions),
        packed_intentions.pack_shown(record.displayed_intention),
    )


def record_of(row: "Row[Any]") -> TickRecord:
    """Return the inverse of `row_of`; inputs have a separate table."""
    return TickRecord(
        episode=row.episode_id,
        timestep=row.timestep,
        actions=None if row.action_0 is None else (row.action_0, row.action_1),
        state_hash=row.state_hash.hex(),
        rewards=(row.reward_0, row.reward_1),
        shaped=(row.shaped_0, row.shaped_1),
        events=(row.events_0, row.events_1),
        next_actions=(row.next_action_0, row.next_action_1),
        prediction=probabilities(row.prediction),
        displayed=tuple(zip(row.displayed[::2], row.displayed[1::2], strict=True)),
        keys=tuple(_keys(row)),
        scheduled_ms=row.scheduled_ms,
        late_ms=row.late_ms,
        models_ms=row.models_ms,
        late=row.late,
        made_unix_ms=row.made_unix_ms,
        asked=row.asked,
        misleading=row.misleading,
        in_sight=row.in_sight,
        intentions=packed_intentions.unpack(row.intentions),
        displayed_intention=packed_intentions.unpack_shown(row.displayed_intention),
    )


def probabilities(blob: bytes | None) -> tuple[tuple[float, ...], ...]:
    """Return the 3 x 6 probabilities in a stored prediction; empty where there is none."""
    if blob is None:
        return ()
    flat = PREDICTION.unpack(blob)
    return tuple(flat[start : start + _ACTIONS] for start in range(0, len(flat), _ACTIONS))


def _keys(row: "Row[Any]") -> Iterable[KeyRecord]:
    if row.key_seq_0 is not None:
        yield KeyRecord(0, row.key_seq_0, row.key_client_ms_0, row.key_received_ms_0)
    if row.key_seq_1 is not None:
        yield KeyRecord(1, row.key_seq_1, row.key_client_ms_1, row.key_received_ms_1)


@cache
def _insert_text(dialect: str) -> str:
    """Return the statement as text for the driver: building this statement again would cost more than running it."""
    place = "%s" if dialect == "postgresql" else "?"
    places = ", ".join([place] * len(_NAMES))
    conflict = "ON CONFLICT (episode_id, timestep) DO NOTHING"
    return f"INSERT INTO ticks ({', '.join(_NAMES)}) VALUES ({places}) {conflict}"  # noqa: S608 - our own names only


def _conflicts(connection: Connection, rows: Sequence[Values]) -> tuple[tuple[str, int], ...]:
    """Return which of these rows are stored with other content."""
    keys = [row[:2] for row in rows]
    stored = connection.execute(select(ticks).where(tuple_(ticks.c.episode_id, ticks.c.timestep).in_(keys)))
    found = {(row.episode_id, row.timestep): tuple(row) for row in stored}
    return tuple((row[0], row[1]) for row in rows if found.get((row[0], row[1])) != row)
