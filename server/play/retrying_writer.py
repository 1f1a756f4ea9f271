"""Writes that are retried however long the database is unavailable: pauses, inputs and the end of one episode, in
order.
"""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Sequence
from typing import Final

from server.play.clock import Clock
from server.play.recorder import EpisodeResult, InputRecord, PauseRecord, Recorder, RecorderDown

log = logging.getLogger(__name__)
RETRY_S: Final = 0.5


class RetryingWriter:
    """The writer of one episode; ticks do not go through it."""

    def __init__(self, recorder: Recorder, clock: Clock) -> None:
        self._recorder, self._clock = recorder, clock
        self._turn = asyncio.Lock()
        self._tasks: set[asyncio.Task[None]] = set()

    def pause(self, record: PauseRecord) -> None:
        """Return at once; the record arrives when the database takes it."""
        self._begin(lambda: self._recorder.pause(record))

    def inputs(self, episode: str, records: Sequence[InputRecord]) -> None:
        """As `pause`, for inputs."""
        self._begin(lambda: self._recorder.inputs(episode, records))

    async def end(self, result: EpisodeResult) -> None:
        """Return when the result and everything before it are stored."""
        await self._repeat(lambda: self._recorder.end(result))

    async def flush(self) -> None:
        """Return when everything so far is stored."""
        # Not until the set is empty: of tasks that are done, `gather` returns at once from Python 3.12 on, and the loop
        # would never come to take them out.
        while waiting := [task for task in self._tasks if not task.done()]:
            await asyncio.gather(*waiting)

    def _begin(self, write: Callable[[], Awaitable[None]]) -> None:
        task = asyncio.create_task(self._repeat(write))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _repeat(self, write: Callable[[], Awaitable[None]]) -> None:
        async with self._turn:
            while True:
                try:
                    return await write()
                except RecorderDown:
                    await self._clock.sleep(RETRY_S)
