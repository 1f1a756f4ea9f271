"""A game server scripted by the tests: one page, our static files, one websocket, the real messages."""

import asyncio
import contextlib
import mimetypes
import threading
import time
from collections.abc import Callable
from http import HTTPStatus
from pathlib import Path
from typing import Any

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from server.play import messages
from server.play.messages import (
    Countdown,
    Hello,
    Input,
    KitchenState,
    Outgoing,
    Ping,
    Pong,
    Tick,
    Welcome,
    decode,
    encode,
)
from server.study.locale import locale
from server.web.dependencies import templates

ROOT = Path(__file__).resolve().parents[3]
CSP = (
    "default-src 'self'; connect-src 'self'; img-src 'self'; object-src 'none'; base-uri 'none'; frame-ancestors 'none'"
)
RING = ("XXXPX", "X 1 P", "D2X X", "O   X", "XOSXX")
RINGS = ("XXOXPXPXX", "X   1   X", "D XX XX S", "X   2   X", "XXOXXXDXX")
PRACTICE = ("XXPXXXX", "X     D", "O 1   X", "X    2S", "XXXXXXX")
ALIVE = Ping(0)  # as the real server says now and then, or the page gives the line up while a slow test does something
NONE = ((6, 95), (6, 80), (6, 60))


def kitchen(t: int = 0, players: Any = ((2, 1, 0, 0), (1, 2, 0, 0)), **more: Any) -> KitchenState:
    """A state to draw; players are (x, y, facing, held)."""
    fields = {"counters": (), "pots": (), "score": 0, "soups": 0, **more}
    return KitchenState(t=t, players=tuple(players), **fields)


def welcome(**changes: Any) -> Welcome:
    fields: dict[str, Any] = {
        "protocol": messages.PROTOCOL,
        "episode": "e1",
        "kind": "episode",
        "number": 4,
        "episodes": 10,
        "layout": "coordination_ring",
        "title": "Coordination Ring",
        "grid": RING,
        "seat": 0,
        "watched_seat": 1,
        "horizon": 400,
        "tick_ms": 200,
        "steps": 3,
        "shows_predictions": True,
        "show": "always",
        "state": kitchen(),
        "resumed": False,
        "endless": False,
    }
    return Welcome(**{**fields, **changes})


def tick(
    state: KitchenState,
    prediction: Any = NONE,
    actions: tuple[int, int] = (4, 4),
    applied: int = -1,
    late: bool = False,
) -> Tick:
    return Tick(state, prediction, actions, applied, late)


class FakeGameServer:
    """Runs in a separate thread. `received` are the browser's messages in order, checked by the real decoder."""

    def __init__(self, **page: Any) -> None:
        self.reset(**page)
        self.visitor: Any = None  # the browser context that tests share: what it has loaded it need not load again
        self._loop = asyncio.new_event_loop()
        self._started = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        self._started.wait(10)

    # Methods for tests

    def reset(self, **page: Any) -> None:
        """As if newly made, at the same address."""
        self.page = {"language": "en", "leave": "/blank", "lessons": [], "away_s": 30, "ready_page": False, **page}
        self.received: list[messages.Incoming] = []
        self.welcome: Outgoing | None = welcome()
        self.on_hello: Callable[[Hello], list[Outgoing]] | None = None
        self.refusing = False  # no websocket is let in
        self.mute = False  # it sends nothing by itself, as through a dead line
        self.hellos = 0
        self._connection: ServerConnection | None = None

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/"

    def send(self, *outgoing: Outgoing) -> None:
        self._call(self._send(outgoing))

    def send_raw(self, text: str) -> None:
        assert self._connection is not None
        self._call(self._connection.send(text))

    def drop(self, code: int = 1012) -> None:
        assert self._connection is not None
        self._call(self._connection.close(code))

    def cut(self) -> None:
        """Cut the connection without a close frame."""
        assert self._connection is not None
        self._loop.call_soon_threadsafe(self._connection.transport.abort)

    def wait_for(self, wanted: Callable[["FakeGameServer"], bool], seconds: float = 10.0) -> None:
        """Return as soon as `wanted(self)`; TimeoutError with what did come otherwise."""
        until = time.monotonic() + seconds
        while not wanted(self):
            if time.monotonic() > until:
                raise TimeoutError(f"the browser sent only {self.received}")
            time.sleep(0.005)

    def inputs(self) -> list[Input]:
        return [message for message in self.received if isinstance(message, Input)]

    def of(self, kind: type) -> list[Any]:
        return [message for message in self.received if isinstance(message, kind)]

    def play(self, seconds: int = 0) -> None:
        """Count down (no time by default) and show the first tick."""
        self.send(Countdown(seconds))

    def close(self) -> None:
        self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join(10)

    # The thread

    def _call(self, work: Any) -> Any:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(10)

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._loop.run_until_complete(self._serve())
        self._loop.close()

    async def _serve(self) -> None:
        self._stop = asyncio.Event()
        async with serve(self._play, "127.0.0.1", 0, process_request=self._answer, compression=None) as server:
            self.port: int = _port(server)
            self._started.set()
            await self._stop.wait()

    async def _play(self, connection: ServerConnection) -> None:
        self._connection = connection
        received = self.received  # the last words of a page that is gone do not belong to the next test
        alive = asyncio.create_task(self._stay_alive(connection))
        try:
            async for frame in connection:
                message = decode(frame)
                if message == Pong(ALIVE.id):
                    continue
                received.append(message)
                if isinstance(message, Hello):
                    self.hellos += 1
                    await self._greet(message)
        except ConnectionClosed:
            pass
        finally:
            alive.cancel()

    async def _greet(self, hello: Hello) -> None:
        if not self.mute:
            await self._send(self.on_hello(hello) if self.on_hello else [self.welcome] if self.welcome else [])

    async def _stay_alive(self, connection: ServerConnection) -> None:
        with contextlib.suppress(ConnectionClosed):
            while True:
                await asyncio.sleep(1)
                if not self.mute:
                    await connection.send(encode(ALIVE).decode())

    async def _send(self, outgoing: Any) -> None:
        assert self._connection is not None
        for message in outgoing:
            await self._connection.send(encode(message).decode())

    async def _answer(self, _: ServerConnection, request: Request) -> Response | None:
        path = request.path.partition("?")[0]
        if path == "/socket":
            return _response(HTTPStatus.SERVICE_UNAVAILABLE, b"", "text/plain") if self.refusing else None
        if path == "/":
            return _response(HTTPStatus.OK, self._html().encode(), "text/html; charset=utf-8")
        if path == "/blank":
            return _response(HTTPStatus.OK, b"<!doctype html><title>blank</title>", "text/html; charset=utf-8")
        file = (ROOT / path.lstrip("/")).resolve()
        if file.is_relative_to(ROOT / "static") and file.is_file():
            kind = "text/javascript" if file.suffix == ".js" else mimetypes.guess_type(file.name)[0] or "text/plain"
            return _response(HTTPStatus.OK, file.read_bytes(), kind)
        return _response(HTTPStatus.NOT_FOUND, b"not found", "text/plain")

    def _html(self) -> str:
        words = locale(self.page["language"])
        return (
            templates()
            .get_template("participant/game.html")
            .render(t=words, game={"socket": "/socket", **self.page}, path="", token=str)
        )


def _port(server: Server) -> int:
    return int(next(iter(server.sockets)).getsockname()[1])


def _response(status: HTTPStatus, body: bytes, kind: str) -> Response:
    headers = Headers({"Content-Type": kind, "Content-Length": str(len(body)), "Connection": "close"})
    headers["Content-Security-Policy"] = CSP
    headers["Cache-Control"] = "no-store" if kind.startswith("text/html") else "max-age=3600"
    return Response(status.value, status.phrase, headers, body)
