"""A circuit breaker: stop using a model (or a worker) that keeps failing, for longer each time, so that it does not
delay every tick.
"""

import time
from collections.abc import Callable

FAULTS_TO_OPEN = 5
FIRST_REST_S = 1.0
LONGEST_REST_S = 30.0


class Breaker:
    """Opens after some faults in a row; lets one call through when its pause is over. Clock in seconds, any start."""

    def __init__(self, faults_to_open: int = FAULTS_TO_OPEN, clock: Callable[[], float] = time.monotonic) -> None:
        self._faults_to_open = faults_to_open
        self._clock = clock
        self._faults = 0
        self._rest_s = FIRST_REST_S
        self._rests_until = 0.0

    @property
    def closed(self) -> bool:
        """Whether the model may be called now."""
        return self._clock() >= self._rests_until

    def worked(self) -> None:
        self._faults = 0
        self._rest_s = FIRST_REST_S

    def failed(self) -> None:
        self._faults += 1
        if self._faults >= self._faults_to_open:
            self._rests_until = self._clock() + self._rest_s
            self._rest_s = min(2 * self._rest_s, LONGEST_REST_S)
