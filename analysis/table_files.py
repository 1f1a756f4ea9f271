"""The tables of an export as files: found, checked and read with the types that their columns have."""

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import polars as pl

from analysis.table_checks import problem_in, unreadable_cell

# The columns that are read of each table. An export has more columns and tables; codebook.json explains them all.
COLUMNS = {
    "participants": ("participant", "study", "condition", "status"),
    "episodes": (
        "episode",
        "participant_0",
        "participant_1",
        "agent_0",
        "agent_1",
        "condition",
        "kind",
        "layout",
        "number",
        "status",
        "score",
        "progress",
        "watched_seat",
        "tick_ms",
    ),
    "answers": ("participant", "episode", "question", "value", "value_type"),
    "ticks": ("episode", "timestep", "action_0", "action_1", "late", "predicted_1", "predicted_2", "predicted_3"),
    "pauses": ("episode", "reason", "duration_ms"),
    "reliance": ("episode", "phase", "near", "waited", "avoided", "followed"),
    "withdrawals": ("study", "condition"),
}
IN_SIGHT = "in_sight"  # an older export lacks it
ON_DEMAND = ("asked", "displayed_1")  # an older export lacks the first
INTENTIONS = tuple(
    f"{name}_{part}" for name in ("intention_1", "displayed_intention", "interaction") for part in ("kind", "x", "y")
)  # an older export lacks them
TIMES = ("scheduled_ms", "late_ms", "made_at")  # of the game, and the wall clock, which an older export lacks
TICK_COLUMNS = {
    *COLUMNS["ticks"],
    *ON_DEMAND,
    IN_SIGHT,
    *INTENTIONS,
    *TIMES,
    *(f"key_{time}_ms_{seat}" for time in ("client", "received") for seat in (0, 1)),
}
# What a codebook says of them, for an export that has lost it: most columns of a study's ticks are empty.
_TICK_TYPES: Final[Mapping[str, type[pl.DataType]]] = {
    **{column: pl.Float64 if column.startswith("key_") else pl.Int64 for column in TICK_COLUMNS - {"episode"}},
    **dict.fromkeys(("late", "asked", IN_SIGHT), pl.Boolean),
    **dict.fromkeys(("scheduled_ms", "late_ms"), pl.Float64),
    "made_at": pl.String,
}
OPTIONAL = ("pauses", "reliance", "withdrawals")
IDENTIFIERS = ("participant", "participant_0", "participant_1", "episode", "study", "condition", "layout", "status")
# Columns of CSV files that stay text even if every value looks like a number ("007").
TEXTS = (*IDENTIFIERS, "agent_0", "agent_1", "question", "value", "value_type", "kind", "reason", "excluded")
_TYPES: Final[Mapping[str, type[pl.DataType]]] = {"integer": pl.Int64, "number": pl.Float64, "boolean": pl.Boolean}


class ExportError(ValueError):
    """The folder is not an export that this analysis can read; the text says what to do."""


def table_file(folder: Path, name: str) -> Path | None:
    """Return the file of a table: its name is one of the words of the file's name (Psych-DS:
    study-x_ticks_data.csv)."""
    found = [
        path
        for path in sorted(folder.rglob("*"))
        if path.suffix in (".parquet", ".csv") and name in re.split(r"[-_.]", path.stem)
    ]
    return min(found, key=lambda path: (path.suffix != ".parquet", len(path.parts), path.name), default=None)


def read_table(folder: Path, name: str) -> pl.DataFrame:
    """Return the table, with the columns that the analysis needs. Raises ExportError, also for rows that cannot be
    right."""
    path = table_file(folder, name)
    if path is None and name in OPTIONAL:
        return pl.DataFrame(schema=dict.fromkeys(COLUMNS[name], pl.String))
    if path is None:
        raise ExportError(f"{folder} has no table of {name} ({name}.csv or {name}.parquet). Export the study again.")
    types, first = _types(folder, name), 1 if path.suffix == ".parquet" else 2
    try:
        table = _scan(path, name, types).collect()
    except (pl.exceptions.PolarsError, OSError) as error:
        why = _unreadable(path, types, first) or str(error).splitlines()[0][:120]
        raise ExportError(f"{path} cannot be read as a table: {why}. Export the study again.") from None
    if missing := [column for column in COLUMNS[name] if column not in table.columns]:
        raise ExportError(f"{path} has no column {missing[0]}. Export the study again with this version.")
    table = table.with_columns(pl.col(column).cast(pl.String) for column in IDENTIFIERS if column in table.columns)
    if problem := problem_in(table, name, first):
        raise ExportError(f"{path}, {problem}. Export the study again.")
    return table


def _unreadable(path: Path, types: Mapping[str, type[pl.DataType]], first: int) -> str:
    """Return the first cell of a CSV file that does not have its type; empty if that is not the problem."""
    try:
        texts = pl.read_csv(path, infer_schema=False)
    except (pl.exceptions.PolarsError, OSError):
        return ""
    wanted = {column: kind for column, kind in types.items() if column in texts.columns and column not in TEXTS}
    return unreadable_cell(texts, wanted, first)


def _types(folder: Path, name: str) -> dict[str, type[pl.DataType]]:
    """Return the types of the columns by the codebook, for CSV: a column without values does not show its type."""
    found = dict(_TICK_TYPES) if name == "ticks" else {}
    try:
        book = json.loads((folder / "codebook.json").read_text(encoding="utf-8"))
        for column, about in book["tables"][name]["columns"].items():
            if about["type"] in _TYPES:
                found[column] = _TYPES[about["type"]]
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        pass  # an export of an older version, or tables from another source
    return found


def _scan(path: Path, name: str, types: Mapping[str, type[pl.DataType]]) -> pl.LazyFrame:
    """Return the file as a lazy table: texts stay texts, and of the ticks only what is needed (a large study has
    millions). `types`: what is known of a CSV file's columns."""
    lazy = pl.scan_parquet(path) if path.suffix == ".parquet" else pl.scan_csv(path, infer_schema=False)
    present = lazy.collect_schema().names()
    if path.suffix != ".parquet":
        known = {column: pl.String if column in TEXTS else types.get(column) for column in present}
        wanted = {column: kind for column, kind in known.items() if kind is not None}
        lazy = pl.scan_csv(path, infer_schema_length=None, schema_overrides=wanted)
    return lazy.select(column for column in present if column in TICK_COLUMNS) if name == "ticks" else lazy
