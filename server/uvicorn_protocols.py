"""What a connection has to do to be kept: say something whole soon. How many there may be: games keep theirs. And how
much of one is read at a time: nobody holds the others up.

Knows the outermost layer only; what a game's socket says is for server.web.participant.game_socket.
"""

import asyncio
import logging
import resource
from typing import Any, ClassVar, Final
from weakref import WeakKeyDictionary

from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from uvicorn.server import ServerState
from websockets.frames import apply_mask  # type: ignore[attr-defined] # the compiled one where there is one
from websockets.http11 import Request
from websockets.protocol import State

from server.play.close_codes import CloseCode
from server.web.participant.direct_frames import EXTENSION, DirectFrames

log = logging.getLogger(__name__)
SAY_SOMETHING_WITHIN_S = 10.0  # from the first byte (or none) of a request to the end of its headers
_FOR_OURSELVES: Final = 128  # descriptors: database, models, files that are being sent
_WANTED: Final = 65_536
_MOUTHFUL_BYTES: Final = 2048  # two of the longest messages there are, or some thirty usual ones
_AFTER_CLOSE_EVERY_S: Final = 0.02  # a mouthful of what still comes then: the peer's own close may be behind it
_TEXT, _PING, _PONG = 0x81, 0x89, 0x8A  # the first byte of a frame in one piece
_TWO_MORE_BYTES: Final = 126  # in the place of a size: it follows in two bytes
_MASKED: Final = 0x80  # added to the size in a browser's frames
_TO_MASK, _TO_TEXT = 2, 6  # where mask and text of a browser's short frame begin
_LARGEST_DIRECT: Final = 0xFFFF
_FULL: Final = b"HTTP/1.1 503 Service Unavailable\r\nRetry-After: 5\r\nConnection: close\r\nContent-Length: 0\r\n\r\n"


def most_connections() -> int:
    """As many as there are descriptors, less what the server itself needs."""
    return max(16, resource.getrlimit(resource.RLIMIT_NOFILE)[0] - _FOR_OURSELVES)


def raise_descriptor_limit() -> None:
    """The usual limit of 1024 descriptors is for desktops; the system's own limit stays."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = _WANTED if hard == resource.RLIM_INFINITY else min(hard, _WANTED)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


class PatientProtocol(H11Protocol):
    """uvicorn's HTTP connection, which by itself would wait for ever for a request to be finished.

    When all places are taken, the connection that has been silent longest is closed; if none is silent, the newcomer
    gets a 503.
    """

    # By server: who has not said anything whole, oldest first.
    _silent: ClassVar["WeakKeyDictionary[ServerState, dict[PatientProtocol, None]]"] = WeakKeyDictionary()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)  # type: ignore[arg-type]
        self._patience: asyncio.TimerHandle | None = None
        self._mates = self._silent.setdefault(self.server_state, {})
        if len(self.connections) > most_connections() and not self._make_room():
            self.transport.write(_FULL)
            self.transport.close()
        self._wait()

    def data_received(self, data: bytes) -> None:
        before = self.scope
        if self._patience is None and (self.cycle is None or self.cycle.response_complete):
            self._wait()  # the first bytes of another request on the same connection
        super().data_received(data)
        if self.scope is not before:
            self._heard()

    def connection_lost(self, exc: Exception | None) -> None:
        self._heard()
        super().connection_lost(exc)

    def _wait(self) -> None:
        self._mates[self] = None
        self._patience = self.loop.call_later(SAY_SOMETHING_WITHIN_S, self.transport.abort)

    def _heard(self) -> None:
        self._mates.pop(self, None)
        if self._patience is not None:
            self._patience.cancel()
            self._patience = None

    def _make_room(self) -> bool:
        oldest = next(iter(self._mates), None)
        if oldest is None:
            log.warning("all %d connections are taken: a newcomer is sent away", most_connections())
            return False
        oldest.transport.abort()
        oldest._heard()
        self.connections.discard(oldest)
        return True


class QuietProtocol(WebSocketsSansIOProtocol):
    """uvicorn's websocket, which by itself writes a traceback into the log for every text frame that is not UTF-8. And
    with `DirectFrames` for the application."""

    def __init__(self, **parts: Any) -> None:
        super().__init__(**parts)
        self._direct = DirectFrames(self._write_now)
        self._reads_directly = True  # all that `conn` has been given so far ends with a frame

    def handle_connect(self, event: Request) -> None:
        super().handle_connect(event)
        if not self.close_sent:
            extensions: dict[str, Any] = self.scope["extensions"]
            extensions[EXTENSION] = self._direct

    def data_received(self, data: bytes) -> None:
        if self._reads_directly and self.conn.state is State.OPEN:
            data = self._read_directly(data)
        if data:
            super().data_received(data)

    def _read_directly(self, data: bytes) -> bytes:
        """Take short texts, which is all that a page sends in a game; through `conn` each costs three times as much.
        Returns what is left from the first frame on that is not short: from there on, `conn` reads everything."""
        begin = 0
        while begin < len(data) and self.conn.state is State.OPEN:
            end = _end_of_short_frame(data, begin)
            if not end:
                self._reads_directly = False
                break
            if not self._take_now(data, begin, end):
                super().data_received(data[begin:end])
            begin = end
        return data[begin:]

    def _take_now(self, data: bytes, begin: int, end: int) -> bool:
        if data[begin] != _TEXT or self.close_sent or not self.queue.empty():
            return False
        try:
            text = apply_mask(data[begin + _TO_TEXT : end], data[begin + _TO_MASK : begin + _TO_TEXT]).decode()
        except UnicodeDecodeError:
            return False
        return self._direct.take(text)

    def send_receive_event_to_app(self) -> None:
        if self.curr_msg_data_type == "text" and not self.close_sent:
            try:
                text = b"".join(self.frames).decode()
            except UnicodeDecodeError:
                log.info("a websocket sent a text frame that is not UTF-8: it is closed with 1007")
                self.frames = []
                self.conn.send_close(CloseCode.NOT_UTF8, "a text frame is UTF-8")
                return self.handle_parser_exception()
            if self.queue.empty() and self._direct.take(text):
                self.frames = []
                return None
        return super().send_receive_event_to_app()

    def _write_now(self, text: bytes) -> bool:
        if not self.writable.is_set() or self.transport.is_closing() or self.conn.state is not State.OPEN:
            return False
        size = len(text)
        if size > _LARGEST_DIRECT:
            return False
        # An unmasked text frame in one piece (RFC 6455, 5.2), by hand: through `conn` it costs three times as much.
        head = bytes((_TEXT, size)) if size < _TWO_MORE_BYTES else bytes((_TEXT, _TWO_MORE_BYTES)) + size.to_bytes(2)
        self.transport.write(head + text)
        return True


def _end_of_short_frame(data: bytes, begin: int) -> int:
    """Where the frame that begins here ends, if it is a text, ping or pong in one piece of less than 126 bytes, masked
    as a browser's are (RFC 6455, 5.2), and all there; otherwise 0."""
    if len(data) < begin + _TO_TEXT or data[begin] not in (_TEXT, _PING, _PONG):
        return 0
    size = data[begin + 1] - _MASKED
    end = begin + _TO_TEXT + size
    return end if 0 <= size < _TWO_MORE_BYTES and end <= len(data) else 0


class SparingProtocol(asyncio.BufferedProtocol):
    """uvicorn's websocket, which by itself takes in and parses a quarter of a megabyte at once, and continues with all
    that comes after it has closed: thousands of messages of one flood, for which every other game would wait."""

    def __init__(self, **parts: Any) -> None:
        self._websocket = QuietProtocol(**parts)
        self._buffer = bytearray(_MOUTHFUL_BYTES)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._websocket.connection_made(transport)

    def connection_lost(self, exc: Exception | None) -> None:
        self._websocket.connection_lost(exc)

    def eof_received(self) -> None:
        self._websocket.eof_received()

    def pause_writing(self) -> None:
        self._websocket.pause_writing()

    def resume_writing(self) -> None:
        self._websocket.resume_writing()

    def data_received(self, data: bytes) -> None:
        """The request of the handshake, which HTTP has read."""
        self._websocket.data_received(data)

    def get_buffer(self, _sizehint: int) -> bytearray:
        return self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        self._websocket.data_received(bytes(self._buffer[:nbytes]))
        transport = self._websocket.transport
        if self._websocket.close_sent and not transport.is_closing():
            transport.pause_reading()
            self._websocket.loop.call_later(_AFTER_CLOSE_EVERY_S, transport.resume_reading)
