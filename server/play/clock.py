"""Time of the live game: monotonic seconds, in tests and simulations many times faster than the wall's."""

import asyncio
import time
from datetime import UTC, datetime


class Clock:
    """`now()` grows by `speed` seconds a second. Setting the machine's wall clock does not move it.

    `patience_s` over 0 is for simulated participants: a timestep is made as soon as its players have sent their keys,
    and waits for them so many real seconds; so games are as quick as the machine, and everybody acts in every timestep.
    """

    def __init__(self, speed: float = 1.0, patience_s: float = 0.0) -> None:
        if speed <= 0:
            raise ValueError(f"a clock must run forward; speed = {speed}")
        self.speed, self.patience_s = speed, patience_s

    def now(self) -> float:
        """Return seconds since some fixed moment; only differences mean something."""
        return time.monotonic() * self.speed

    def wall(self) -> datetime:
        """Return the time in UTC, for records; never used to measure."""
        return datetime.now(UTC)

    def unix_ms(self) -> float:
        """Return `wall` in milliseconds since 1970."""
        return round(time.time() * 1000, 3)

    async def sleep(self, seconds: float) -> None:
        """Sleep real seconds, whatever the speed: to wait for machines."""
        await asyncio.sleep(seconds)

    async def sleep_until(self, moment: float) -> None:
        """Sleep until `moment` of `now()`, never less; the event loop's own sleep may end a millisecond early."""
        while (left_s := (moment - self.now()) / self.speed) > 0:
            await asyncio.sleep(left_s)
