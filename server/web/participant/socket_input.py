"""Input of one game socket: check frames, and handle at once those that need no waiting."""

import logging
import time
from typing import TYPE_CHECKING, Any, Final

from fastapi import WebSocket

from server.play import messages
from server.play.clock import Clock
from server.play.close_codes import CloseCode
from server.play.game import Game
from server.play.token_bucket import PER_S, TokenBucket

if TYPE_CHECKING:
    from server.web.participant.game_socket import PlayerSocket

log = logging.getLogger(__name__)
MAX_REFUSED: Final = 20  # bad messages on one socket
UNBOUNDED_PER_S: Final = 1e9
_DIRECT: Final = ('{"type":"input"', '{"type":"pong"')  # as browsers write them; others are decoded by the slower path


class Gate:
    """Checks one socket's frames: text, small, well formed, not too many."""

    def __init__(self, bucket: TokenBucket) -> None:
        self._bucket = bucket
        self._refused = 0

    def let_in(self, text: str | None, mine: "PlayerSocket", now: float) -> messages.Incoming | None:
        """Return the message of a frame; None when it was refused, answered here, or the socket is to close."""
        if text is None:
            mine.close(CloseCode.NOT_TEXT, "this protocol has text frames only")
            return None
        if len(text) > messages.MAX_FRAME_BYTES or len(text.encode()) > messages.MAX_FRAME_BYTES:
            mine.close(CloseCode.TOO_LARGE, f"a frame has at most {messages.MAX_FRAME_BYTES} bytes")
            return None
        try:
            message = messages.decode(text)
        except messages.BadMessage as error:
            self._refuse(str(error), mine, now)
            return None
        if isinstance(message, messages.Pong) and mine.send_queue.pong(message.id, time.monotonic()):
            return None
        if not self._bucket.spend(now):
            mine.close(CloseCode.REFUSED, "too many messages")
            return None
        return message

    def _refuse(self, reason: str, mine: "PlayerSocket", now: float) -> None:
        self._refused += 1
        if self._refused > MAX_REFUSED or not self._bucket.spend(now):
            mine.close(CloseCode.REFUSED, "too many bad messages")
        else:
            mine.send(messages.Refused("bad_message", reason))


class DirectInput:
    """Handles a page's keys and Pongs at the moment when they arrive."""

    def __init__(self, gate: Gate, mine: "PlayerSocket", clock: Clock) -> None:
        self.game: Game | None = None  # the game that the socket is in
        self._gate, self._mine, self._clock = gate, mine, clock
        self._reader_waits = False  # no earlier message is being handled

    async def receive(self, socket: WebSocket) -> Any:
        """Return the next event that `take` has left."""
        self._reader_waits = True
        event = await socket.receive()
        self._reader_waits = False
        return event

    def take(self, text: str) -> bool:
        """Return whether the frame was handled here; the others are the reader's."""
        if not (self._reader_waits and self.game is not None and text.startswith(_DIRECT)):
            return False
        if self._mine.send_queue.closing:
            return False
        try:
            message = self._gate.let_in(text, self._mine, self._clock.now())
            if message is not None and not isinstance(message, messages.Pong):
                self.game.receive(self._mine.player.seat, self._mine, message)
        except Exception:
            log.exception("a game socket failed")
            self._mine.close(CloseCode.FAILED, "the server failed")
        return True


def bucket_of(clock: Clock) -> TokenBucket:
    """Return the rate limit of one participant. If games wait for simulated participants, there is none: these are as
    fast as the machine."""
    return TokenBucket(clock.now(), clock.speed, per_s=UNBOUNDED_PER_S if clock.patience_s else PER_S)
