"""A simulated participant at the game: plays over a real websocket and keeps a journal of everything it saw."""

import asyncio
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Final, Literal

from websockets.asyncio.client import ClientConnection
from websockets.exceptions import ConnectionClosed

from kitchenmind.client.game_client import GameClient, SocketLeft
from overcooked.constants import STAY
from server.bots.cook import Cook, Impression, Traits, layouts_without_human_bc
from server.bots.foresight.cook import cook
from server.bots.partner_memory import PartnerMemory
from server.play import intentions, messages
from server.play.close_codes import CloseCode
from server.play.marks import NOTHING_SHOWN, is_as_required
from server.study.order import derived_seed

PARTLY_SEEN: Final = ""  # in place of the hash of a state that the participant saw only in part
LOOKS_FOR: Final = 5  # timesteps for which the marks key is down, and up
BrowserFault = Literal["reload", "second_tab", "half_open"]


@dataclass
class Journal:
    """What one participant sent and saw, to be compared with the database afterwards."""

    inputs: list[tuple[str, int, int]] = field(default_factory=list)  # episode, timestep seen, action
    states: dict[tuple[str, int], str] = field(default_factory=dict)  # (episode, timestep) -> hash of the state seen
    ended: dict[str, dict[str, Any]] = field(default_factory=dict)  # episode -> its Ended message
    pages: list[str] = field(default_factory=list)  # step keys in the order in which they were shown
    answers: list[tuple[str, dict[str, Any]]] = field(default_factory=list)  # step key, what was sent
    games: dict[str, messages.Welcome] = field(default_factory=dict)  # episode -> how it was introduced
    impressions: list[Impression] = field(default_factory=list)  # of the episodes played to their end
    broken_displays: dict[str, set[int]] = field(default_factory=dict)  # episode -> timesteps not shown as required
    late_timesteps: dict[str, set[int]] = field(default_factory=dict)  # of these, where the partner was late
    unanswered: set[tuple[str, int]] = field(default_factory=set)  # (episode, timestep) in which the models were late
    violations: list[str] = field(default_factory=list)
    reconnects: int = 0
    browser_faults: dict[str, int] = field(
        default_factory=dict
    )  # faults caused on purpose: reload, second_tab, half_open
    code: str | None = None

    @property
    def rounds_played(self) -> int:
        """Return how many rounds ended; the practice is none."""
        return sum(self.games[episode].kind == "episode" for episode in self.ended)


class GameDropped(Exception):
    """The participant closed the browser in the middle of a game."""


class BotGame(GameClient):
    """Plays the game of the participant's current step; one object per game page."""

    first_wait_s = 0.05
    longest_wait_s = 1.0

    def __init__(self, url: str, cookie: str, journal: Journal, traits: Traits) -> None:
        """`url`: ws://host/s/study/socket."""
        super().__init__(url, cookie, f"bot-{traits.seed:016x}")
        self.browser_faults: dict[int, BrowserFault] = {}  # by the timestep at which they happen
        self.drop_at: int | None = None  # the timestep at which the browser is closed
        self.violations = journal.violations
        self._journal, self._traits = journal, traits
        self._episode = ""
        self._cook: Cook | None = None
        self._partner: PartnerMemory | None = None  # with limited sight
        self._settling = False  # just counted down: the participant does not press keys yet
        self._left_open: list[asyncio.Task[None]] = []  # sockets that are no longer read

    def lost(self) -> None:
        self._journal.reconnects += 1

    def on_message(self, message: messages.Outgoing) -> None:
        match message:
            case messages.Welcome():
                self._begin(message)
                self._saw(message.state)
            case messages.Countdown():
                self._settling = True
            case messages.Tick():
                self._saw(message.state)
                self._saw_marks(message)
                if message.late and self.welcome is not None:
                    self._journal.unanswered.add((self.welcome.episode, message.state.t))
            case messages.Ended():
                self._over(message)
            case messages.Refused(code="bad_message"):
                self.violations.append(f"refused: {message.reason}")

    def _over(self, ended: messages.Ended) -> None:
        if self.welcome is not None:
            self._journal.ended[self.welcome.episode] = asdict_of(ended)
        if self._cook is not None:
            self._journal.impressions.append(self._cook.impression)

    def _begin(self, welcome: messages.Welcome) -> None:
        if self._episode == welcome.episode or self.kitchen is None:
            return  # back in the same game: its memory continues
        self._episode = welcome.episode
        self._journal.games[welcome.episode] = welcome
        is_clone = self._traits.cook == "clone" and welcome.kind == "episode"
        if is_clone and layouts_without_human_bc([self.kitchen.layout]):
            lacking = f"--cook clone: there is no behaviour-cloned human for {welcome.layout}. Use --cook foresight."
            self.violations.append(lacking)  # it plans instead
        if welcome.seat >= 0:
            seed = derived_seed("bot", welcome.kind, welcome.number)
            self._cook = cook(self.kitchen.layout, welcome.seat, self._traits, seed)
            radius = welcome.view_radius
            self._partner = PartnerMemory(self.kitchen.layout, welcome.seat, radius) if radius else None

    def _saw(self, state: messages.KitchenState) -> None:
        """Note a state; report a violation if it differs from what was shown before."""
        if self.welcome is None:
            return
        place = (self.welcome.episode, state.t)
        if self.welcome.view_radius:
            self._journal.states[place] = PARTLY_SEEN
        elif self._journal.states.setdefault(place, self.state_hash) != self.state_hash:
            self.violations.append(f"episode {place[0]} timestep {state.t} was shown in two ways")

    def _saw_marks(self, tick: messages.Tick) -> None:
        """Note a timestep whose display differs from the welcome message."""
        if self.welcome is None or self.welcome.show != "always" or not tick.partner_seen:
            return  # only the database has the timesteps in which the marks were requested and in view
        display = self.welcome.display if self.welcome.shows_predictions else "none"
        is_kept = is_as_required(display in ("actions", "both"), tick.prediction)
        if not (is_kept and intentions.is_as_required(display in ("intention", "both"), tick.intention)):
            self._journal.broken_displays.setdefault(self.welcome.episode, set()).add(tick.state.t)
            if tick.late:
                self._journal.late_timesteps.setdefault(self.welcome.episode, set()).add(tick.state.t)

    async def before_acting(self, socket: ClientConnection, tick: messages.Tick) -> None:
        """Close the browser or cause a fault at its timestep. Raises GameDropped, SocketLeft, OSError: reconnect."""
        timestep = tick.state.t
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
            self.tab += "x"
            self._left_open.append(asyncio.create_task(self._taken_over(socket)))
            raise SocketLeft
        else:
            self._left_open.append(asyncio.create_task(socket.wait_closed()))
            raise SocketLeft
        raise OSError("the page was loaded again")

    async def _taken_over(self, socket: ClientConnection) -> None:
        """Check that the old tab is told that another one plays now."""
        with suppress(ConnectionClosed):
            async with asyncio.timeout(10):
                async for _ in socket:
                    pass  # further messages to it change nothing
        if socket.close_code not in (CloseCode.SUPERSEDED, CloseCode.LOST):
            self.violations.append(f"a tab that was left closed with {socket.close_code}, not {CloseCode.SUPERSEDED}")

    def chosen(self, tick: messages.Tick) -> int | None:
        """Return the action to send, and note it."""
        action = super().chosen(tick)
        if action is None or self.welcome is None:
            return None
        action, self._settling = (STAY, False) if self._settling else (action, False)
        self._journal.inputs.append((self.welcome.episode, tick.state.t, action))
        return action

    def asks(self, tick: messages.Tick) -> bool | None:
        """Hold the marks key down from time to time, each bot at different times."""
        if self.welcome is None or self.welcome.show == "always":
            return None
        return (tick.state.t + self._traits.seed) % (2 * LOOKS_FOR) < LOOKS_FOR

    def act(self, tick: messages.Tick) -> int | None:
        if self.kitchen is None or self._cook is None or self.welcome is None:
            return None
        about_partner = self.welcome.watched_seat != self.welcome.seat
        shown = [action for action, _ in tick.prediction if about_partner and action != NOTHING_SHOWN]
        now = self.kitchen.now
        if self._partner is not None:
            now = self._partner.complete(now, tick.partner_seen)
        return self._cook.act(now, tick.state.soups, tick.actions, shown, self.welcome.horizon)


def asdict_of(message: messages.Outgoing) -> dict[str, Any]:
    return {name: getattr(message, name) for name in message.__struct_fields__}
