"""A token bucket: a rate limit that allows bursts."""

from typing import Final

PER_S: Final = 20.0  # messages of a game
BURST: Final = 40.0


class TokenBucket:
    """A token bucket; `now` is in seconds of the caller's clock, which runs `speed` times as fast as the network."""

    def __init__(self, now: float, speed: float = 1.0, per_s: float = PER_S, burst: float = BURST) -> None:
        self._burst = self._tokens = burst * max(1.0, speed)
        self._per_s, self._at = per_s, now

    def is_full(self, now: float) -> bool:
        """Return whether the bucket is full again, so that it can be deleted."""
        return self._tokens + (now - self._at) * self._per_s >= self._burst

    def spend(self, now: float) -> bool:
        """Take one token; False if there is none left."""
        self._tokens = min(self._burst, self._tokens + (now - self._at) * self._per_s)
        self._at = now
        if self._tokens < 1:
            return False
        self._tokens -= 1
        return True
