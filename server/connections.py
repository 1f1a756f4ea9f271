"""What a connection has to do to be kept: say something whole soon. And how many there may be: games keep theirs.

Knows HTTP's outermost layer only; once a connection has become a game's socket, server.web.socket looks after it.
"""

import asyncio
import logging
import resource
from typing import ClassVar, Final
from weakref import WeakKeyDictionary

from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.server import ServerState

log = logging.getLogger(__name__)
SAY_SOMETHING_WITHIN_S = 10.0  # from the first byte (or none) of a request to the end of its headers
_FOR_OURSELVES: Final = 128  # descriptors: database, models, files that are being sent
_WANTED: Final = 65_536
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

    When all places are taken, whoever has been silent longest makes room; if nobody is silent, the newcomer gets a 503.
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
