"""Write the field tables of docs/reference/protocol.md: `python -m server.play.protocol_tables`.

A table stands between `<!-- fields: name -->` and `<!-- /fields -->`, where `name` is a message's type, or `state`.
"""

import json
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, get_args

from msgspec import inspect

from server.play import messages

PAGE: Final = Path(__file__).parents[2] / "docs" / "reference" / "protocol.md"
_MARKED: Final = re.compile(r"(<!-- fields: (\w+) -->\n).*?(<!-- /fields -->)", re.DOTALL)
_SENT_HEAD: Final = "| field | type | values | if left out |\n|---|---|---|---|\n"
_RECEIVED_HEAD: Final = "| field | type | values |\n|---|---|---|\n"
_START, _END = r"\A", r"+\Z"
_COMPARISONS: Final = {"ge": "≥", "gt": ">", "le": "≤", "lt": "<"}


def structs() -> Mapping[str, Any]:
    """Return every described type by the name that the page gives it."""
    kinds = [*get_args(messages.Incoming), *get_args(messages.Outgoing)]
    return {kind.__struct_config__.tag: kind for kind in kinds} | {"state": messages.KitchenState}


def render(page: str) -> str:
    """Return the page with every table as the types are now. Raises KeyError for an unknown message."""
    known = structs()
    return _MARKED.sub(lambda found: f"{found[1]}{table(known[found[2]])}{found[3]}", page)


def table(struct: Any) -> str:
    """Return one row per field, or a sentence for a message without fields."""
    described = inspect.type_info(struct)
    fields = described.fields if isinstance(described, inspect.StructType) else ()
    if not fields:
        return "No fields except `type`.\n"
    if issubclass(struct, messages.FromBrowser):
        return _SENT_HEAD + "".join(f"{_row(field)} {_if_left_out(field)} |\n" for field in fields)
    return _RECEIVED_HEAD + "".join(f"{_row(field)}\n" for field in fields)  # the server leaves nothing out


def _row(field: inspect.Field) -> str:
    kind, values = describe(field.type)
    return f"| `{field.encode_name}` | {kind} | {values} |"


def _if_left_out(field: inspect.Field) -> str:
    return "refused" if field.required else f"`{json.dumps(field.default)}`"


def describe(kind: inspect.Type) -> tuple[str, str]:
    """Return a type in words, and the values that it allows."""
    match kind:
        case inspect.UnionType(types=types):
            parts = [describe(one) for one in types]
            return " or ".join(name for name, _ in parts), ", ".join(values for _, values in parts if values)
        case inspect.LiteralType(values=literals):
            name = "text" if isinstance(literals[0], str) else "integer"
            return name, ", ".join(f"`{literal}`" for literal in literals)
        case inspect.StrType():
            return "text", _text_limits(kind)
        case inspect.IntType():
            return "integer", _range(kind)
        case inspect.FloatType():
            return "number", _range(kind)
        case inspect.BoolType():
            return "true or false", ""
        case inspect.NoneType():
            return "null", ""
        case inspect.VarTupleType(item_type=item):
            name, values = describe(item)
            return f"list of {name}", values
        case inspect.TupleType(item_types=items):
            return f"[{len(items)} values]", "; ".join(describe(item)[1] or describe(item)[0] for item in items)
        case inspect.StructType(cls=cls) if cls is messages.KitchenState:
            return "a state, see [state](#a-state)", ""
    raise TypeError(f"docs/reference/protocol.md has no words for {kind}")


def _range(kind: inspect.IntType | inspect.FloatType) -> str:
    limits = [(sign, getattr(kind, name)) for name, sign in _COMPARISONS.items() if getattr(kind, name) is not None]
    return ", ".join(f"{sign} {limit:.16g}" for sign, limit in limits)


def _text_limits(kind: inspect.StrType) -> str:
    limits = []
    if kind.max_length is not None:
        limits.append(f"{kind.min_length or 0} to {kind.max_length} characters")
    if kind.pattern is not None:
        limits.append(f"each of `{kind.pattern.removeprefix(_START).removesuffix(_END)}`")
    return ", ".join(limits)


def main() -> None:
    """Rewrite the page."""
    PAGE.write_text(render(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    sys.stdout.write(f"{PAGE}\n")


if __name__ == "__main__":
    main()
