"""Write values as YAML: on one line, or as a block of lines."""

import json
import re
from typing import Any, Final

import yaml

MAX_LINE_LENGTH: Final = 110
INDENT: Final = 2
_PLAIN: Final = re.compile(r"[^\W_]([^\n\r\t#:]|:(?! |$)|(?<! )#)*", re.UNICODE)
_IN_FLOW: Final = re.compile(r"[,\[\]{}?:]")
_resolver = yaml.SafeLoader("")


def scalar(value: Any, *, flow: bool, plain: bool = False, quoted: bool = False) -> str:
    """Return one value on one line. `plain`: as it is, if possible. `quoted`: always in quotes."""
    if value is None:
        return "null"
    if not isinstance(value, str):
        return json.dumps(value)
    is_plain = _PLAIN.fullmatch(value) and value == value.strip() and not (flow and _IN_FLOW.search(value))
    if is_plain and not quoted and (plain or _means_text(value)):
        return value
    if plain and re.fullmatch(r"-?[\d.]+", value):
        return value
    return json.dumps(value, ensure_ascii=False)


def _means_text(value: str) -> bool:
    """Return whether another YAML reader also takes the word for a text (not 007, 1:30 or no)."""
    tag = _resolver.resolve(yaml.ScalarNode, value, (True, False))  # type: ignore[no-untyped-call]
    return bool(tag == "tag:yaml.org,2002:str")


def inline(value: Any, *, plain: bool = False, quoted: bool = False) -> str:
    """Return a value in flow style: {en: Words, zh: ...}."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{scalar(str(key), flow=True)}: {inline(one)}" for key, one in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(inline(one) for one in value) + "]"
    return scalar(value, flow=True, plain=plain, quoted=quoted)


def block(value: Any, column: int, *, plain: bool = False, quoted: bool = False, item: bool = False) -> str:
    """Return what follows a colon or (`item`) a dash at `column`: a blank and one line, or a line break and a block."""
    if isinstance(value, str) and "\n" in value and _fits_literal(value):
        return " " + _literal(value, column + INDENT)
    if not isinstance(value, dict | list):
        return " " + scalar(value, flow=False, plain=plain, quoted=quoted)
    short = inline(value)
    if not value or (len(short) + column <= MAX_LINE_LENGTH and _is_shallow(value)):
        return " " + short
    inner = column + INDENT
    lines = [f"{scalar(str(key), flow=True)}:{block(one, inner)}" for key, one in _pairs(value)]
    if isinstance(value, list):
        lines = [f"-{block(one, inner, item=True)}" for one in value]
    if item:
        return " " + f"\n{' ' * inner}".join(lines)
    return "".join(f"\n{' ' * inner}{line}" for line in lines)


def _pairs(value: Any) -> list[tuple[Any, Any]]:
    return list(value.items()) if isinstance(value, dict) else []


def _is_shallow(value: Any) -> bool:
    """Return whether it reads well on one line: words, or a block of words, and no line breaks."""
    children = list(value.values()) if isinstance(value, dict) else value
    return all(not isinstance(one, list) and (not isinstance(one, dict) or _is_shallow(one)) for one in children) and (
        "\\n" not in inline(value)
    )


def _fits_literal(text: str) -> bool:
    """Return whether `|` can write it: the first line sets the indentation, and blanks at line ends get lost."""
    return not text.startswith((" ", "\n", "\t")) and bool(text.strip())


def _literal(text: str, column: int) -> str:
    body = text.rstrip("\n")
    ends = len(text) - len(body)
    mark = "|-" if ends == 0 else "|" if ends == 1 else "|+"
    lines = [f"{' ' * column}{line}" if line else "" for line in [*body.split("\n"), *[""] * max(0, ends - 1)]]
    return "\n".join([mark, *lines])
