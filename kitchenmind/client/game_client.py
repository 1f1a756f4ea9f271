"""A player at the game's websocket: follows the protocol, reconnects after a lost connection, and calls `act` for each
action. Make a subclass with an `act` of your own. `on_message` gets every message of the server.
"""

import asyncio
import random
import secrets
from contextlib import suppress
from typing import Final, cast
from urllib.parse import urlsplit

import msgspec
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.typing import Origin

from kitchenmind.client.seen_kitchen import SeenKitchen, compile_rules
from overcooked.constants import ACTIONS, INTERACT, STAY
from server.play import messages
from server.play.close_codes import CloseCode

_decoder = msgspec.json.Decoder(messages.Outgoing)
_encoder = msgspec.json.Encoder()
MAX_RECONNECTS: Final = 50
_FINAL: Final = frozenset({CloseCode.SUPERSEDED, CloseCode.NO_GAME})  # after these it does not connect again
_NOT_OURS: Final = ("database", "researcher", "partner")  # pauses that this player does not end


class ProtocolError(RuntimeError):
    """The server sent something that is not a message of this protocol; the text says what."""


class SocketLeft(Exception):
    """Stop reading this socket without closing it; the player connects again."""


def origin_of(url: str) -> str:
    """Return the scheme and host of an address, as a browser sends them."""
    parts = urlsplit(url)
    return f"{parts.scheme}://{parts.netloc}"


class GameClient:
    """Plays the game of a participant's current step; one object per game.

    `welcome` introduces the game, `kitchen` is the state shown last as arrays, `lesson` the key of the tutorial's
    lesson. `violations` collects sentences about messages that the server should not have sent.
    """

    first_wait_s = 0.15  # before it connects again; doubled every time, up to the longest
    longest_wait_s = 2.0

    def __init__(self, url: str, cookie: str = "", tab: str = "") -> None:
        """`url`: ws://host/s/study/socket; `cookie`: the participant's; `tab`: the name of the browser tab."""
        self.url, self.cookie = url, cookie
        self.tab = tab or f"client-{secrets.token_hex(8)}"
        self.welcome: messages.Welcome | None = None
        self.kitchen: SeenKitchen | None = None
        self.state_hash = ""  # of the state shown last
        self.lesson = ""
        self.violations: list[str] = []
        self.reconnects = 0
        self._origin = origin_of("http" + url.removeprefix("ws"))
        self._wait = random.Random()  # noqa: S311 - when to come back is nobody's choice
        self._seq = 0
        self._answered = ""  # the reason of the pause that `ready` was sent for, until something else comes

    def act(self, tick: messages.Tick) -> int | None:  # noqa: ARG002 - for subclasses
        """Return the action on this state: 0 north, 1 south, 2 east, 3 west, 4 stay, 5 interact; None to send nothing.
        `self.kitchen` has the state already."""
        return STAY

    def chosen(self, tick: messages.Tick) -> int | None:
        """Return the action that is sent: that of `act`; in the tutorial's lesson `marks` interact, which says
        "understood"."""
        action = self.act(tick)
        return INTERACT if self.lesson == "marks" and action is not None else action

    def asks(self, tick: messages.Tick) -> bool | None:  # noqa: ARG002 - for subclasses
        """Return whether the marks key is down, if the study shows the marks on demand; None sends nothing. By default
        it is held down: with `toggle`, that is one press."""
        return None if self.welcome is None or self.welcome.show == "always" else True

    def on_message(self, message: messages.Outgoing) -> None:
        """Handle a message before it is answered. `self.kitchen` has its state already."""

    async def before_acting(self, socket: ClientConnection, tick: messages.Tick) -> None:
        """Do something before acting in this tick. May raise OSError or SocketLeft: the player connects again."""

    def lost(self) -> None:
        """Count a connection that was lost or could not be opened."""
        self.reconnects += 1

    async def play(self) -> messages.Ended | None:
        """Play until the episode is over, across lost connections; return how it ended, None if there is no game to be
        played here. Raises ProtocolError, RuntimeError if the server takes this player for an abuser, and
        ConnectionError if there is no server."""
        compile_rules()
        for attempt in range(MAX_RECONNECTS):
            try:
                return await self._play_once()
            except SocketLeft:
                continue
            except ConnectionClosed as closed:
                code = None if closed.rcvd is None else closed.rcvd.code
                if code == CloseCode.GAME_READY:
                    continue  # the other person has arrived: the game has begun
                if code == CloseCode.REFUSED and closed.rcvd is not None:
                    raise RuntimeError(f"the game's socket was closed: {closed.rcvd.reason}") from closed
                if code in _FINAL:
                    return None
            except (InvalidHandshake, OSError, TimeoutError):
                pass  # the server cannot be reached: try again
            self.lost()
            longest = min(self.longest_wait_s, self.first_wait_s * 2**attempt)
            await asyncio.sleep(longest * self._wait.uniform(0.5, 1.0))
        raise ConnectionError(f"{self.url}: no game after {MAX_RECONNECTS} tries")

    async def _play_once(self) -> messages.Ended:
        """Play on one connection. Raises what `play` handles."""
        headers = {"Cookie": self.cookie} if self.cookie else {}
        origin = Origin(self._origin)
        socket = await connect(self.url, additional_headers=headers, origin=origin, compression=None)
        left = False
        try:
            return await self._talk(socket)
        except SocketLeft:
            left = True  # the socket stays open: the server has not noticed yet
            raise
        finally:
            if not left:
                with suppress(Exception):
                    await socket.close()

    async def _talk(self, socket: ClientConnection) -> messages.Ended:
        """Exchange messages until the episode is over. Raises ConnectionClosed."""
        self._seq = 0
        await self.send(socket, messages.Hello(messages.PROTOCOL, self.tab))
        while True:
            message = decoded(await socket.recv())
            self._take_in(message)
            self.on_message(message)
            if isinstance(message, messages.Ended):
                return message
            with suppress(ConnectionClosed):  # messages that the server sent before it closed are still to be read
                await self._answer(socket, message)

    def _take_in(self, message: messages.Outgoing) -> None:
        """Update the client's view of the game from a message."""
        match message:
            case messages.Welcome():
                if self.welcome is None or self.welcome.episode != message.episode:
                    self.kitchen = SeenKitchen(message)
                self.welcome = message
                self._show(message.state)
            case messages.Tick():
                self._show(message.state)
            case messages.Lesson():
                self.lesson = "" if message.done else message.key

    def _show(self, state: messages.KitchenState) -> None:
        if self.kitchen is None:
            self.violations.append("a state came before the welcome")
        else:
            self.state_hash = self.kitchen.show(state)

    async def _answer(self, socket: ClientConnection, message: messages.Outgoing) -> None:
        match message:
            case messages.Welcome():
                self._answered = ""
                await self.send(socket, messages.Ready())
            case messages.Paused(reason=reason):
                # Once: a server that is stopping answers `ready` with the same pause.
                if reason not in (*_NOT_OURS, self._answered):
                    await self.send(socket, messages.Ready())
                self._answered = reason
            case messages.Countdown():
                self._answered = ""
            case messages.Ping():
                await self.send(socket, messages.Pong(message.id))
            case messages.Tick():
                await self.before_acting(socket, message)
                await self._act(socket, message)

    async def _act(self, socket: ClientConnection, tick: messages.Tick) -> None:
        """Send the held keys in every timestep, also if there are none: a simulation need not wait any longer then."""
        if self.kitchen is None or self.welcome is None or self.welcome.seat < 0:
            return
        action = self.chosen(tick)
        if action is None:
            return
        if not 0 <= action < ACTIONS:
            raise ValueError(f"{type(self).__name__}.act returned {action!r}. An action is 0 to {ACTIONS - 1}.")
        self._seq += 1
        tap = None if action == STAY else cast(messages.Tap, int(action))
        client_ms = float(tick.state.t * self.welcome.tick_ms)  # its clock runs at the game's speed
        await self.send(socket, messages.Input(self._seq, None, tap, client_ms, self.asks(tick)))

    @staticmethod
    async def send(socket: ClientConnection, message: messages.Incoming) -> None:
        """Send one message."""
        await socket.send(_encoder.encode(message).decode())


def decoded(frame: str | bytes) -> messages.Outgoing:
    """Return the message of the server in a frame. Raises ProtocolError."""
    try:
        message: messages.Outgoing = _decoder.decode(frame)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise ProtocolError(f"the server sent something that is not a message ({error}): {frame!r:.200}") from None
    return message
