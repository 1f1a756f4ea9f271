"""One participant's sockets for the checks of `kitchenmind conformance`: expect a message within a few seconds."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from typing import Any, Final, TypeVar

import msgspec
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

from kitchenmind.client.game_client import decoded
from kitchenmind.client.study_client import StudyClient
from server.play import messages
from server.play.close_codes import CloseCode

Message = TypeVar("Message")
TIMEOUT_S: Final = 15.0  # longer than any countdown


class Unmet(Exception):
    """The server did something unexpected; the message says what."""


class CheckedSockets:
    """One simulated participant of a study and their sockets."""

    def __init__(self, url: str, study: str, secret: str = "", within_s: float = TIMEOUT_S) -> None:
        """`within_s`: how long the server may take for an answer."""
        self.client = StudyClient(url, study, secret=secret)
        self.url, self.study, self.within_s = url.rstrip("/"), study, within_s

    @asynccontextmanager
    async def welcomed(self) -> AsyncIterator[tuple[ClientConnection, messages.Welcome]]:
        """Return a game socket after hello and welcome."""
        async with self.game() as socket:
            await send(socket, hello())
            yield socket, await self.until(socket, messages.Welcome)

    @asynccontextmanager
    async def game(self) -> AsyncIterator[ClientConnection]:
        require(bool(self.client.token), "there is no participant: consent failed")
        async with self.open(f"/s/{self.study}/socket", self.client.cookie) as socket:
            yield socket

    @asynccontextmanager
    async def open(self, path: str, cookie: str) -> AsyncIterator[ClientConnection]:
        headers = {"Cookie": cookie} if cookie else {}
        url = f"ws{self.url.removeprefix('http')}{path}"
        async with connect(url, additional_headers=headers, compression=None, open_timeout=self.within_s) as socket:
            yield socket

    async def received(self, socket: ClientConnection) -> str | bytes:
        async with asyncio.timeout(self.within_s):
            return await socket.recv(decode=None)

    async def until(self, socket: ClientConnection, kind: type[Message]) -> Message:
        """Return the next message of this kind, answering pings before it. Raises Unmet."""
        try:
            async with asyncio.timeout(self.within_s):
                while not isinstance(message := await _next(socket), kind):
                    pass
                return message
        except TimeoutError:
            raise Unmet(f"there was no {kind_name(kind)} within {self.within_s:g} s") from None
        except ConnectionClosed as closed:
            code = closed.rcvd.code if closed.rcvd else CloseCode.LOST
            raise Unmet(f"the socket closed with {code} before a {kind_name(kind)}") from None

    async def closed(self, socket: ClientConnection, wanted: CloseCode) -> None:
        """Wait until the socket closes with this code. Raises Unmet."""
        try:
            async with asyncio.timeout(self.within_s):
                while True:
                    await _next(socket)
        except TimeoutError:
            raise Unmet(f"the socket did not close within {self.within_s:g} s") from None
        except ConnectionClosed as closed:
            code = closed.rcvd.code if closed.rcvd else CloseCode.LOST
            require(code == wanted, f"the socket closed with {int(code)}")


async def _next(socket: ClientConnection) -> messages.Outgoing:
    """Return the next message, and answer it if it is a ping."""
    message = decoded(await socket.recv())
    if isinstance(message, messages.Ping):
        with suppress(ConnectionClosed):  # messages that arrived before the close are still to be read
            await send(socket, messages.Pong(message.id))
    return message


def require(holds: bool, otherwise: str) -> None:
    if not holds:
        raise Unmet(otherwise)


def hello(tab: str = "conformance-1") -> messages.Hello:
    return messages.Hello(messages.PROTOCOL, tab)


async def send(socket: ClientConnection, message: messages.Incoming) -> None:
    await socket.send(msgspec.json.encode(message).decode())


def name_of(message: Any) -> str:
    return kind_name(type(message))


def kind_name(kind: Any) -> str:
    return "message" if kind is messages.ToBrowser else str(kind.__struct_config__.tag)
