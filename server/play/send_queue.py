"""The bounded queue of messages to one browser, in which a new state replaces an older one; also its heartbeat."""

import asyncio
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from server.play.close_codes import CloseCode
from server.play.messages import Outgoing, Ping, Tick, encode

PING_EVERY_S: Final = 1.0
SLOW_AFTER_S: Final = 0.5  # an unanswered Ping this old: the reader is behind, only the newest state is sent
DEAD_AFTER_S: Final = 4.5  # an unanswered Ping this old: the connection is lost
_MAX_WAITING: Final = 16  # messages other than states


@dataclass(frozen=True)
class Close:
    """The last thing to be sent: the socket closes."""

    code: int
    reason: str


class SendQueue:
    """Takes messages without waiting; a writer task fetches them one by one.

    At most one state waits: a newer one takes its place at the end of the line. Times are real seconds. A message that
    nothing is in front of does not wait for the task if `write_now` can send it; it returns whether it did.
    """

    def __init__(self, write_now: Callable[[bytes], bool] = lambda _: False) -> None:
        self._write_now = write_now
        self._idle = False  # the writer task has sent everything and waits
        self._line: deque[tuple[bool, bytes]] = deque()  # (is it a state?, frame)
        self._filled = asyncio.Event()
        self._end: Close | None = None
        self._ping_id = 0
        self._pinged_at: float | None = None  # of the Ping that is not answered yet
        self._next_ping = 0.0
        self._slow = False
        self.rtt_ms: float | None = None
        self.dropped = 0  # states that a newer one replaced

    @property
    def closing(self) -> bool:
        return self._end is not None

    def send(self, message: Outgoing) -> None:
        """Queue a message; after `close`, messages are dropped."""
        if self._end is not None:
            return
        is_state, frame = isinstance(message, Tick), encode(message)
        if self._idle and not self._line and not (is_state and self._slow) and self._write_now(frame):
            return
        if is_state:
            waiting = len(self._line)
            self._line = deque(entry for entry in self._line if not entry[0])
            self.dropped += waiting - len(self._line)
        elif len(self._line) >= _MAX_WAITING:
            self.close(CloseCode.REFUSED, "too far behind")
            return
        self._line.append((is_state, frame))
        self._wake()

    def close(self, code: int, reason: str) -> None:
        """Send the waiting messages, then close the socket."""
        if self._end is None:
            self._end = Close(code, reason)
            self._slow = False
            self._wake()

    def drop(self) -> None:
        """Drop all waiting messages: the socket is gone."""
        self._line.clear()
        self._end = self._end or Close(CloseCode.SILENT, "gone")
        self._wake()

    async def next(self) -> bytes | Close:
        """Return the next frame, as soon as there is one; Close at the end."""
        while True:
            if self._line and not (self._slow and self._line[0][0]):
                self._idle = False
                return self._line.popleft()[1]
            if not self._line and self._end is not None:
                return self._end
            self._filled.clear()
            self._idle = True
            await self._filled.wait()

    def beat(self, now: float) -> bool:
        """Send Pings and detect slow readers; call it several times a second. Returns True if the connection is
        lost."""
        if self._pinged_at is not None:
            age_s = now - self._pinged_at
            self._slow = age_s > SLOW_AFTER_S and self._end is None
            return age_s > DEAD_AFTER_S
        if now >= self._next_ping and self._end is None:
            self._ping_id += 1
            self._pinged_at, self._next_ping = now, now + PING_EVERY_S
            self.send(Ping(self._ping_id))
        return False

    def pong(self, ping_id: int, now: float) -> bool:
        """Handle a Pong; return False if it answers no Ping."""
        if self._pinged_at is None or ping_id != self._ping_id:
            return False
        self.rtt_ms = (now - self._pinged_at) * 1000
        self._pinged_at = None
        if self._slow:
            self._slow, self._next_ping = False, now
            self._wake()
        return True

    def _wake(self) -> None:
        self._filled.set()
