"""`/protocol.json` describes every message that is really sent, and refuses what the server refuses."""

import json
from pathlib import Path
from typing import Any, get_args

import httpx
import jsonschema_rs
import pytest
from websockets.asyncio.client import ClientConnection

from server.bots.participant import Bot, Habits
from server.play import messages
from server.play.close_codes import CloseCode
from server.play.protocol_schema import protocol_schema
from tests.server.play.test_protocol_page import EXAMPLES
from tests.support.live_server import LiveServer


def validator(direction: str, schema: dict[str, Any] | None = None) -> jsonschema_rs.Draft202012Validator:
    given = schema or protocol_schema()
    return jsonschema_rs.Draft202012Validator(given | {"anyOf": [{"$ref": f"#/$defs/{direction}"}]})


async def test_every_frame_of_real_games_fits_the_schema_that_the_server_serves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A tutorial and an episode, with a page that is loaded again in the middle."""
    sent: list[Any] = []
    received: list[Any] = []
    send, recv = ClientConnection.send, ClientConnection.recv

    async def sending(self: ClientConnection, frame: Any, *more: Any) -> None:
        sent.append(json.loads(frame))
        await send(self, frame, *more)

    async def receiving(self: ClientConnection, *more: Any) -> Any:
        frame = await recv(self, *more)
        received.append(json.loads(frame))
        return frame

    with LiveServer(tmp_path) as live:
        schema = httpx.get(f"{live.url}/protocol.json").raise_for_status().json()
        monkeypatch.setattr(ClientConnection, "send", sending)
        monkeypatch.setattr(ClientConnection, "recv", receiving)
        journal = await Bot(live.url, "short", 1, Habits(browser_faults=("reload",))).take_part()
    assert journal.code
    assert {frame["type"] for frame in sent} >= {"hello", "ready", "input"}
    assert {frame["type"] for frame in received} >= {"welcome", "countdown", "tick", "lesson", "paused", "ended"}
    for direction, frames in (("FromBrowser", sent), ("FromServer", received)):
        checks = validator(direction, schema)
        assert [frame for frame in frames if not checks.is_valid(frame)] == []


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: json.loads(example)["type"])
def test_every_example_of_the_page_fits(example: str) -> None:
    message = json.loads(example)
    sent = {kind.__struct_config__.tag for kind in get_args(messages.Incoming)}
    fits, other = ("FromBrowser", "FromServer") if message["type"] in sent else ("FromServer", "FromBrowser")
    assert validator(fits).is_valid(message)
    assert not validator(other).is_valid(message)


@pytest.mark.parametrize(
    "message",
    [
        {"type": "unknown"},
        {"type": "ready", "more": 1},
        {"type": "hello", "protocol": 1},
        {"type": "hello", "protocol": 1, "tab": "short"},
        {"type": "hello", "protocol": 1, "tab": "long enough"},
        {"type": "hello", "protocol": 1, "tab": "t-5f2c9a1b", "last_timestep": -2},
        {"type": "input", "seq": 1, "held": 4, "tap": None, "client_ms": 1},
        {"type": "input", "seq": 1, "held": None, "tap": 4, "client_ms": 1},
        {"type": "input", "seq": 2**53, "held": None, "tap": None, "client_ms": 1},
        {"type": "input", "seq": True, "held": None, "tap": None, "client_ms": 1},
        {"type": "away", "reason": "lost"},
        {"type": "pong", "id": -1},
        {"type": "trouble", "text": "x" * 501},
    ],
    ids=str,
)
def test_what_the_server_refuses_does_not_fit(message: dict[str, Any]) -> None:
    with pytest.raises(messages.BadMessage):
        messages.decode(json.dumps(message))
    assert not validator("FromBrowser").is_valid(message)


def test_a_field_that_a_later_server_adds_fits() -> None:
    assert validator("FromServer").is_valid({"type": "countdown", "seconds": 3, "away_s": 30, "later": 1})
    assert not validator("FromServer").is_valid({"type": "ended", "score": 0}), "the server leaves nothing out"


def test_it_has_every_close_code_and_the_limits() -> None:
    schema = protocol_schema()
    assert {int(code) for code in schema["x-close-codes"]} == set(CloseCode)
    assert schema["x-protocol"] == messages.PROTOCOL
    assert schema["x-limits"]["frame_bytes"] == messages.MAX_FRAME_BYTES
