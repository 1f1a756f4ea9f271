"""`kitchenmind export`: write a study's data as self-explanatory files. The folder appears when everything is
written.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

import polars as pl
from sqlalchemy import Connection

from server.export import codebook, manifest, tick_rows
from server.export import rows as exported
from server.export.codebook_columns import Column, ExportTable
from server.export.files import TABLE_FORMATS, TableWriter
from server.export.rows import Rows, Selection
from server.store import private_files, studies, tombstones
from server.store.work_folders import WorkFolder, remove_abandoned

FORMATS = (*TABLE_FORMATS, "overcooked_ai")
ROWS = 20_000  # of a chunk
_UNFINISHED = ".kitchenmind-export-"
_ROWS: dict[str, Callable[[Selection], Rows]] = {
    "studies": exported.study_rows,
    "arrivals": exported.arrival_rows,
    "withdrawals": exported.withdrawal_rows,
    "inputs": exported.input_rows,
    "reliance": lambda chosen: _reliance_rows(chosen),
    "pauses": exported.pause_rows,
    "answers": exported.answer_rows,
    "visits": exported.visit_rows,
    "events": exported.event_rows,
    "exclusions": exported.exclusion_rows,
}
_TYPES: dict[tuple[str, int], pl.DataType] = {
    ("integer", 16): pl.Int16(),
    ("integer", 32): pl.Int32(),
    ("number", 32): pl.Float32(),
    ("integer", 64): pl.Int64(),
    ("number", 64): pl.Float64(),
    ("boolean", 64): pl.Boolean(),
    ("time", 64): pl.Datetime("us", "UTC"),
}


class ExportRefused(ValueError):
    """The export cannot be made as requested; the message says why and what to do."""


@dataclass
class Summary:
    """What was written: rows by table, and the columns that each table has."""

    rows: dict[str, int] = field(default_factory=dict)
    columns: dict[str, tuple[Column, ...]] = field(default_factory=dict)


def export(
    connection: Connection, out: Path, formats: Sequence[str] = ("csv", "parquet"), study: str | None = None
) -> Summary:
    """Write everything (or one study, all its versions) into the folder `out`, which must be new or empty.

    `formats`: of FORMATS. Raises ExportRefused before anything is written.
    """
    unknown = [name for name in formats if name not in FORMATS]
    if unknown or not formats:
        raise ExportRefused(f"there is no format {', '.join(unknown) or 'named'}. Choose from {', '.join(FORMATS)}.")
    table_formats = [name for name in TABLE_FORMATS if name in formats]
    if not table_formats:
        raise ExportRefused(f"the tables need a format too: add {' or '.join(TABLE_FORMATS)}.")
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise ExportRefused(f"{out} is not empty. Choose a new folder, so that nothing old is mixed in.")
    versions = _versions(connection, study)
    chosen = Selection(connection, None if study is None else tuple(version.id for version in versions))
    parent = out.absolute().parent
    private_files.make_folder(parent)
    remove_abandoned(_UNFINISHED, parent)
    with WorkFolder(_UNFINISHED, parent) as making:
        summary = _write(chosen, making.path, table_formats)
        if len(table_formats) < len(formats):
            from server.export import trajectories  # simulates: the rules are compiled for it only

            summary.rows[trajectories.FOLDER] = trajectories.write(chosen, making.path)
        tombstones.write(making.path, tombstones.every(connection))
        manifest.write_about(making.path, versions, summary.columns, formats)  # last: it lists the hashes of all files
        making.path.replace(out)
    return summary


def _versions(connection: Connection, study: str | None) -> list[studies.StudyVersion]:
    found = studies.every(connection, study)
    if study is not None and not found:
        known = sorted({version.key for version in studies.every(connection)})
        raise ExportRefused(f"there is no study {study!r} in this database. It has: {', '.join(known) or 'none'}.")
    return found


def _write(chosen: Selection, folder: Path, formats: Sequence[str]) -> Summary:
    summary = Summary()
    for table in codebook.TABLES:
        columns, chunks = _table(chosen, table)
        summary.columns[table.name] = columns
        summary.rows[table.name] = 0
        with ExitStack() as stack:
            writers = [stack.enter_context(TableWriter(folder, name, table.name, schema(columns))) for name in formats]
            for chunk in chunks:
                summary.rows[table.name] += chunk.height
                for writer in writers:
                    writer.write(chunk)
    return summary


def _table(chosen: Selection, table: ExportTable) -> tuple[tuple[Column, ...], Iterator[pl.DataFrame]]:
    if table is codebook.TICKS:
        types = schema(table.columns)
        return table.columns, tick_rows.chunks(chosen.connection, exported.episode_ids(chosen), types)
    if table is codebook.PARTICIPANTS:
        wide = exported.wide_columns(chosen)
        columns = (*table.columns, *wide)
        return columns, _of_rows(exported.participant_rows(chosen, wide), columns)
    if table is codebook.EPISODES:
        wide = exported.wide_episode_columns(chosen)
        columns = (*table.columns, *wide)
        return columns, _of_rows(exported.episode_rows(chosen, wide), columns)
    return table.columns, _of_rows(_ROWS[table.name](chosen), table.columns)


def _reliance_rows(chosen: Selection) -> Rows:
    if not exported.has_misleading(chosen):
        return iter(())
    from server.export import reliance  # simulates: the rules are compiled for it only

    return reliance.reliance_rows(chosen)


def schema(columns: Iterable[Column]) -> pl.Schema:
    """Return the types of columns in a typed file."""
    return pl.Schema({column.name: _TYPES.get((column.type, column.bits), pl.String()) for column in columns})


def _of_rows(rows: Iterator[tuple[Any, ...]], columns: Sequence[Column]) -> Iterator[pl.DataFrame]:
    types = schema(columns)
    while chunk := list(islice(rows, ROWS)):
        values = zip(*chunk, strict=True)
        yield pl.DataFrame([pl.Series(name, v, kind) for (name, kind), v in zip(types.items(), values, strict=True)])
