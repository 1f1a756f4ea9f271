"""Says how far a group of simulated participants is: in place on a terminal, else as a plain line now and then."""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from typing import TextIO

from server.bots.participant import Bot

LINE_EVERY_S = 15.0  # of a log
TERMINAL_EVERY_S = 1.0


@dataclass
class GroupProgress:
    """What a group has done so far."""

    number: int
    bots: list[Bot] = field(default_factory=list)
    finished: int = 0

    def finish(self, finished: int, _: int) -> None:
        """Note how many have finished; they may have dropped out."""
        self.finished = finished

    @property
    def line(self) -> str:
        """The progress as one line."""
        rounds = sum(bot.journal.rounds_played for bot in self.bots)
        problems = sum(len(bot.journal.violations) for bot in self.bots)
        words = f"{rounds} round{'s' * (rounds != 1)} played, {problems} problem{'s' * (problems != 1)}"
        return f"{self.finished} of {self.number} participants finished, {words}"


@contextlib.asynccontextmanager
async def reported(progress: GroupProgress, out: TextIO) -> AsyncIterator[None]:
    """Write the progress to `out` again and again until the block ends."""
    task = asyncio.create_task(_report(progress, out))
    try:
        yield
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task
        if out.isatty():
            out.write(f"\r{progress.line}\n")


async def _report(progress: GroupProgress, out: TextIO) -> None:
    is_terminal = out.isatty()
    while True:
        await asyncio.sleep(TERMINAL_EVERY_S if is_terminal else LINE_EVERY_S)
        out.write(f"\r{progress.line}" if is_terminal else f"{progress.line}\n")
        out.flush()
