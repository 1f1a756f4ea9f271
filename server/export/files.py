"""How a table becomes a file: CSV (texts made safe for spreadsheets) or Parquet (exact)."""

import re
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet

TABLE_FORMATS = ("csv", "parquet")
_NUMBER = r"^-?[0-9]+(\.[0-9]+)?([eE][-+]?[0-9]+)?$"  # a number alone is not a formula
# What a spreadsheet takes for the start of a formula, or skips before it: signs, also in full-width and small forms
# (which it reads too if it is set to Chinese or Japanese), and blanks.
_SIGN = "[=+\\-@\\t\\r\\n\\x00＝＋－＠−﹢﹣﹦﹫]"
# Where a cell can begin: the text itself, and what follows a separator of other countries' CSV or of a row; then
# blanks, which many spreadsheets drop.
_CELL = '((?:^|[;\\t\\r\\n])[ "\u00a0\u200b\u3000\ufeff]*)'
_FORMULA = f"{_CELL}'*{_SIGN}"
_ESCAPE = re.compile(f"{_CELL}(?='*{_SIGN})")
_UNESCAPE = re.compile(f"{_CELL}'(?='*{_SIGN})")


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
                pc.match_substring_regex(texts, _FORMULA), pc.invert(pc.match_substring_regex(texts, _NUMBER))
            )
            if pc.any(dangerous).as_py():
                pairs = zip(texts.to_pylist(), dangerous.to_pylist(), strict=True)
                safe = [_ESCAPE.sub(r"\1'", text) if unsafe else text for text, unsafe in pairs]
                table = table.set_column(index, kind, pa.array(safe, kind.type))
    return table


def escaped_text(text: str) -> str:
    """Return one text as `escaped` writes it."""
    is_formula = re.search(_FORMULA, text) is not None and re.fullmatch(_NUMBER, text) is None
    return _ESCAPE.sub(r"\1'", text) if is_formula else text


def unescaped(text: str) -> str:
    """The text before `escaped`."""
    return _UNESCAPE.sub(r"\1", text)
