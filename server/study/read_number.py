"""Parse a number that a participant typed. The page has the same rule (static/js/pages/read-number.js); a test
compares.
"""

import re
from typing import Final

_SPACE: Final = r"[ \t\n\r\u00a0\u2000-\u200a\u202f\u3000]"
_EDGES: Final = re.compile(rf"\A{_SPACE}+|{_SPACE}+\Z")
# + , - . and digits as East Asian keyboards write them, and the typographic minus
_WIDE: Final = {code: code - 0xFEE0 for code in (*range(0xFF0B, 0xFF0F), *range(0xFF10, 0xFF1A))} | {0x2212: ord("-")}
_MAX_LENGTH: Final = 32
_AMBIGUOUS: Final = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}", re.ASCII)
_PLAIN: Final = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)", re.ASCII)
_GROUPED: Final = re.compile(rf"[+-]?\d+(({_SPACE}|[.,'’_])\d+)+", re.ASCII)


def read_number(text: str) -> float | str:
    """Return the number, or the reason why it is invalid: `missing_number`, `grouped_number` (written with thousands
    separators) or `ambiguous_number` (1,200 may be 1200 or 1.2). A comma or a point may separate decimals; ambiguous
    cases are refused, not guessed."""
    plain = _EDGES.sub("", text).translate(_WIDE)
    if len(plain) > _MAX_LENGTH:
        return "missing_number"
    if _AMBIGUOUS.fullmatch(plain):
        return "ambiguous_number"
    if _PLAIN.fullmatch(plain):
        return float(plain.replace(",", "."))
    return "grouped_number" if _GROUPED.fullmatch(plain) else "missing_number"
