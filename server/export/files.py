"""Write tables to files: CSV (texts escaped for spreadsheets) or Parquet (exact)."""

from pathlib import Path
from typing import Protocol

import polars as pl

from server.export.spreadsheet_text import FORMULA, NUMBER, unescaped, with_apostrophe

TABLE_FORMATS = ("csv", "parquet")
_TIMES = "%Y-%m-%d %H:%M:%S%.6fZ"


def table_path(folder: Path, file_format: str, table: str) -> Path:
    """Return the path of a table in an export: CSV under Psych-DS names, Parquet under its own."""
    if file_format == "csv":
        return folder / "data" / f"description-{table}_data.csv"
    return folder / "parquet" / f"{table}.parquet"


def from_text(column: str, kind: pl.DataType | None) -> pl.Expr:
    """Convert a column of a CSV file that was read as text to its type (None: text), without the apostrophes that
    protect spreadsheets."""
    text = pl.col(column)
    if kind is None or kind == pl.String:
        return text.map_elements(unescaped, return_dtype=pl.String)
    if kind == pl.Boolean:
        return text.replace_strict({"true": True, "false": False}, return_dtype=pl.Boolean)
    if isinstance(kind, pl.Datetime):
        return text.str.to_datetime(time_unit="us", time_zone="UTC")
    return text.cast(kind)


class TableWriter:
    """Appends chunks to one file; a table without rows still gets its header."""

    def __init__(self, folder: Path, file_format: str, table: str, types: pl.Schema) -> None:
        path = table_path(folder, file_format, table)
        path.parent.mkdir(exist_ok=True)
        self._file: _File = _CsvFile(path, types) if file_format == "csv" else _ParquetFile(path, types)

    def __enter__(self) -> "TableWriter":
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def write(self, chunk: pl.DataFrame) -> None:
        self._file.write(chunk)


class _File(Protocol):
    def write(self, chunk: pl.DataFrame) -> None: ...

    def close(self) -> None: ...


class _CsvFile:
    """Writes only texts in quotes, so that an empty text differs from a missing one."""

    def __init__(self, path: Path, types: pl.Schema) -> None:
        self._file = path.open("wb")
        self._cells = [_cell(name, kind) for name, kind in types.items()]
        self._file.write((",".join(_quoted(name) for name in types.names()) + "\n").encode())

    def write(self, chunk: pl.DataFrame) -> None:
        cells = escaped(chunk).select(self._cells)
        cells.write_csv(self._file, include_header=False, quote_style="never", datetime_format=_TIMES)

    def close(self) -> None:
        self._file.close()


def _quoted(text: str) -> str:
    return '"' + text.replace('"', '""') + '"'


def _cell(name: str, kind: pl.DataType) -> pl.Expr:
    """Format a column for CSV: a text with its quotes, a whole number without a decimal point."""
    column = pl.col(name)
    if kind == pl.String:
        quote = pl.lit('"')
        return pl.concat_str(quote, column.str.replace_all('"', '""', literal=True), quote).alias(name)
    return column.cast(pl.String).str.strip_suffix(".0") if kind.is_float() else column


class _ParquetFile:
    """Polars writes a Parquet file in one call. Chunks are kept in temporary files, so that memory does not grow with
    the study."""

    def __init__(self, path: Path, types: pl.Schema) -> None:
        self._path, self._types = path, types
        self._parts: list[Path] = []

    def write(self, chunk: pl.DataFrame) -> None:
        part = self._path.with_suffix(f".{len(self._parts)}.part")
        chunk.write_parquet(part)
        self._parts.append(part)

    def close(self) -> None:
        if not self._parts:
            pl.DataFrame(schema=self._types).write_parquet(self._path)
        elif len(self._parts) == 1:
            self._parts[0].replace(self._path)
        else:
            pl.scan_parquet(self._parts).sink_parquet(self._path)
            for part in self._parts:
                part.unlink()


def escaped(table: pl.DataFrame) -> pl.DataFrame:
    """Return the table with an apostrophe before everything in a text that a spreadsheet would run as a formula."""
    for name, kind in table.schema.items():
        if kind == pl.String:
            texts = table[name]
            dangerous = texts.str.contains(FORMULA) & ~texts.str.contains(NUMBER)
            if dangerous.any():
                pairs = zip(texts, dangerous, strict=True)
                safe = [with_apostrophe(text) if unsafe else text for text, unsafe in pairs]
                table = table.with_columns(pl.Series(name, safe, pl.String))
    return table
