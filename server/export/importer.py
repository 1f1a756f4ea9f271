"""`kitchenmind import`: read an export back into a database, so that replay, checks and another export work as before.
What an export leaves out stays out: an imported participant cannot log in, and there are no personal data.
"""

import json
import secrets
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import msgspec
import polars as pl
from sqlalchemy import Connection, Table, func, select
from sqlalchemy.exc import DBAPIError

from server.export import codebook, manifest
from server.export.codebook import ACTION_NAMES, STEPS
from server.export.codebook_intentions import intentions_of, intentions_of_last
from server.export.files import TABLE_FORMATS, from_text, table_path
from server.export.import_checks import ImportRefused, check_files, episode_spec, plain_name, study_source
from server.export.writer import schema
from server.play.recorder import KeyRecord, TickRecord
from server.store import tables, tombstones, withdrawal
from server.store import ticks as tick_rows
from server.store.engines import is_down

Record = dict[str, Any]
_INSERT = 2000
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_UNREADABLE = (pl.exceptions.PolarsError, msgspec.MsgspecError)
IMPORTED = "imported"  # in place of the researchers' names, which are not in an export
_RENAMED = {"step": "step_key", "question": "question_key", "episode": "episode_id", "participant": "participant_id"}


def import_export(
    connection: Connection, folder: Path, withdrawn: Iterable[tombstones.Tombstone] = ()
) -> dict[str, int]:
    """Fill an empty database from an export (Parquet where there is some, else CSV); return rows by table, and as
    `left out` how many people withdrew after the export was made: by the tombstones of the database, of the export and
    those in `withdrawn`.

    Raises ImportRefused for a folder that cannot be trusted or is damaged, OSError.
    """
    if not (folder / "codebook.json").is_file():
        raise ImportRefused(
            f"{folder} is not an export: it has no codebook.json. Give a folder that `kitchenmind export` wrote."
        )
    if connection.execute(select(func.count()).select_from(tables.studies)).scalar_one():
        raise ImportRefused("the database is not empty. Import into a new one.")
    check_files(folder)
    try:
        return _import_tables(connection, folder, withdrawn)
    except DBAPIError as error:
        if is_down(error):
            raise
        reason = str(error.orig).strip()
    except (*_UNREADABLE, LookupError, TypeError, ArithmeticError, RecursionError) as error:
        reason = f"{type(error).__name__}: {error}"
    raise ImportRefused(f"{folder} is damaged ({reason}). Export the study again.")


def _import_tables(connection: Connection, folder: Path, withdrawn: Iterable[tombstones.Tombstone]) -> dict[str, int]:
    studies = _studies(connection, folder)
    counted = {"studies": len(studies)}
    counted["arrivals"] = _fill(connection, tables.arrivals, _of_study(folder, "arrivals", studies))
    counted["participants"] = _fill(connection, tables.participants, _participants(folder, studies))
    counted["withdrawals"] = _fill(connection, tables.withdrawals, _of_study(folder, "withdrawals", studies))
    counted["episodes"] = _fill(connection, tables.episodes, _episodes(folder, studies))
    counted["ticks"] = _ticks(connection, folder)
    counted["inputs"] = _fill(connection, tables.inputs, _inputs(folder))
    for name in ("pauses", "answers", "visits", "events", "exclusions"):
        counted[name] = _fill(connection, tables.metadata.tables[name], _records(folder, name))
    return _without_deleted(connection, [*tombstones.read(folder), *withdrawn], counted)


def _without_deleted(
    connection: Connection, stones: list[tombstones.Tombstone], counted: dict[str, int]
) -> dict[str, int]:
    """Delete, in the import's own transaction, who withdrew after the export was made; return the rows that stay."""
    stones += tombstones.every(connection)
    people = connection.execute(select(tables.participants.c.id)).scalars().all()
    gone = tombstones.deleted(people, stones)
    for participant_id, at in gone.items():
        deletion = withdrawal.Deletion("command line", "leave a withdrawn participant out of an import", at=at)
        withdrawal.withdraw(connection, participant_id, deletion)
    tombstones.add(connection, stones)
    if gone:
        stay = {name: select(func.count()).select_from(tables.metadata.tables[name]) for name in counted}
        counted = {name: connection.execute(query).scalar_one() for name, query in stay.items()}
    return counted | {"left out": len(gone)}


def rows(folder: Path, table: str) -> Iterator[Record]:
    """Return the rows of a table as they were exported; a column that an older export lacks is None."""
    columns = next(known for known in codebook.TABLES if known.name == table).columns
    types = schema(columns)
    is_exact = table_path(folder, "parquet", table).is_file()
    path = table_path(folder, "parquet" if is_exact else "csv", table)
    if not path.is_file():
        raise ImportRefused(f"{folder} has no table of {table}. Export the study again.")
    stored = pl.scan_parquet(path, glob=False) if is_exact else pl.scan_csv(path, infer_schema=False, glob=False)
    present = stored.collect_schema().names()
    lacking = {name: None for name in types if name not in present}
    wanted = [
        pl.col(name).cast(kind) if is_exact else from_text(name, kind)
        for name, kind in types.items()
        if name in present
    ]
    for batch in stored.select(wanted).collect_batches(chunk_size=_INSERT):
        for row in batch.iter_rows(named=True):
            yield row | lacking


def _fill(connection: Connection, table: Table, records: Iterator[Record]) -> int:
    count, waiting = 0, []
    for record in records:
        waiting.append(record)
        count += 1
        if len(waiting) == _INSERT:
            connection.execute(table.insert(), waiting)
            waiting = []
    if waiting:
        connection.execute(table.insert(), waiting)
    return count


def _studies(connection: Connection, folder: Path) -> dict[tuple[str, int], int]:
    """Insert the versions; return their numbers in the new database."""
    found = {}
    for row in rows(folder, "studies"):
        key, version = plain_name(row["study"], "the study"), row["study_version"]
        source = study_source(folder, manifest.study_file(key, version), row["sha256"])
        values = {"key": key, "version": version, "source": source}
        values |= {name: row[name] for name in ("sha256", "started", "created_at", "frozen_at")}
        values["simulated_started"] = row["simulated_started"] or 0  # older exports lack it
        new = tables.studies.insert().values(values).returning(tables.studies.c.id)
        found[key, version] = connection.execute(new).scalar_one()
    return found


def _of_study(folder: Path, table: str, studies: dict[tuple[str, int], int]) -> Iterator[Record]:
    for row in rows(folder, table):
        key, version = row.pop("study"), row.pop("study_version")
        yield row | {"study_id": None if key is None else studies[key, version]}


def _participants(folder: Path, studies: dict[tuple[str, int], int]) -> Iterator[Record]:
    for row in _of_study(folder, "participants", studies):
        for name in ("excluded", "attention_checks", "attention_failed"):
            del row[name]
        row["id"] = plain_name(row.pop("participant"), "the participant")
        row["allocation_number"] = row["allocation_number"] or row["number"]  # as in a database of that version
        yield row | {"token_hash": f"imported {secrets.token_hex(16)}"}


def _episodes(folder: Path, studies: dict[tuple[str, int], int]) -> Iterator[Record]:
    for row in _of_study(folder, "episodes", studies):
        episode = plain_name(row.pop("episode"), "the episode")
        spec = episode_spec(row["spec"], episode, row["layout_sha256"])
        for name in (
            "timesteps",
            "last_tick",
            "excluded",
            "display",
            "show",
            "view_radius",
            "misleading",
            "display_violations",
        ):
            del row[name]
        row.pop("display_violations_late", None)  # an earlier version did not export it
        yield row | {"id": episode, "step_key": row.pop("step"), "spec": spec, "grid": spec["grid"]}


def _inputs(folder: Path) -> Iterator[Record]:
    """Yield the inputs. Exports of earlier versions have no such table."""
    if not any(table_path(folder, kind, "inputs").is_file() for kind in TABLE_FORMATS):
        return
    for row in rows(folder, "inputs"):
        timestep = row["timestep"]
        yield row | {
            "episode_id": row.pop("episode"),
            "received_unix_ms": _unix_ms(row.pop("received_at")),
            "timestep": None if timestep is None else timestep + 1,
        }


def _unix_ms(at: datetime) -> float:
    return (at - _EPOCH) / timedelta(milliseconds=1)


def _records(folder: Path, table: str) -> Iterator[Record]:
    for row in rows(folder, table):
        if table == "answers":
            row["value"] = _value(row["value"], row.pop("value_type"))
        if table == "events":
            row["detail"] = json.loads(row["detail"])
        if table == "exclusions":
            row["excluded_by"] = IMPORTED
            row["restored_by"] = IMPORTED if row["restored_at"] else None
        yield {_RENAMED.get(name, name): value for name, value in row.items()}


def _value(text: str | None, kind: str) -> Any:
    """Return an answer from its text: the inverse of exported.value_text."""
    return text if text is None or kind == "text" else json.loads(text)


def _ticks(connection: Connection, folder: Path) -> int:
    """Split every timestep's row into the state before it and the step to the next state."""
    last_ticks = {row["episode"]: json.loads(row["last_tick"]) for row in rows(folder, "episodes") if row["last_tick"]}
    count, waiting = 0, []
    done: Record | None = None  # the row before, whose actions led to this row's state
    for row in rows(folder, "ticks"):
        if done is not None and done["episode"] != row["episode"]:
            waiting.append(_last(last_ticks.pop(done["episode"]), done["episode"], done))
            done = None
        waiting.append(_tick(row["episode"], row["timestep"], _of_state(row), done))
        done = row
        count += 1
        if len(waiting) >= _INSERT:
            tick_rows.insert(connection, waiting)
            waiting = []
    if done is not None:
        waiting.append(_last(last_ticks.pop(done["episode"]), done["episode"], done))
    waiting += [_last(last, episode, None) for episode, last in last_ticks.items()]
    tick_rows.insert(connection, waiting)
    return count


def _last(last: Record, episode: str, done: Record | None) -> TickRecord:
    state = last | {name: tuple(map(tuple, last[name])) for name in ("prediction", "displayed")}
    state |= intentions_of_last(last)
    return _tick(
        episode, done["timestep"] + 1 if done else 0, state | {"next_actions": tuple(last["next_actions"])}, done
    )


def _of_state(row: Record) -> Record:
    """Return a row's values of the state before the actions, as fields of TickRecord."""
    probabilities = tuple(tuple(row[f"p{step}_{name}"] for name in ACTION_NAMES) for step in STEPS)
    drawn = ((row[f"displayed_{step}"], row[f"opacity_{step}"]) for step in STEPS)
    return {
        "state_hash": row["state_hash"],
        "next_actions": (row["decided_0"], row["decided_1"]),
        "prediction": () if row["p1_north"] is None else probabilities,
        "displayed": tuple(step for step in drawn if step[0] is not None),
        **{name: row[name] for name in ("late", "scheduled_ms", "late_ms", "models_ms")},
        "made_unix_ms": _unix_ms(row["made_at"]) if row.get("made_at") else None,
        **{name: row.get(name) for name in ("asked", "misleading", "in_sight")},
        **intentions_of(row),
    }


def _tick(episode: str, timestep: int, state: Record, done: Record | None) -> TickRecord:
    step = done or dict.fromkeys((f"{name}_{seat}" for name in ("reward", "shaped", "events") for seat in (0, 1)), 0)
    keys = [
        KeyRecord(seat, *(done[f"key_{name}_{seat}"] for name in ("seq", "client_ms", "received_ms")))
        for seat in (0, 1)
        if done and done[f"key_seq_{seat}"] is not None
    ]
    return TickRecord(
        episode=episode,
        timestep=timestep,
        actions=(done["action_0"], done["action_1"]) if done else None,
        rewards=(step["reward_0"], step["reward_1"]),
        shaped=(step["shaped_0"], step["shaped_1"]),
        events=(step["events_0"], step["events_1"]),
        keys=tuple(keys),
        **state,
    )
