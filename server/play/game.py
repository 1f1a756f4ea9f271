"""A session with its players: connections, messages to them, and records to store."""

from collections.abc import Callable
from datetime import datetime
from typing import Protocol, cast

from msgspec import structs

from server.play import messages
from server.play.clock import Clock
from server.play.close_codes import CloseCode
from server.play.messages import Outgoing
from server.play.pause_reasons import Holder
from server.play.recorder import EpisodeResult, PauseRecord, Recorder, TickRecord
from server.play.retrying_writer import RetryingWriter
from server.play.session import COUNTDOWN_S, Session


class Connection(Protocol):
    """One socket of one participant, as the game sees it. Its methods return at once."""

    tab: str
    is_new_page: bool  # it has no state of the game yet and counts its inputs from the start
    next_url: str  # where the participant continues after the episode

    def send(self, message: Outgoing) -> None: ...

    def close(self, code: int, reason: str) -> None: ...


class Game:
    """One running episode. Its methods return at once; `loop` does the slow work."""

    def __init__(
        self,
        session: Session,
        clock: Clock,
        recorder: Recorder,
        start: Callable[["Game"], None],
        stop: Callable[["Game"], None],
    ) -> None:
        """`start` is called when no reason to pause is left, `stop` when there is one."""
        self.session = session
        self.clock = clock
        self.retrying_writer = RetryingWriter(recorder, clock)
        self.connections: dict[int, Connection] = {}
        self.busy = False  # a state is being made or stored: no other may be begun
        self.unstored: TickRecord | None = None  # the database did not take it yet
        self.idle_since = clock.now()
        self._start, self._stop = start, stop
        self._lesson: messages.Lesson | None = None

    @property
    def episode(self) -> str:
        return self.session.episode

    # Participants

    def join(self, person: int, connection: Connection) -> None:
        """Handle a page's Hello. The newest connection of a person plays; the one before gets `superseded` and is
        closed."""
        before = self.connections.get(person)
        if before is not connection:
            if before is not None:
                other_tab = before.tab != connection.tab
                self._dismiss(before)
                self.pause(person, "other_tab" if other_tab else "lost")
            self.connections[person] = connection
            if person in self.session.keys:
                self.session.keys[person].page(connection.tab, connection.is_new_page)
        connection.send(self._welcome(person))
        self._lesson = None
        self._teach()
        self._tell_paused(person, connection)

    def leave(self, person: int, connection: Connection) -> None:
        """Handle a closed socket. Nothing happens if another one has taken over."""
        if self.connections.get(person) is connection:
            del self.connections[person]
            self.idle_since = self.clock.now()
            self.pause(person, "lost")

    def receive(self, person: int, connection: Connection, message: messages.Incoming) -> None:
        """Handle a message; one from a connection that was taken over has no effect."""
        if self.connections.get(person) is not connection:
            return
        match message:
            case messages.Input():
                if person in self.session.keys:
                    unix_ms = self.clock.unix_ms()
                    self.session.key(person, message, self.clock.now(), connection.tab, unix_ms)
            case messages.Ready():
                self._ready(person, connection)
            case messages.Away():
                self.pause(person, message.reason)
            case _:
                connection.send(messages.Refused("not_now", "this message means nothing in a game"))

    def _ready(self, person: int, connection: Connection) -> None:
        if self.session.moving or self.session.phase == "ended":
            connection.send(messages.Refused("not_now", "the game is running already"))
            return
        self.release(person)
        self.session.expect_others(person, self.clock.now())
        self.tell_paused()

    def dismiss_all(self) -> None:
        """Close all connections, because the game continues in another process."""
        for connection in self.connections.values():
            self._dismiss(connection)
        self.connections.clear()

    @staticmethod
    def _dismiss(connection: Connection) -> None:
        connection.send(messages.Superseded())
        connection.close(CloseCode.SUPERSEDED, "another tab has taken over")

    # Pausing and resuming

    def pause(self, holder: Holder, reason: str) -> None:
        """Pause at once. A state that is being made is still stored and shown."""
        record = self.session.pause(holder, reason, self.clock.now(), self.clock.wall())
        if not self.session.moving:
            self._stop(self)
        if record is not None:
            self.store(record)
        if not self.busy:
            self.tell_paused()

    def interrupted(self, since: datetime | None) -> None:
        """Mark a game from the database as paused since `since` (None: unknown, so since now)."""
        now, session = self.clock.wall(), self.session
        since = min(since or now, now)  # the wall clock may have been set back
        session.paused_since -= (now - since).total_seconds() * self.clock.speed
        session.pause_record = PauseRecord(self.episode, session.simulation.timestep, "server", since, None)
        self.store(session.pause_record)

    def release(self, holder: Holder) -> None:
        if self.session.release(holder, self.clock.now()):
            self._start(self)

    def store(self, record: PauseRecord | None) -> None:
        if record is not None:
            self.retrying_writer.pause(record)

    def store_inputs(self) -> None:
        """Store inputs that arrived while the game is paused: there may be no next record."""
        if records := self.session.settled_inputs():
            self.retrying_writer.inputs(self.episode, records)

    # Messages to participants

    def broadcast(self, message: Outgoing) -> None:
        for connection in self.connections.values():
            connection.send(message)

    def _welcome(self, person: int) -> messages.Welcome:
        """Return the welcome message. The page uses real time, so with a faster game clock its timesteps are
        shorter."""
        welcome = self.session.welcome(person)
        tick_ms = max(1, round(welcome.tick_ms / self.clock.speed))
        return structs.replace(welcome, tick_ms=tick_ms, away_s=self._next_absence_s())

    def _next_absence_s(self) -> float:
        """Return how long an absence that begins now may last, in the time of the page. Never 0, which tells
        nothing."""
        left_s = self.session.pause_reasons.next_absence_s(self.clock.now())
        return max(0.1, round(left_s / self.clock.speed, 1))

    def _paused(self, person: int) -> messages.Paused:
        paused = self.session.paused(person, self.clock.now())
        left_s = max(0.1, round(paused.left_s / self.clock.speed, 1)) if paused.left_s else 0.0
        return structs.replace(paused, left_s=left_s)

    def tell_countdown(self, seconds: float = COUNTDOWN_S) -> None:
        self.broadcast(messages.Countdown(round(seconds / self.clock.speed, 3), self._next_absence_s()))

    def tell_paused(self) -> None:
        for person, connection in self.connections.items():
            self._tell_paused(person, connection)

    def _tell_paused(self, person: int, connection: Connection) -> None:
        """Tell a person why the game is paused, or does not start: others are awaited, or the person is."""
        session = self.session
        is_awaited = session.phase == "waiting" and session.pause_reasons.is_away(person)
        if session.phase == "paused" or is_awaited or session.keeps_waiting(person):
            connection.send(self._paused(person))

    def show(self) -> None:
        """Send the stored state."""
        for person, connection in self.connections.items():
            connection.send(self.session.tick_message(person))
        self._teach()

    def _teach(self) -> None:
        """Send the current lesson whenever it changes."""
        lesson = self.session.lesson()
        if lesson is not None and lesson != self._lesson:
            self._lesson = lesson
            self.broadcast(lesson)

    def tell_end(self, result: EpisodeResult) -> None:
        """Tell everybody that the episode is over and stored."""
        for connection in self.connections.values():
            figures = (result.score, result.soups, result.progress, result.passed)
            reason = cast(messages.EndReason, result.reason)
            connection.send(messages.Ended(*figures, connection.next_url, reason))
            connection.close(CloseCode.FINISHED, "the episode is over")
