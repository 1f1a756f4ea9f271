"""A client that keeps playing through every fault and records what it sent and received, and when. It is independent of
the simulated participants, and plays at random.
"""

import asyncio
import random
import time
from bisect import bisect_right
from contextlib import suppress
from dataclasses import dataclass, field
from html.parser import HTMLParser
from itertools import count
from typing import Any

import httpx
import msgspec
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.typing import Origin

from overcooked.constants import ITEM_NAMES
from overcooked.layout import parse_layout
from overcooked.state import Kitchens
from server.play import messages
from server.play.close_codes import CloseCode

# After these a page does not connect again by itself.
FINAL = frozenset({CloseCode.REFUSED, CloseCode.SUPERSEDED, CloseCode.NO_GAME})
OPEN_S = 5.0
TAPS = (0, 1, 2, 3, 5)
_lines = count(1)
_decoder = msgspec.json.Decoder(messages.Outgoing)


@dataclass(frozen=True)
class LogEntry:
    """One message of the server, or a change of the connection."""

    at: float  # time.monotonic()
    kind: str  # a message's type, or "open", "closed"
    detail: Any = None  # timestep, reason, close code
    line: int = 0  # which connection


@dataclass
class ClientLog:
    """What one participant sent and saw, to be compared with the database."""

    __test__ = False  # for pytest, which would take the name for a test

    entries: list[LogEntry] = field(default_factory=list)
    states: dict[tuple[str, int], str] = field(default_factory=dict)  # (episode, timestep) -> hash of the state seen
    inputs: list[tuple[str, int, int]] = field(default_factory=list)  # episode, seq, tap
    ended: dict[str, messages.Ended] = field(default_factory=dict)
    submitted: list[str] = field(default_factory=list)  # step keys whose submission was answered
    errors: list[int] = field(default_factory=list)  # statuses of 500 and more
    violations: list[str] = field(default_factory=list)
    reconnects: int = 0
    seq: int = 0  # of the newest input, over all tabs
    code: str | None = None

    def note(self, kind: str, detail: Any = None, line: int = 0) -> None:
        self.entries.append(LogEntry(time.monotonic(), kind, detail, line))

    def first(self, kind: str, after: float, detail: Any = None) -> LogEntry | None:
        """The first of its kind after a moment."""
        later = self.entries[bisect_right(self.entries, after, key=lambda entry: entry.at) :]
        return next((entry for entry in later if entry.kind == kind and detail in (None, entry.detail)), None)


class ClientGame:
    """One game page: comes back as the browser's does, for as long as it takes."""

    def __init__(self, url: str, cookie: str, log: ClientLog, chance: random.Random, idle: float) -> None:
        """`url`: ws://host/s/study/socket; `idle`: the share of timesteps without a key."""
        self.url, self.cookie, self.tab = url, cookie, f"tab-{chance.getrandbits(64):016x}"
        self.log, self.chance, self.idle = log, chance, idle
        self.episode = ""
        self.by_itself = True  # presses "continue" whenever it can
        self._kitchen: Kitchens | None = None

    async def play(self) -> messages.Ended | None:
        """Until the episode is over; None if there is no game to be played here."""
        attempt = 0
        while True:
            before = len(self.log.states)
            try:
                async with self.connect() as socket:
                    return await self.talk(socket)
            except ConnectionClosed as closed:
                code = closed.rcvd.code if closed.rcvd is not None else 1006
                self.log.note("closed", code)
                if code in FINAL:
                    return None
            except (InvalidHandshake, OSError, TimeoutError, EOFError):
                self.log.note("closed", 0)  # the server cannot be reached: try again
            self.log.reconnects += 1
            attempt = 0 if len(self.log.states) > before else attempt
            await asyncio.sleep(min(2.0, 0.15 * 2**attempt) * self.chance.uniform(0.5, 1.0))
            attempt += 1

    def connect(self) -> connect:
        origin = Origin("http" + self.url.removeprefix("ws").split("/s/")[0])
        times: dict[str, Any] = {"open_timeout": OPEN_S, "ping_interval": None, "close_timeout": 1}
        return connect(self.url, additional_headers={"Cookie": self.cookie}, origin=origin, compression=None, **times)

    async def talk(self, socket: ClientConnection) -> messages.Ended:
        """Until the episode is over. Raises ConnectionClosed."""
        line = next(_lines)
        self.log.note("open", line=line)
        await self.say(socket, messages.Hello(messages.PROTOCOL, self.tab))
        while True:
            message: messages.Outgoing = _decoder.decode(await socket.recv())
            self._note(message, line)
            if isinstance(message, messages.Ended):
                self.log.ended[self.episode] = message
                return message
            with suppress(ConnectionClosed):  # messages that the server sent before it closed are still to be read
                await self.answer(socket, message)

    def _note(self, message: messages.Outgoing, line: int) -> None:
        detail: Any = None
        if isinstance(message, messages.Tick | messages.Welcome):
            detail = message.state.t
        elif isinstance(message, messages.Paused):
            detail = message.reason
        elif isinstance(message, messages.Refused):
            detail = message.code
        self.log.note(type(message).__name__.lower(), detail, line)

    async def answer(self, socket: ClientConnection, message: messages.Outgoing) -> None:
        match message:
            case messages.Welcome():
                self.episode = message.episode
                self._kitchen = Kitchens.start(parse_layout("\n".join(message.grid), message.layout))
                self._saw(message.state)
                if self.by_itself:
                    await self.say(socket, messages.Ready())
            case messages.Tick():
                self._saw(message.state)
                await self.act(socket)
            case messages.Paused(reason=reason) if self.by_itself and reason not in ("database", "researcher"):
                await self.say(socket, messages.Ready())
            case messages.Ping():
                await self.say(socket, messages.Pong(message.id))
            case messages.Refused(code="bad_message"):
                self.log.violations.append(f"refused: {message.reason}")

    def _saw(self, state: messages.KitchenState) -> None:
        """A state never changes once it was shown."""
        assert self._kitchen is not None
        players = [(x, y, facing, ITEM_NAMES[held]) for x, y, facing, held in state.players]
        counters = [(x, y, ITEM_NAMES[item]) for x, y, item in state.counters]
        self._kitchen.restore({"t": state.t, "p": players, "c": counters, "pots": state.pots})
        seen, place = self._kitchen.hash(), (self.episode, state.t)
        if self.log.states.setdefault(place, seen) != seen:
            self.log.violations.append(f"{place} was shown in two ways")

    async def act(self, socket: ClientConnection) -> None:
        if self.chance.random() >= self.idle:
            self.log.seq += 1
            seq, tap = self.log.seq, self.chance.choice(TAPS)
            self.log.inputs.append((self.episode, seq, tap))
            await self.say(socket, messages.Input(seq, None, tap, float(seq)))

    @staticmethod
    async def say(socket: ClientConnection, message: messages.Incoming) -> None:
        await socket.send(msgspec.json.encode(message).decode())


class ClientPage(HTMLParser):
    """What of a page a participant acts on: the form, the game, the completion code."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.form: dict[str, str] = {}
        self.is_game = False
        self.code: str | None = None
        self._here = self._in_code = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        self.is_game = self.is_game or values.get("id") == "game-config"
        self._in_code = tag == "output" and values.get("id") == "code"
        if tag == "form":
            self._here = values.get("action", "").endswith(("/now", "/consent"))
        elif self._here and tag in ("input", "textarea", "button") and values.get("name"):
            otherwise = {"number": "30", "checkbox": "yes"}.get(values.get("type", ""), "-")
            self.form.setdefault(values["name"], values.get("value") or otherwise)

    def handle_data(self, data: str) -> None:
        if self._in_code and data.strip():
            self.code = data.strip()


class RecordingClient:
    """One participant with one cookie. A page that cannot be had now is asked for again."""

    def __init__(self, base_url: str, study: str = "short", seed: int = 0) -> None:
        self.log, self.chance, self.idle = ClientLog(), random.Random(seed), 0.6
        self.game_type: type[ClientGame] = ClientGame
        self.base, self.study = base_url, study
        headers = {"Accept": "text/html", "Origin": base_url}
        self.http = httpx.AsyncClient(base_url=base_url, headers=headers, follow_redirects=True, timeout=60)

    @property
    def cookie(self) -> str:
        return "; ".join(f"{name}={value}" for name, value in self.http.cookies.items())

    def game(self) -> ClientGame:
        url = f"ws{self.base.removeprefix('http')}/s/{self.study}/socket"
        return self.game_type(url, self.cookie, self.log, self.chance, self.idle)

    async def to_the_game(self) -> None:
        """From the consent page to the first game, without playing it."""
        page = await self.ask("GET", f"/s/{self.study}")
        page = await self.ask("POST", f"/s/{self.study}/consent", page.form)
        while not page.is_game:
            page = await self.submit(page)

    async def walk_on(self) -> str:
        """Play and answer to the end; the completion code."""
        page = await self.ask("GET", f"/s/{self.study}/now")
        while page.code is None:
            if page.is_game:
                await self.game().play()
                page = await self.ask("GET", f"/s/{self.study}/now")
            else:
                page = await self.submit(page)
        self.log.code = page.code
        return page.code

    async def submit(self, page: ClientPage) -> ClientPage:
        after = await self.ask("POST", f"/s/{self.study}/now", page.form)
        self.log.submitted.append(page.form["step"])
        return after

    async def ask(self, method: str, path: str, form: dict[str, str] | None = None) -> ClientPage:
        while True:
            try:
                response = await self.http.request(method, path, data=form)
            except httpx.TransportError:
                await asyncio.sleep(0.1)
                continue
            if response.status_code < 400:
                return ClientPage(response.text)
            assert response.status_code >= 500, f"{method} {path} gives {response.status_code}: {response.text[:300]}"
            self.log.errors.append(response.status_code)
            await asyncio.sleep(0.2)

    async def close(self) -> None:
        await self.http.aclose()
