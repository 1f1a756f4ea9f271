"""Limits on connections: the time to send a complete request, the number of connections (those of games are kept), and
the amount read at a time, so that no client delays the others. The messages of game sockets are handled in
server.web.participant.game_socket.
"""

import asyncio
import logging
import resource
from typing import Any, ClassVar, Final
from weakref import WeakKeyDictionary

from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from uvicorn.server import ServerState
from websockets.frames import Frame, apply_mask  # type: ignore[attr-defined] # the compiled mask where there is one
from websockets.http11 import Request
from websockets.protocol import State

from server.play.close_codes import CloseCode
from server.play.token_bucket import TokenBucket
from server.web.participant.direct_frames import EXTENSION, DirectFrames

log = logging.getLogger(__name__)
REQUEST_TIMEOUT_S = 10.0  # from the first byte (or none) of a request to the end of its headers
_RESERVED_DESCRIPTORS: Final = 128  # descriptors: database, models, files that are being sent
_WANTED: Final = 65_536
_READ_BYTES: Final = 2048  # two of the longest messages, or some thirty usual ones
_AFTER_CLOSE_EVERY_S: Final = 0.02  # bytes still read after that, as the peer's own close may follow
_TEXT, _PING, _PONG = 0x81, 0x89, 0x8A  # the first byte of a frame in one piece
_TWO_MORE_BYTES: Final = 126  # in the place of a size: it follows in two bytes
_MASKED: Final = 0x80  # added to the size in a browser's frames
_TO_MASK, _TO_TEXT = 2, 6  # where mask and text of a browser's short frame begin
_MAX_DIRECT: Final = 0xFFFF
_FULL: Final = b"HTTP/1.1 503 Service Unavailable\r\nRetry-After: 5\r\nConnection: close\r\nContent-Length: 0\r\n\r\n"


def most_connections() -> int:
    """Return the number of descriptors, less those that the server itself needs."""
    return max(16, resource.getrlimit(resource.RLIMIT_NOFILE)[0] - _RESERVED_DESCRIPTORS)


def raise_descriptor_limit() -> None:
    """Raise the usual limit of 1024 descriptors, which is meant for desktops, to the system's own limit."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = _WANTED if hard == resource.RLIM_INFINITY else min(hard, _WANTED)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


class PatientProtocol(H11Protocol):
    """uvicorn's HTTP connection with a time limit; uvicorn itself would wait forever for a request to be finished.

    When all places are taken, the connection that has been silent longest is closed; if none is silent, the newcomer
    gets a 503.
    """

    # By server: connections without a complete request, oldest first.
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
        self._patience = self.loop.call_later(REQUEST_TIMEOUT_S, self.transport.abort)

    def _heard(self) -> None:
        self._mates.pop(self, None)
        if self._patience is not None:
            self._patience.cancel()
            self._patience = None

    def _make_room(self) -> bool:
        oldest = next(iter(self._mates), None)
        if oldest is None:
            log.warning("all %d connections are in use: a new one is refused", most_connections())
            return False
        oldest.transport.abort()
        oldest._heard()
        self.connections.discard(oldest)
        return True


class QuietProtocol(WebSocketsSansIOProtocol):
    """uvicorn's websocket with `DirectFrames` for the application, with a limit on frames that are not messages
    (pings, pongs, pieces of a message without an end), and without a traceback in the log for
    text that is not UTF-8."""

    def __init__(self, **parts: Any) -> None:
        super().__init__(**parts)
        self._direct = DirectFrames(self._write_now)
        self._no_messages = TokenBucket(self.loop.time())  # what browsers hardly ever send has the limits of messages
        self._reads_directly = True  # all that `conn` has been given so far ends with a frame

    def handle_connect(self, event: Request) -> None:
        super().handle_connect(event)
        if not self.close_sent:
            extensions: dict[str, Any] = self.scope["extensions"]
            extensions[EXTENSION] = self._direct

    def handle_ping(self) -> None:
        if self._is_let_in():
            super().handle_ping()

    def handle_pong(self, event: Frame) -> None:
        if self._is_let_in():
            super().handle_pong(event)

    def handle_cont(self, event: Frame) -> None:
        if self._is_let_in():
            super().handle_cont(event)

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
                return self._close(CloseCode.NOT_UTF8, "a text frame is UTF-8")
            if self.queue.empty() and self._direct.take(text):
                self.frames = []
                return None
        return super().send_receive_event_to_app()

    def _is_let_in(self) -> bool:
        """Return whether a frame that is not a whole message is accepted; too many of them close the socket."""
        if self.close_sent:
            return False
        if not self._no_messages.spend(self.loop.time()):
            self._close(CloseCode.REFUSED, "too many control frames or pieces of messages")
            return False
        return True

    def _close(self, code: CloseCode, reason: str) -> None:
        """Close as for the application, which is told; nothing if the peer has closed already."""
        if self.conn.state is not State.OPEN:
            return
        self.queue.put_nowait({"type": "websocket.disconnect", "code": code, "reason": reason})
        self.conn.send_close(code, reason)
        self.transport.write(b"".join(self.conn.data_to_send()))
        self.close_sent = True
        self.close_timer = self.loop.call_later(self.close_timeout, self.transport.close)

    def _write_now(self, text: bytes) -> bool:
        if not self.writable.is_set() or self.transport.is_closing() or self.conn.state is not State.OPEN:
            return False
        size = len(text)
        if size > _MAX_DIRECT:
            return False
        # An unmasked text frame in one piece (RFC 6455, 5.2), by hand: through `conn` it costs three times as much.
        head = bytes((_TEXT, size)) if size < _TWO_MORE_BYTES else bytes((_TEXT, _TWO_MORE_BYTES)) + size.to_bytes(2)
        self.transport.write(head + text)
        return True


def _end_of_short_frame(data: bytes, begin: int) -> int:
    """Return where the frame that begins here ends, if it is a text, ping or pong in one piece of less than 126 bytes,
    masked as a browser's are (RFC 6455, 5.2), and all there; otherwise 0."""
    if len(data) < begin + _TO_TEXT or data[begin] not in (_TEXT, _PING, _PONG):
        return 0
    size = data[begin + 1] - _MASKED
    end = begin + _TO_TEXT + size
    return end if 0 <= size < _TWO_MORE_BYTES and end <= len(data) else 0


class SparingProtocol(asyncio.BufferedProtocol):
    """uvicorn's websocket, reading small amounts at a time. uvicorn itself parses a quarter of a megabyte at once, and
    continues after it has closed: every other game would wait for the thousands of messages of one flood."""

    def __init__(self, **parts: Any) -> None:
        self._websocket = QuietProtocol(**parts)
        self._buffer = bytearray(_READ_BYTES)

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
        """Handle the request of the handshake, which the HTTP protocol has read."""
        self._websocket.data_received(data)

    def get_buffer(self, _sizehint: int) -> bytearray:
        return self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        self._websocket.data_received(bytes(self._buffer[:nbytes]))
        transport = self._websocket.transport
        if self._websocket.close_sent and not transport.is_closing():
            transport.pause_reading()
            self._websocket.loop.call_later(_AFTER_CLOSE_EVERY_S, transport.resume_reading)
