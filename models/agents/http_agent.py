"""An agent behind an HTTP address. Every call has a total time limit and a size limit."""

import http.client
import io
import socket
import ssl
import time
from typing import Any, Final
from urllib.parse import urlsplit

import msgspec
import numpy as np

from models.protocols import BlackBoxError, Observations, Probabilities
from overcooked.constants import ACTIONS
from overcooked.layout import Layout

TIMEOUT_S: Final = 2.0  # of one call, from connecting to the last byte
MAX_ANSWER_BYTES: Final = 1_000_000  # 600 games need less than 100 kB

_MAX_ERROR_BYTES: Final = 10_000  # of an answer with another status than 200
_MAX_ERROR: Final = 200  # characters of its text


class _Answer(msgspec.Struct):
    probabilities: list[list[float]] | None = None
    actions: list[int] | None = None


class _Refusal(msgspec.Struct):
    error: str = ""


def _error_in(body: bytes) -> str:
    """Return the text of {"error": text}, shortened, without its last full stop; "" for any other answer."""
    try:
        return msgspec.json.decode(body, type=_Refusal).error[:_MAX_ERROR].rstrip(".")
    except (msgspec.DecodeError, RecursionError):
        return ""


class HttpAgent:
    """An agent at an address that answers POST {"layout", "grid", "observations": (games, width, height, 26)} with
    {"probabilities": (games, 6)} or {"actions": (games,)}."""

    def __init__(self, url: str, layout: Layout) -> None:
        self._url = url
        parts = urlsplit(url)
        kind = http.client.HTTPSConnection if parts.scheme == "https" else http.client.HTTPConnection
        try:
            self._connection: Any = kind(parts.netloc, timeout=TIMEOUT_S)
        except http.client.HTTPException as error:
            raise BlackBoxError(f"{url} is not an address ({error}). Write http://HOST:PORT/PATH.") from None
        self._path = (parts.path or "/") + (f"?{parts.query}" if parts.query else "")
        self._layout = layout

    def probabilities(self, observations: Observations) -> Probabilities:
        question = {"layout": self._layout.name, "grid": self._layout.grid, "observations": observations.tolist()}
        try:
            return self._read(self._call(msgspec.json.encode(question)), len(observations))
        except BlackBoxError:
            self._connection.close()
            raise
        except (OSError, http.client.HTTPException, msgspec.DecodeError, RecursionError) as error:
            self._connection.close()
            remedy = "Check that it is running at this address."
            raise BlackBoxError(f"{self._url} does not answer as an agent should ({error}). {remedy}") from error

    def close(self) -> None:
        """Close the connection; the next request opens a new one."""
        self._connection.close()

    def _call(self, body: bytes) -> bytes:
        deadline = time.monotonic() + TIMEOUT_S
        is_reused = self._connection.sock is not None
        try:
            return self._exchange(body, deadline)
        except (ConnectionError, ssl.SSLError):
            if not is_reused:
                raise
        # Web servers close a connection that nobody uses for a while, such as between two episodes.
        self._connection.close()
        return self._exchange(body, deadline)

    def _exchange(self, body: bytes, deadline: float) -> bytes:
        if self._connection.sock is None:
            self._connection.connect()
            plain: Any = self._connection.sock
            self._connection.sock = _TimedSocket(plain)
        self._connection.sock.deadline = deadline
        self._connection.request("POST", self._path, body, {"Content-Type": "application/json"})
        with self._connection.getresponse() as response:
            if response.status != http.client.OK:
                said = _error_in(response.read(_MAX_ERROR_BYTES))
                raise BlackBoxError(f"{self._url} answered {response.status}{f': {said}' if said else ''}.")
            answer: bytes = response.read(MAX_ANSWER_BYTES + 1)
        if len(answer) > MAX_ANSWER_BYTES:
            raise BlackBoxError(f"{self._url} answered with more than {MAX_ANSWER_BYTES:,} bytes.")
        return answer

    def _read(self, body: bytes, games: int) -> Probabilities:
        try:
            answer = msgspec.json.decode(body, type=_Answer)
        except msgspec.ValidationError:
            answer = _Answer()
        wanted = f"{games} actions or {games} x {ACTIONS} probabilities"
        if answer.actions is not None and len(answer.actions) == games:
            if not all(0 <= action < ACTIONS for action in answer.actions):
                raise BlackBoxError(f"{self._url} gave an action outside 0-{ACTIONS - 1}.")
            return np.eye(ACTIONS, dtype=np.float32)[answer.actions]
        rows = answer.probabilities
        if rows is not None and len(rows) == games and all(len(row) == ACTIONS for row in rows):
            with np.errstate(over="ignore"):
                return np.asarray(rows, np.float32)
        raise BlackBoxError(f"{self._url} must answer with {wanted}.")


class _TimedSocket:
    """The part of a socket that http.client uses, with one deadline for the whole exchange. The timeout of a plain
    socket restarts with every byte, so a response that trickles in would never end.
    """

    def __init__(self, inner: socket.socket) -> None:
        self._inner = inner
        self.deadline = 0.0

    def set_timeout(self) -> None:
        left_s = self.deadline - time.monotonic()
        if left_s <= 0:
            raise TimeoutError(f"no whole answer within {TIMEOUT_S:g} s")
        self._inner.settimeout(left_s)

    def sendall(self, data: Any) -> None:
        self.set_timeout()
        self._inner.sendall(data)

    def makefile(self, _mode: str) -> io.BufferedReader:
        return io.BufferedReader(_TimedReader(self, self._inner.makefile("rb", buffering=0)))

    def close(self) -> None:
        self._inner.close()


class _TimedReader(io.RawIOBase):
    def __init__(self, timed: _TimedSocket, raw: Any) -> None:
        self._timed, self._raw = timed, raw

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int | None:
        self._timed.set_timeout()
        count: int | None = self._raw.readinto(buffer)
        return count

    def close(self) -> None:
        if not self.closed:
            self._raw.close()
        super().close()
