"""Print docs/reference/data_dictionary.md: `python -m server.export.data_dictionary`. A test compares the two."""

import sys
from collections.abc import Iterator

from sqlalchemy import JSON, BigInteger, Boolean, Column, Double, Integer, LargeBinary, SmallInteger, String, Table

from server.export import codebook
from server.store.columns import UtcDateTime
from server.store.tables import TABLES

_TYPES = (
    (SmallInteger, "integer, 16 bits"),
    (BigInteger, "integer, 64 bits"),
    (Integer, "integer"),
    (Double, "number"),
    (Boolean, "true/false"),
    (UtcDateTime, "time"),
    (JSON, "JSON"),
    (String, "text"),
)
_WIDE = {"participants": (codebook.FACTOR, *codebook.WIDE), "episodes": (codebook.BLOCK, codebook.FACTOR)}
_HEAD = """# Data dictionary

`python -m docs.generate` writes this page from the tables in `server/store` and `server/export/codebook.py`. First come
the files of `kitchenmind export`, then the tables of the database.

All times are UTC. Actions are 0 north, 1 south, 2 east, 3 west, 4 stay, 5 interact. Seat 0 is the chef who starts on
the layout's cell 1. Times that a browser measured are from the browser's own clock.

"""
_EXPORT = """## Export

`data/description-TABLE_data.csv` and `parquet/TABLE.parquet`. {escaped}

"""
_DATABASE = """## Database

SQLite and PostgreSQL have the same tables. `personal` is never exported. Deleting a participant follows the foreign
keys; see `server/store/withdrawal.py`, and for a whole study `server/store/study_deletion.py`.

"""


def text() -> str:
    """Return the whole page."""
    return "".join(_lines())


def _lines() -> Iterator[str]:
    yield _HEAD
    yield _EXPORT.format(escaped=codebook.ESCAPED)
    for table in codebook.TABLES:
        wide = _WIDE.get(table.name, ())
        yield f"### {table.name}\n\nA row is {table.row}.\n\n| column | type | unit | meaning |\n|---|---|---|---|\n"
        for column in (*table.columns, *wide):
            yield f"| `{column.name}` | {column.type} | {column.unit} | {column.meaning} |\n"
        yield "\n"
    yield _DATABASE
    for stored in TABLES:
        yield f"### Table `{stored.name}`\n\n| column | type | unit | meaning |\n|---|---|---|---|\n"
        for place in stored.columns:
            yield f"| `{place.name}` | {_type(place)} | {place.info['unit']} | {_meaning(place)} |\n"
        yield f"\n{_keys(stored)}\n\n"


def _type(column: "Column[object]") -> str:
    if isinstance(column.type, LargeBinary):
        return "bytes" if column.type.length is None else f"{column.type.length} bytes at most"
    name = next(name for kind, name in _TYPES if isinstance(column.type, kind))
    return f"{name}, may be empty" if column.nullable else name


def _meaning(column: "Column[object]") -> str:
    targets = [key.target_fullname for key in column.foreign_keys]
    return f"{column.doc} (`{targets[0]}`)" if targets else str(column.doc)


def _keys(table: Table) -> str:
    key = ", ".join(f"`{column.name}`" for column in table.primary_key)
    return f"Key: {key}."


if __name__ == "__main__":
    sys.stdout.write(text())
