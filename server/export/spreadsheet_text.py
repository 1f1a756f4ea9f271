"""Escape texts for spreadsheets, and unescape them. Without polars, because the server's pages use it too."""

import re

NUMBER = r"^-?[0-9]+(\.[0-9]+)?([eE][-+]?[0-9]+)?$"  # a number alone is not a formula
# Characters that a spreadsheet treats as the start of a formula, or skips before it: signs, also in full-width and
# small forms (which it reads too if it is set to Chinese or Japanese), and blanks.
_SIGN = "[=+\\-@\\t\\r\\n\\x00＝＋－＠−﹢﹣﹦﹫]"
# Where a cell can begin: the text itself, and what follows a separator of other countries' CSV or of a row; then
# blanks, which many spreadsheets drop.
_CELL = '((?:^|[;\\t\\r\\n])[ "\u00a0\u200b\u3000\ufeff]*)'
FORMULA = f"{_CELL}'*{_SIGN}"
_ESCAPE = re.compile(f"{_CELL}(?='*{_SIGN})")
_UNESCAPE = re.compile(f"{_CELL}'(?='*{_SIGN})")


def with_apostrophe(text: str) -> str:
    """Return a text with an apostrophe, so that no spreadsheet runs it as a formula."""
    return _ESCAPE.sub(r"\1'", text)


def escaped_text(text: str) -> str:
    """Return one text as an export's CSV files hold it."""
    is_formula = re.search(FORMULA, text) is not None and re.fullmatch(NUMBER, text) is None
    return with_apostrophe(text) if is_formula else text


def unescaped(text: str) -> str:
    """Return the text before it was escaped."""
    return _UNESCAPE.sub(r"\1", text)
