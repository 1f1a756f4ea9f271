"""A simulated participant at the game: speaks the protocol over a real websocket and keeps a journal of all it saw."""

import asyncio
import random
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Final, Literal, cast
from urllib.parse import urlsplit

import msgspec
import numpy as np
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.typing import Origin

from models.protocols import Policy
from overcooked.constants import INTERACT, ITEM_NAMES, STAY
from overcooked.layout import Layout, parse_layout
from overcooked.state import Kitchens
from server.bots.cook import Cook, Impression, Traits
from server.play import messages
from server.play.close_codes import CloseCode
from server.play.marks import NOTHING_SHOWN, is_as_promised
from server.study.order import derived_seed

_decoder = msgspec.json.Decoder(messages.Outgoing)
_encoder = msgspec.json.Encoder()
MOST_RECONNECTS: Final = 50
BrowserFault = Literal["reload", "second_tab", "half_open"]
_FINAL: Final = frozenset({CloseCode.SUPERSEDED, CloseCode.NO_GAME})  # after these it does not connect again


def origin_of(url: str) -> str:
    """The scheme and host of an address, as a browser sends them."""
    parts = urlsplit(url)
    return f"{parts.scheme}://{parts.netloc}"


@dataclass
class Journal:
    """What one participant sent and saw, to be held against the database afterwards."""

    inputs: list[tuple[str, int, int]] = field(default_factory=list)  # episode, timestep seen, action
    states: dict[tuple[str, int], str] = field(default_factory=dict)  # (episode, timestep) -> hash of the state seen
    ended: dict[str, dict[str, Any]] = field(default_factory=dict)  # episode -> its Ended message
    pages: list[str] = field(default_factory=list)  # step keys in the order in which they were shown
    answers: list[tuple[str, dict[str, Any]]] = field(default_factory=list)  # step key, what was sent
    games: dict[str, messages.Welcome] = field(default_factory=dict)  # episode -> how it was introduced
    impressions: list[Impression] = field(default_factory=list)  # of the episodes played to their end
    broken_displays: dict[str, set[int]] = field(default_factory=dict)  # episode -> timesteps not shown as promised
    violations: list[str] = field(default_factory=list)
    reconnects: int = 0
    browser_faults: dict[str, int] = field(
        default_factory=dict
    )  # what happened on purpose: reload, second_tab, half_open
    code: str | None = None


class SeenKitchen:
    """The game as the protocol tells it, turned back into arrays: what a chef sees, and the state's hash."""

    def __init__(self, welcome: messages.Welcome) -> None:
        self.layout: Layout = parse_layout("\n".join(welcome.grid), welcome.layout)
        self.seat, self.horizon = welcome.seat, welcome.horizon
        self._state = Kitchens.start(self.layout)

    def show(self, state: messages.KitchenState) -> str:
        """Take a state in; its hash."""
        self._state.restore(
            {
                "t": state.t,
                "p": [(x, y, facing, ITEM_NAMES[held]) for x, y, facing, held in state.players],
                "c": [(x, y, ITEM_NAMES[item]) for x, y, item in state.counters],
                "pots": state.pots,
            }
        )
        return self._state.hash()

    @property
    def now(self) -> Kitchens:
        """The state shown last, to keep."""
        return self._state.copy()

    def decide(self, policy: Policy) -> int:
        """What a cook with this policy would do now."""
        seen = self._state.encode(horizon=self.horizon)[:, max(0, self.seat)]
        return int(np.argmax(policy.probabilities(seen)[0]))


class _Left(Exception):
    """This socket is not looked at any more, and not closed."""


class GameDropped(Exception):
    """The participant closed the browser in the middle of a game."""


class BotGame:
    """Plays whatever game the participant's current step is. One object a game page."""

    def __init__(self, url: str, cookie: str, journal: Journal, traits: Traits) -> None:
        """`url`: ws://host/s/study/socket."""
        self.url, self.cookie = url, cookie
        self.browser_faults: dict[int, BrowserFault] = {}  # by the timestep at which they happen
        self.drop_at: int | None = None  # the timestep at which the browser is closed
        self._journal, self._traits = journal, traits
        self._origin = origin_of("http" + url.removeprefix("ws"))
        self._wait = random.Random()  # noqa: S311 - when to come back is nobody's choice
        self._tab = f"bot-{traits.seed:016x}"
        self._kitchen: SeenKitchen | None = None
        self._cook: Cook | None = None
        self._welcome: messages.Welcome | None = None
        self._settling = False  # just counted down: the hands are not on the keys yet
        self._seq = 0
        self._lesson = ""
        self._left_open: list[asyncio.Task[None]] = []  # sockets that nobody looks at any more

    async def play(self) -> messages.Ended | None:
        """Until the episode is over, across lost connections; None if there is no game to be played here. Raises
        GameDropped, and RuntimeError where the server takes it for an abuser."""
        for attempt in range(MOST_RECONNECTS):
            try:
                headers = {"Cookie": self.cookie}
                origin = Origin(self._origin)
                socket = await connect(self.url, additional_headers=headers, origin=origin, compression=None)
                left = False
                try:
                    return await self._talk(socket)
                except _Left:
                    left = True
                    continue  # the socket stays open: the server does not know yet
                finally:
                    if not left:
                        await _closed(socket)
            except ConnectionClosed as closed:
                if closed.rcvd is not None and closed.rcvd.code == CloseCode.GAME_READY:
                    continue  # the other person is there: the game has begun
                if closed.rcvd is not None and closed.rcvd.code == CloseCode.REFUSED:
                    raise RuntimeError(f"the game's socket was closed: {closed.rcvd.reason}") from closed
                if closed.rcvd is not None and closed.rcvd.code in _FINAL:
                    return None
            except (InvalidHandshake, OSError, TimeoutError):
                pass  # the server is away: again
            self._journal.reconnects += 1
            await asyncio.sleep(min(1.0, 0.05 * 2**attempt) * self._wait.uniform(0.5, 1.0))
        raise ConnectionError(f"{self.url}: no game after {MOST_RECONNECTS} tries")

    async def _talk(self, socket: ClientConnection) -> messages.Ended:
        """Until the episode is over. Raises ConnectionClosed, GameDropped."""
        self._seq = 0
        await self._send(socket, messages.Hello(messages.PROTOCOL, self._tab))
        while True:
            message: messages.Outgoing = _decoder.decode(await socket.recv())
            if isinstance(message, messages.Ended):
                self._over(message)
                return message
            with suppress(ConnectionClosed):  # what the server said before it closed is still to be read
                await self._answer(socket, message)

    def _over(self, ended: messages.Ended) -> None:
        if self._welcome is not None:
            self._journal.ended[self._welcome.episode] = asdict_of(ended)
        if self._cook is not None:
            self._journal.impressions.append(self._cook.impression)

    async def _answer(self, socket: ClientConnection, message: messages.Outgoing) -> None:
        match message:
            case messages.Welcome():
                self._begin(message)
                self._saw(message.state)
                await self._send(socket, messages.Ready())
            case messages.Countdown():
                self._settling = True
            case messages.Tick():
                self._saw(message.state)
                self._saw_marks(message)
                await self._leave(socket, message.state.t)
                await self._act(socket, message)
            case messages.Paused(reason=reason) if reason not in ("database", "researcher", "partner"):
                await self._send(socket, messages.Ready())
            case messages.Lesson():
                self._lesson = "" if message.done else message.key
            case messages.Ping():
                await self._send(socket, messages.Pong(message.id))
            case messages.Refused(code="bad_message"):
                self._journal.violations.append(f"refused: {message.reason}")

    def _begin(self, welcome: messages.Welcome) -> None:
        if self._welcome is not None and self._welcome.episode == welcome.episode:
            return  # back in the same game: what was seen of it is remembered
        self._welcome, self._kitchen = welcome, SeenKitchen(welcome)
        self._journal.games[welcome.episode] = welcome
        if welcome.seat >= 0:
            seed = derived_seed("bot", welcome.kind, welcome.number)
            self._cook = Cook(self._kitchen.layout, welcome.seat, self._traits, seed)

    def _saw(self, state: messages.KitchenState) -> None:
        """A state never changes once it was shown."""
        if self._kitchen is None or self._welcome is None:
            return self._journal.violations.append("a state came before the welcome")
        seen = self._kitchen.show(state)
        place = (self._welcome.episode, state.t)
        if self._journal.states.setdefault(place, seen) != seen:
            self._journal.violations.append(f"episode {place[0]} timestep {state.t} was shown in two ways")

    def _saw_marks(self, tick: messages.Tick) -> None:
        """Note a timestep whose display is not what the welcome promised."""
        if self._welcome is None:
            return
        shown = "predictor" if self._welcome.shows_predictions else "nothing"
        if not is_as_promised(shown, tick.prediction):
            self._journal.broken_displays.setdefault(self._welcome.episode, set()).add(tick.state.t)

    async def _leave(self, socket: ClientConnection, timestep: int) -> None:
        """Close the browser, or run into trouble. Raises GameDropped, OSError: connect again."""
        if self.drop_at is not None and timestep >= self.drop_at:
            socket.transport.abort()
            raise GameDropped
        due = next((at for at in self.browser_faults if timestep >= at), None)
        if due is None:
            return
        fault = self.browser_faults.pop(due)
        self._journal.browser_faults[fault] = self._journal.browser_faults.get(fault, 0) + 1
        if fault == "reload":
            socket.transport.abort()
            await socket.wait_closed()
        elif fault == "second_tab":
            self._tab += "x"
            self._left_open.append(asyncio.create_task(self._taken_over(socket)))
            raise _Left
        else:
            self._left_open.append(asyncio.create_task(socket.wait_closed()))
            raise _Left
        raise OSError("the page was loaded again")

    async def _taken_over(self, socket: ClientConnection) -> None:
        """The tab that was left hears that another one plays now."""
        with suppress(ConnectionClosed):
            async with asyncio.timeout(10):
                async for _ in socket:
                    pass  # what is still said to it changes nothing
        if socket.close_code not in (CloseCode.SUPERSEDED, CloseCode.LOST):
            self._journal.violations.append(
                f"a tab that was left closed with {socket.close_code}, not {CloseCode.SUPERSEDED}"
            )

    async def _act(self, socket: ClientConnection, tick: messages.Tick) -> None:
        """Say every timestep what the hands do, also when they rest: a simulation need not wait any longer then."""
        if self._kitchen is None or self._cook is None or self._welcome is None:
            return
        arrow = tick.prediction[0][0] if tick.prediction else NOTHING_SHOWN
        shown = None if arrow == NOTHING_SHOWN or self._welcome.watched_seat == self._welcome.seat else arrow
        state, now = tick.state, self._kitchen.now
        action = self._cook.act(now, state.soups, tick.actions, shown, self._welcome.horizon)
        action = INTERACT if self._lesson == "marks" else action
        action, self._settling = (STAY, False) if self._settling else (action, False)
        self._seq += 1
        self._journal.inputs.append((self._welcome.episode, state.t, action))
        tap = None if action == STAY else cast(messages.Tap, action)
        client_ms = float(state.t * self._welcome.tick_ms)  # its clock goes as the game's does, however fast that is
        await self._send(socket, messages.Input(self._seq, None, tap, client_ms))

    @staticmethod
    async def _send(socket: ClientConnection, message: messages.Incoming) -> None:
        await socket.send(_encoder.encode(message).decode())


async def _closed(socket: ClientConnection) -> None:
    with suppress(Exception):
        await socket.close()


def asdict_of(message: messages.Outgoing) -> dict[str, Any]:
    return {name: getattr(message, name) for name in message.__struct_fields__}
