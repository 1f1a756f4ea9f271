"""The game protocol as a JSON Schema, made from the message types: what the server has at `/protocol.json`.

`$defs` has every message by its name, `FromBrowser` and `FromServer` are the messages of each direction, and `StepPage`
is a participant's page as JSON. Close codes and limits, which a schema of messages cannot say, are under
`x-close-codes` and `x-limits`.
"""

import json
from collections.abc import Mapping
from functools import cache
from typing import Any, Final, get_args

import msgspec

from server.play import messages
from server.play.close_codes import CAUSES, CloseCode
from server.play.step_types import StepPage
from server.play.token_bucket import BURST, PER_S

DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"
_REFERENCE: Final = "#/$defs/{name}"


@cache
def protocol_json() -> bytes:
    """Return the text of `/protocol.json`."""
    return json.dumps(protocol_schema(), indent=1).encode()


def protocol_schema() -> dict[str, Any]:
    """Return the schema of every message, with close codes and limits."""
    sent, received = get_args(messages.Incoming), get_args(messages.Outgoing)
    _, definitions = msgspec.json.schema_components((*sent, *received, StepPage), ref_template=_REFERENCE)
    for kind in (*received, messages.KitchenState):
        definitions[kind.__name__]["required"] = list(definitions[kind.__name__]["properties"])  # nothing is left out
    unions = {"FromBrowser": _union(sent), "FromServer": _union(received)}
    return {
        "$schema": DIALECT,
        "title": "kitchenmind game protocol",
        "description": "Text frames of the websocket /s/{study}/socket, one JSON object each. The protocol page of "
        "the documentation says when each is sent. A client ignores unknown fields; the server refuses them.",
        "anyOf": [{"$ref": _REFERENCE.format(name=name)} for name in unions],
        "$defs": unions | {name: _as_json_schema(one) for name, one in sorted(definitions.items())},
        "x-protocol": messages.PROTOCOL,
        "x-close-codes": {str(int(code)): _close_code(code) for code in CloseCode},
        "x-limits": {
            "frame_bytes": messages.MAX_FRAME_BYTES,
            "messages_per_second": PER_S,
            "messages_at_once": BURST,
        },
    }


def _union(kinds: tuple[Any, ...]) -> dict[str, Any]:
    """Return "one of these messages", distinguished by `type`."""
    references = {kind.__struct_config__.tag: _REFERENCE.format(name=kind.__name__) for kind in kinds}
    return {
        "anyOf": [{"$ref": reference} for reference in references.values()],
        "discriminator": {"propertyName": "type", "mapping": references},
    }


def _close_code(code: CloseCode) -> Mapping[str, str]:
    cause, reaction = CAUSES[code]
    return {"name": code.name.lower(), "cause": cause, "client": reaction}


def _as_json_schema(given: Any) -> Any:
    """Return a schema with patterns as JSON Schema has them (ECMA-262: `^` and `$`), and descriptions on one line."""
    if isinstance(given, list):
        return [_as_json_schema(one) for one in given]
    if not isinstance(given, dict):
        return given
    made = {key: _as_json_schema(value) for key, value in given.items()}
    if isinstance(made.get("pattern"), str):
        made["pattern"] = made["pattern"].replace(r"\A", "^").replace(r"\Z", "$")
    if isinstance(made.get("description"), str):
        made["description"] = " ".join(made["description"].split())
    return made
