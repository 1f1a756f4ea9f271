"""How a table becomes a file: CSV (texts made safe for spreadsheets) or Parquet (exact)."""

from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet

from server.export.spreadsheet_text import FORMULA, NUMBER, with_apostrophe

TABLE_FORMATS = ("csv", "parquet")


def table_path(folder: Path, file_format: str, table: str) -> Path:
    """Where a table lies in an export: CSV under the names of Psych-DS, Parquet under its own."""
    if file_format == "csv":
        return folder / "data" / f"description-{table}_data.csv"
    return folder / "parquet" / f"{table}.parquet"


class TableWriter:
    """Appends chunks to one file; a table without rows still gets its header."""

    def __init__(self, folder: Path, file_format: str, table: str, types: pa.Schema) -> None:
        path = table_path(folder, file_format, table)
        path.parent.mkdir(exist_ok=True)
        self._csv = file_format == "csv"
        self._file: Any = (
            pa.csv.CSVWriter(path, types) if self._csv else pa.parquet.ParquetWriter(path, types, compression="zstd")
        )

    def __enter__(self) -> "TableWriter":
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def write(self, chunk: pa.Table) -> None:
        if self._csv:
            self._file.write_table(escaped(chunk))
        else:
            self._file.write_table(chunk)


def escaped(table: pa.Table) -> pa.Table:
    """Return the table with an apostrophe before everything in a text that a spreadsheet would run as a formula."""
    for index, kind in enumerate(table.schema):
        if pa.types.is_string(kind.type):
            texts = table.column(index)
            dangerous = pc.and_(
                pc.match_substring_regex(texts, FORMULA), pc.invert(pc.match_substring_regex(texts, NUMBER))
            )
            if pc.any(dangerous).as_py():
                pairs = zip(texts.to_pylist(), dangerous.to_pylist(), strict=True)
                safe = [with_apostrophe(text) if unsafe else text for text, unsafe in pairs]
                table = table.set_column(index, kind, pa.array(safe, kind.type))
    return table
