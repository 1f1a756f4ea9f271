"""Pieces of Markdown tables that the generated pages share."""

from typing import Any, Final

_LIMITS: Final = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}
_NAMES: Final = {"boolean": "true or false", "null": "empty", "object": "mapping"}


def cell(text: str) -> str:
    """Return a text as a cell of a table."""
    return " ".join(text.split()).replace("|", "\\|")


def code(text: str) -> str:
    """Return a text as code in a cell of a table."""
    return "`" + text.replace("|", "\\|") + "`" if text else ""


def plain_type(value: dict[str, Any]) -> str:
    """Return a JSON schema type that holds no other, with its limits."""
    if "enum" in value:
        return ", ".join(code(str(word)) for word in value["enum"])
    if "const" in value:
        return code(str(value["const"]))
    limits = [f"{sign} {value[key]:,}" for key, sign in _LIMITS.items() if key in value]
    if "pattern" in value:
        limits.append(code(value["pattern"]))
    kind = str(value.get("type", "string"))
    return ", ".join([_NAMES.get(kind, kind), *limits])
