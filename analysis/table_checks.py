"""Check the tables of an export for damage and careless edits, which would change a report without a sign."""

from typing import Final

import polars as pl

KEYS: Final = {"participants": ("participant",), "episodes": ("episode",), "ticks": ("episode", "timestep")}
ACTIONS: Final = ("action_0", "action_1", "predicted_1", "predicted_2", "predicted_3")
BOUNDS: Final = {"ticks": dict.fromkeys(ACTIONS, (0, 5)), "episodes": {"watched_seat": (0, 1), "tick_ms": (1, 60_000)}}
REWARDS: Final = ("score", "progress")


def problem_in(table: pl.DataFrame, name: str, first: int) -> str:
    """Return the first problem of a table with its row, empty if there is none. `first`: the number of the first row
    of data (2 in a CSV file, whose header is row 1)."""
    if (keys := KEYS.get(name)) and (found := _twice(table, keys, first)):
        return found
    for column, (low, high) in BOUNDS.get(name, {}).items():
        if table.schema[column].is_numeric():  # not so in a table without rows
            value = pl.col(column)
            if found := _first(table, column, (value < low) | (value > high), first, f"not from {low} to {high}"):
                return found
    if name != "episodes":
        return ""
    for column in REWARDS:  # empty: not recorded
        if found := _first(table, column, ~pl.col(column).cast(pl.Float64).is_finite(), first, "not a number"):
            return found
    return ""


def _twice(table: pl.DataFrame, keys: tuple[str, ...], first: int) -> str:
    twice = table.select(keys).with_row_index("row").filter(pl.struct(keys).is_duplicated()).head(1)
    if twice.is_empty():
        return ""
    here = dict(zip(keys, twice.row(0)[1:], strict=True))
    same = table.with_row_index("row").filter(**here)["row"].head(2) + first
    named = ", ".join(f"{key} {value}" for key, value in here.items())
    return f"rows {same[0]} and {same[1]} are both {named}"


def _first(table: pl.DataFrame, column: str, wrong: pl.Expr, first: int, what: str) -> str:
    found = table.with_row_index("row").filter(wrong).select("row", column).head(1)
    return f"row {found['row'][0] + first}, column {column}: {_shown(found[column][0])} is {what}" if len(found) else ""


def unreadable_cell(texts: pl.DataFrame, types: dict[str, type[pl.DataType]], first: int) -> str:
    """Return the first cell of a table of texts that does not have the type of its column, with its row."""
    for column, kind in types.items():
        text = pl.col(column)
        if kind == pl.Boolean:
            wrong = ~text.str.to_lowercase().is_in(["true", "false"])
        else:
            wrong = text.is_not_null() & text.cast(kind, strict=False).is_null()
        what = {pl.Boolean: "not true or false", pl.Int64: "not a whole number"}.get(kind, "not a number")
        if found := _first(texts, column, wrong, first, what):
            return found
    return ""


def _shown(value: object) -> str:
    text = "empty" if value in (None, "") else str(value)
    return text if len(text) <= 40 else f"{text[:40]}…"
