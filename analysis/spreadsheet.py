"""Texts in the CSV files of the analysis: safe to open in a spreadsheet. The same rule as in the server's exports."""

import re

import polars as pl

_NUMBER = re.compile(r"-?[0-9]+(\.[0-9]+)?([eE][-+]?[0-9]+)?")
_ESCAPE = re.compile("((?:^|[;\\t\\r\\n])[ \"\u00a0\u200b\u3000\ufeff]*)(?='*[=+\\-@\\t\\r\\n\\x00＝＋－＠−﹢﹣﹦﹫])")


def safe_text(text: str) -> str:
    """Return the text with an apostrophe before everything that a spreadsheet would run as a formula."""
    return text if _NUMBER.fullmatch(text) else _ESCAPE.sub(r"\1'", text)


def safe_table(table: pl.DataFrame) -> pl.DataFrame:
    """Return the table in which every text is safe."""
    return table.with_columns(pl.col(pl.String).map_elements(safe_text, return_dtype=pl.String))
