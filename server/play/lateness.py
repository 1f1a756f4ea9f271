"""The lateness of the timesteps of the last minute; older values are dropped."""

import time
from collections import deque
from collections.abc import Iterable
from typing import Final

LATELY_S: Final = 60.0
_KEPT: Final = 10_000


class Lateness:
    """The lateness of the last ticks, each with the (real) moment at which it began."""

    def __init__(self) -> None:
        self._ticks: deque[tuple[float, float]] = deque(maxlen=_KEPT)  # (moment, ms), oldest first

    def add(self, late_ms: float, at: float | None = None) -> None:
        """Note a tick that began now, or at this moment of `time.monotonic()`."""
        self._ticks.append((time.monotonic() if at is None else at, late_ms))

    def add_batch(self, late_ms: Iterable[float]) -> None:
        """Note ticks that begin now, together."""
        now = time.monotonic()
        self._ticks.extend([(now, late) for late in late_ms])

    def last(self, within_s: float = LATELY_S, most: int = _KEPT) -> list[float]:
        """Return the lateness in ms of at most so many ticks, sorted; empty where none was made in this time."""
        since = time.monotonic() - within_s
        found: list[float] = []
        for at, late_ms in reversed(self._ticks):
            if at < since or len(found) == most:
                break
            found.append(late_ms)
        return sorted(found)
