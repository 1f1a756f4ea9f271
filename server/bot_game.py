"""A simulated participant at the game: speaks the protocol over a real websocket and keeps a journal of all it saw."""

import asyncio
import random
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Final

import msgspec
import numpy as np
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.typing import Origin

from models.planner import PlannerPolicy
from models.protocols import Policy
from overcooked.constants import INTERACT, ITEM_NAMES, STAY
from overcooked.layout import Layout, parse_layout
from overcooked.state import Kitchens
from server.play import messages

_decoder = msgspec.json.Decoder(messages.Outgoing)
_encoder = msgspec.json.Encoder()
MOST_RECONNECTS: Final = 50
_FINAL: Final = frozenset({1008, 4001, 4004})  # close codes after which there is nothing to come back for here


@dataclass
class Journal:
    """What one participant sent and saw, to be held against the database afterwards."""

    inputs: list[tuple[str, int, int | None]] = field(default_factory=list)  # episode, seq, tap
    states: dict[tuple[str, int], str] = field(default_factory=dict)  # (episode, timestep) -> hash of the state seen
    ended: dict[str, dict[str, Any]] = field(default_factory=dict)  # episode -> its Ended message
    pages: list[str] = field(default_factory=list)  # step keys in the order in which they were shown
    violations: list[str] = field(default_factory=list)
    reconnects: int = 0
    code: str | None = None


class Kitchen:
    """The game as the protocol tells it, turned back into arrays: what a chef sees, and the state's hash."""

    def __init__(self, welcome: messages.Welcome) -> None:
        self.layout: Layout = parse_layout("\n".join(welcome.grid), welcome.layout)
        self.seat, self.horizon = welcome.seat, welcome.horizon
        self._state = Kitchens.start(self.layout)

    def show(self, state: messages.Kitchen) -> str:
        """Takes a state in; its hash."""
        self._state.restore(
            {
                "t": state.t,
                "p": [(x, y, facing, ITEM_NAMES[held]) for x, y, facing, held in state.players],
                "c": [(x, y, ITEM_NAMES[item]) for x, y, item in state.counters],
                "pots": state.pots,
            }
        )
        return self._state.hash()

    def decide(self, policy: Policy) -> int:
        """What a cook with this policy would do now."""
        seen = self._state.encode(horizon=self.horizon)[:, max(0, self.seat)]
        return int(np.argmax(policy.probabilities(seen)[0]))


class BotGame:
    """Plays whatever game the participant's current step is. One object a game page."""

    def __init__(self, url: str, cookie: str, journal: Journal, chance: random.Random, idle: float = 0.1) -> None:
        """`url`: ws://host/s/study/socket; `idle`: the share of timesteps in which the bot does nothing."""
        self.url, self.cookie = url, cookie
        self._journal, self._chance, self._idle = journal, chance, idle
        self._origin = "http" + url.removeprefix("ws").split("/s/")[0]
        self._policy: Policy = PlannerPolicy()
        self._tab = f"bot-{chance.getrandbits(64):016x}"
        self._kitchen: Kitchen | None = None
        self._episode = ""
        self._seq = 0
        self._lesson = ""

    async def play(self) -> messages.Ended | None:
        """Until the episode is over, across lost connections; None if there is no game to be played here."""
        for attempt in range(MOST_RECONNECTS):
            try:
                headers = {"Cookie": self.cookie}
                origin = Origin(self._origin)
                async with connect(self.url, additional_headers=headers, origin=origin, compression=None) as socket:
                    return await self._talk(socket)
            except ConnectionClosed as closed:
                if closed.rcvd is not None and closed.rcvd.code in _FINAL:
                    return None
            except (InvalidHandshake, OSError, TimeoutError):
                pass  # the server is away: again
            self._journal.reconnects += 1
            await asyncio.sleep(min(1.0, 0.05 * 2**attempt) * self._chance.uniform(0.5, 1.0))
        raise ConnectionError(f"{self.url}: no game after {MOST_RECONNECTS} tries")

    async def _talk(self, socket: ClientConnection) -> messages.Ended:
        """Until the episode is over. Raises ConnectionClosed."""
        await self._send(socket, messages.Hello(messages.PROTOCOL, self._tab))
        while True:
            message: messages.Outgoing = _decoder.decode(await socket.recv())
            if isinstance(message, messages.Ended):
                self._journal.ended[self._episode] = asdict_of(message)
                return message
            with suppress(ConnectionClosed):  # what the server said before it closed is still to be read
                await self._answer(socket, message)

    async def _answer(self, socket: ClientConnection, message: messages.Outgoing) -> None:
        match message:
            case messages.Welcome():
                self._kitchen, self._episode = Kitchen(message), message.episode
                self._saw(message.state)
                await self._send(socket, messages.Ready())
            case messages.Tick():
                self._saw(message.state)
                await self._act(socket)
            case messages.Paused(reason=reason) if reason not in ("database", "researcher", "partner"):
                await self._send(socket, messages.Ready())
            case messages.Lesson():
                self._lesson = "" if message.done else message.key
            case messages.Ping():
                await self._send(socket, messages.Pong(message.id))
            case messages.Refused(code="bad_message"):
                self._journal.violations.append(f"refused: {message.reason}")

    def _saw(self, state: messages.Kitchen) -> None:
        """A state never changes once it was shown."""
        if self._kitchen is None:
            return self._journal.violations.append("a state came before the welcome")
        seen = self._kitchen.show(state)
        place = (self._episode, state.t)
        if self._journal.states.setdefault(place, seen) != seen:
            self._journal.violations.append(f"episode {self._episode} timestep {state.t} was shown in two ways")

    async def _act(self, socket: ClientConnection) -> None:
        if self._kitchen is None or self._kitchen.seat < 0 or self._chance.random() < self._idle:
            return
        action = INTERACT if self._lesson == "marks" else self._kitchen.decide(self._policy)
        if action != STAY:
            self._seq += 1
            self._journal.inputs.append((self._episode, self._seq, action))
            await self._send(socket, messages.Input(self._seq, None, action, float(self._seq)))

    @staticmethod
    async def _send(socket: ClientConnection, message: messages.Incoming) -> None:
        await socket.send(_encoder.encode(message).decode())


def asdict_of(message: messages.Outgoing) -> dict[str, Any]:
    return {name: getattr(message, name) for name in message.__struct_fields__}
