"""A server of game sockets on a free port, with helpers to send and receive messages."""

import asyncio
import json
import socket as sockets
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import uvicorn
from fastapi import FastAPI
from starlette.requests import HTTPConnection
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

from server.participation.game_seats import ConnectedPlayer
from server.play.clock import Clock
from server.play.games import Games
from server.play.messages import MAX_READ_BYTES
from server.play.recorder import EpisodeRecord
from server.store.database import DatabaseDown
from server.uvicorn_protocols import SparingProtocol
from server.web.csrf import CsrfProtection
from server.web.participant import game_socket
from server.web.participant.game_socket import Sockets
from tests.support.live_fakes import MemoryRecorder, RuleModels, make_spec
from tests.support.some_services import some_services

HELLO = {"type": "hello", "protocol": 1, "tab": "tab-0001"}


class Served:
    """A server on a free port with real sockets; who plays what is told by the cookie `participant=<id>`."""

    def __init__(self, clock: Clock | None = None) -> None:
        self.recorder = MemoryRecorder()
        self.spec = make_spec(horizon=0)
        self.games = Games(clock or Clock(10.0), RuleModels(), self.recorder, self.load)
        self.client_errors: list[str] = []
        self.app = FastAPI()
        self.app.include_router(game_socket.router)
        self.sockets = Sockets(self.games, self.find, CsrfProtection(b"secret").is_own_origin, self.report)
        self.app.state.services = some_services(sockets=self.sockets)
        self.url = ""
        self.database_down = False

    async def load(self, episode: str) -> EpisodeRecord | None:
        return self.recorder.load(self.spec, episode)

    async def find(self, connection: HTTPConnection, study: str) -> ConnectedPlayer | None:
        if self.database_down:
            raise DatabaseDown("switched off")
        who = connection.cookies.get("participant")
        if who is None or study != "demo":
            return None
        return ConnectedPlayer(who, None if who == "reader" else f"episode-of-{who}", 0, "/s/demo/now")

    async def report(self, participant: str, text: str) -> None:
        self.client_errors.append(f"{participant}: {text}")

    def connect(self, who: str | None = "ann", **more: Any) -> connect:
        headers = {"Cookie": f"participant={who}"} if who else {}
        return connect(self.url, additional_headers=headers, compression=None, **more)


@asynccontextmanager
async def serving(made: Served) -> AsyncIterator[Served]:
    config = uvicorn.Config(
        made.app,
        ws=SparingProtocol,  # type: ignore[arg-type] # as `kitchenmind serve`
        ws_max_size=MAX_READ_BYTES,
        ws_per_message_deflate=False,
        ws_ping_interval=None,
        log_level="error",
        lifespan="off",
    )
    listening = sockets.create_server(("127.0.0.1", 0))
    made.url = f"ws://127.0.0.1:{listening.getsockname()[1]}/s/demo/socket"
    server = uvicorn.Server(config)
    server.install_signal_handlers = lambda: None  # type: ignore[attr-defined]
    task = asyncio.create_task(server.serve(sockets=[listening]))
    while not server.started:
        await asyncio.sleep(0.01)
    try:
        yield made
    finally:
        await made.games.stop()
        server.should_exit = True
        await task
        listening.close()


async def hear(socket: ClientConnection, kind: str, most: int = 200) -> dict[str, Any]:
    """The next message of a kind; Pings before it are answered."""
    for _ in range(most):
        message = json.loads(await asyncio.wait_for(socket.recv(), 10))
        if message["type"] == kind:
            return dict(message)
        if message["type"] == "ping":
            await say(socket, type="pong", id=message["id"])
    raise AssertionError(f"no {kind}")


async def say(socket: ClientConnection, **message: Any) -> None:
    await socket.send(json.dumps(message))


async def close_code(socket: ClientConnection) -> int | None:
    """Read until the server closes."""
    try:
        async with asyncio.timeout(10):
            while True:
                await socket.recv()
    except ConnectionClosed:
        return socket.close_code


async def play(socket: ClientConnection) -> None:
    await say(socket, **HELLO)
    await hear(socket, "welcome")
    await say(socket, type="ready")
    while (await hear(socket, "tick"))["state"]["t"] == 0:
        pass
