"""Ticks of an export: one row per timestep t, with state t as it was before the actions and what was then done in it.

A stored tick n has the step that led to state n and the predictions for it; a row here is tick t joined with the step
in tick t + 1. Rows are built column by column, as a study has millions of them.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import polars as pl
from sqlalchemy import Connection

from server.export import intention_rows
from server.export.codebook import ACTION_NAMES, STEPS
from server.store.interactions import next_in_episode
from server.store.tables import ticks

EPISODES = 64  # of a chunk
_NAMES = [column.name for column in ticks.c]
_INTENTIONS = _NAMES.index("intentions")
_PROBABILITIES = len(STEPS) * len(ACTION_NAMES)
_NOTHING_PREDICTED = np.full(_PROBABILITIES, np.nan, "<f4").tobytes()
_EMPTY = 255  # in place of a step that was not displayed
_OF_STATE = {
    "next_action_0": "decided_0",
    "next_action_1": "decided_1",
    "late": "late",
    "scheduled_ms": "scheduled_ms",
    "late_ms": "late_ms",
    "models_ms": "models_ms",
}
_OF_STEP = (
    *(f"{name}_{seat}" for name in ("action", "reward", "shaped", "events") for seat in (0, 1)),
    *(f"{name}_{seat}" for name in ("key_seq", "key_client_ms", "key_received_ms") for seat in (0, 1)),
)


def chunks(connection: Connection, episodes: Iterator[str], types: pl.Schema) -> Iterator[pl.DataFrame]:
    """Yield the rows of these episodes, some episodes at a time, with the codebook's columns."""
    place = "%s" if connection.dialect.name == "postgresql" else "?"
    query = f"SELECT {', '.join(_NAMES)} FROM ticks WHERE episode_id = {place} ORDER BY timestep"  # noqa: S608
    cursor = connection.connection.cursor()  # the driver's cursor, whose rows are plain tuples
    before: list[Any] = []
    after: list[Any] = []
    came: list[Any] = []  # what the watched chef did next in each state
    gathered = 0
    for episode in episodes:
        cursor.execute(query, (episode,))
        rows = cursor.fetchall()
        before += rows[:-1]
        after += rows[1:]
        has_intentions = any(row[_INTENTIONS] for row in rows)
        came.extend(next_in_episode(connection, episode)[:-1] if has_intentions else [None] * len(rows[:-1]))
        gathered += 1
        if gathered == EPISODES:
            if before:
                yield _table(before, after, came, types)
            before, after, came, gathered = [], [], [], 0
    if before:
        yield _table(before, after, came, types)


def _table(before: Sequence[Any], after: Sequence[Any], came: Sequence[Any], types: pl.Schema) -> pl.DataFrame:
    state = dict(zip(_NAMES, zip(*before, strict=True), strict=True))
    step = dict(zip(_NAMES, zip(*after, strict=True), strict=True))
    columns: dict[str, Any] = {"episode": state["episode_id"], "timestep": state["timestep"]}
    columns["state_hash"] = [value.hex() for value in map(bytes, state["state_hash"])]
    columns |= {name: step[name] for name in _OF_STEP}
    columns |= {ours: state[theirs] for theirs, ours in _OF_STATE.items()}
    columns["made_at"] = [None if at is None else round(1000 * at) for at in state["made_unix_ms"]]
    columns["late"] = [bool(value) for value in state["late"]]
    for name in ("asked", "misleading", "in_sight"):
        columns[name] = [None if value is None else bool(value) for value in state[name]]
    columns |= _predicted(state["prediction"]) | _displayed(state["displayed"])
    columns |= intention_rows.columns(state["intentions"], state["displayed_intention"], came)
    return pl.DataFrame([pl.Series(name, columns[name], kind) for name, kind in types.items()])


def _predicted(blobs: Sequence[Any]) -> dict[str, Any]:
    """Return the probabilities and the most probable action of each step; null where nothing was predicted."""
    flat = b"".join(blob or _NOTHING_PREDICTED for blob in blobs)
    table = np.frombuffer(flat, "<f4").reshape(-1, len(STEPS), len(ACTION_NAMES))  # (rows, steps, actions)
    nothing = np.array([blob is None for blob in blobs])
    found: dict[str, Any] = {}
    for index, step in enumerate(STEPS):
        for action, name in enumerate(ACTION_NAMES):
            values = np.ascontiguousarray(table[:, index, action], np.float32)
            found[f"p{step}_{name}"] = intention_rows.without(values, nothing)
        best = np.where(nothing[:, None], 0, table[:, index]).argmax(1).astype(np.int16)
        found[f"predicted_{step}"] = intention_rows.without(best, nothing)
    return found


def _displayed(blobs: Sequence[Any]) -> dict[str, Any]:
    """Return the drawn action and opacity of each step; null where the frame carried fewer steps."""
    width = 2 * len(STEPS)
    flat = b"".join(bytes(blob)[:width].ljust(width, bytes([_EMPTY])) for blob in blobs)
    table = (
        np.frombuffer(flat, np.uint8).reshape(-1, len(STEPS), 2).astype(np.int16)
    )  # (rows, steps, action and opacity)
    missing = table[:, :, 0] == _EMPTY  # (rows, steps)
    found: dict[str, Any] = {}
    for index, step in enumerate(STEPS):
        for place, name in enumerate(("displayed", "opacity")):
            values = np.ascontiguousarray(table[:, index, place])
            found[f"{name}_{step}"] = intention_rows.without(values, missing[:, index])
    return found
