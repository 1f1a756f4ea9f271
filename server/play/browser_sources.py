"""Generate the files that the pages' scripts share with the server from the Python types: `python -m
server.play.browser_sources`.

`wire.d.ts` has the types of all messages (read only by the type checker of the scripts), `protocol.js` the protocol's
number and the close codes. A test compares both with the types.
"""

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, get_args

from msgspec import inspect

from server.play import messages
from server.play.close_codes import CloseCode

SCRIPTS: Final = Path(__file__).parents[2] / "static" / "js"
_NOTE: Final = "// Written by `python -m server.play.browser_sources`. Do not edit.\n"


def files() -> Mapping[Path, str]:
    """Return every written file and its text as the types are now."""
    return {SCRIPTS / "browser" / "wire.d.ts": types(), SCRIPTS / "browser" / "protocol.js": constants()}


def constants() -> str:
    """Return the module with the protocol's number and the close codes."""
    codes = "".join(f"  {code.name}: {code.value},\n" for code in CloseCode)
    return (
        f"{_NOTE}\nexport const PROTOCOL = {messages.PROTOCOL};\n\n"
        "/** Why a websocket closes; see docs/reference/protocol.md. */\n"
        f"export const CloseCode = Object.freeze({{\n{codes}}});\n"
    )


def types() -> str:
    """Return the namespace `Wire`: an interface a message, and the two unions by direction."""
    sent, received = get_args(messages.Incoming), get_args(messages.Outgoing)
    blocks = [_interface(kind) for kind in (messages.KitchenState, *received, *sent)]
    unions = (_union("FromServer", received), _union("FromBrowser", sent))
    return f"{_NOTE}\ndeclare namespace Wire {{\n" + "\n".join((*blocks, *unions)) + "}\n"


def _interface(kind: Any) -> str:
    described = inspect.type_info(kind)
    assert isinstance(described, inspect.StructType)  # noqa: S101
    lines = [] if described.tag is None else [f"    type: {json.dumps(described.tag)};"]
    lines += [f"    {_field(kind, field)};" for field in described.fields]
    return f"  interface {kind.__name__} {{\n" + "".join(f"{line}\n" for line in lines) + "  }\n"


def _field(kind: Any, field: inspect.Field) -> str:
    may_be_left_out = issubclass(kind, messages.FromBrowser) and not field.required  # the server leaves nothing out
    return f"{field.encode_name}{'?' if may_be_left_out else ''}: {type_of(field.type)}"


def _union(name: str, kinds: tuple[Any, ...]) -> str:
    return f"  type {name} =\n" + "\n".join(f"    | {kind.__name__}" for kind in kinds) + ";\n"


def type_of(kind: inspect.Type) -> str:
    """Return a field's type in TypeScript. Raises TypeError for one that has no counterpart here."""
    match kind:
        case inspect.UnionType(types=parts):
            return " | ".join(type_of(part) for part in parts)
        case inspect.LiteralType(values=literals):
            return " | ".join(json.dumps(literal) for literal in literals)
        case inspect.StrType():
            return "string"
        case inspect.IntType() | inspect.FloatType():
            return "number"
        case inspect.BoolType():
            return "boolean"
        case inspect.NoneType():
            return "null"
        case inspect.VarTupleType(item_type=item):
            return f"{type_of(item)}[]"
        case inspect.TupleType(item_types=items):
            return f"[{', '.join(type_of(item) for item in items)}]"
        case inspect.StructType(cls=cls) if cls is messages.KitchenState:
            return "KitchenState"
    raise TypeError(f"no TypeScript type for {kind}")


def main() -> None:
    """Write the files."""
    for path, text in files().items():
        path.write_text(text, encoding="utf-8")
        sys.stdout.write(f"{path}\n")


if __name__ == "__main__":
    main()
