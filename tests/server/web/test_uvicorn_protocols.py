"""How the game's sockets use uvicorn and websockets directly, past ASGI."""

import asyncio
from typing import Any

import pytest
from uvicorn.config import Config
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from uvicorn.server import ServerState
from websockets.protocol import State

from server.uvicorn_protocols import QuietProtocol
from tests.support.served_sockets import Served, hear, play, say, serving

REMEDY = (
    "uvicorn or websockets has changed: go through server/uvicorn_protocols.py. Without the extension in "
    "`handle_connect`, all frames and keys pass through ASGI."
)
OVERRIDDEN = {
    "data_received",
    "handle_connect",
    "handle_cont",
    "handle_ping",
    "handle_pong",
    "send_receive_event_to_app",
}
READ = {
    *("transport", "writable", "queue", "frames", "curr_msg_data_type"),
    *("loop", "conn", "close_sent", "close_timer", "close_timeout"),
}


async def _nothing(scope: Any, receive: Any, send: Any) -> None: ...


async def test_the_libraries_still_have_the_internals_that_frames_and_keys_use() -> None:
    config = Config(_nothing, ws_per_message_deflate=False, log_config=None)
    config.load()
    made = QuietProtocol(config=config, server_state=ServerState(), app_state={}, _loop=asyncio.get_running_loop())
    missing = {name for name in OVERRIDDEN if not callable(getattr(WebSocketsSansIOProtocol, name, None))}
    missing |= {name for name in READ if not hasattr(made, name)}
    missing |= {name for name in ("state", "send_close", "data_to_send") if not hasattr(made.conn, name)}
    assert not missing, f"{sorted(missing)}: {REMEDY}"
    assert made.queue.empty(), REMEDY
    assert made.writable.is_set(), REMEDY
    assert made.conn.state is State.CONNECTING, REMEDY
    assert made.conn.extensions == [], "compressed frames would not be what `_write_now` writes"


async def test_a_server_that_offers_no_direct_frames_plays_through_asgi(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(QuietProtocol, "handle_connect", WebSocketsSansIOProtocol.handle_connect)
    async with serving(Served()) as served, served.connect() as socket:
        await play(socket)
        await say(socket, type="input", seq=1, held=None, tap=5, client_ms=1)
        while (await hear(socket, "tick"))["applied"] < 1:
            pass
