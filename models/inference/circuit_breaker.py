"""A circuit breaker: stop using a model (or a worker) that keeps failing, for longer each time, so that it does not
delay every tick.
"""

import time
from collections.abc import Callable

FAULTS_TO_OPEN = 5
FIRST_PAUSE_S = 1.0
MAX_PAUSE_S = 30.0


class Breaker:
    """Opens after some faults in a row; lets one call through when its pause is over. Clock in seconds, any start."""

    def __init__(self, faults_to_open: int = FAULTS_TO_OPEN, clock: Callable[[], float] = time.monotonic) -> None:
        self._faults_to_open = faults_to_open
        self._clock = clock
        self._faults = 0
        self._pause_s = FIRST_PAUSE_S
        self._paused_until = 0.0

    @property
    def closed(self) -> bool:
        """Whether the model may be called now."""
        return self._clock() >= self._paused_until

    def worked(self) -> None:
        self._faults = 0
        self._pause_s = FIRST_PAUSE_S

    def failed(self) -> None:
        self._faults += 1
        if self._faults >= self._faults_to_open:
            self._paused_until = self._clock() + self._pause_s
            self._pause_s = min(2 * self._pause_s, MAX_PAUSE_S)
