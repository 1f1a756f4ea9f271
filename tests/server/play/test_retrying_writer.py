"""Writes that must arrive: flushing waits for them, and only for as long as there are any."""

import asyncio
from datetime import UTC, datetime

import pytest

from server.play.clock import Clock
from server.play.recorder import PauseRecord, RecorderDown
from server.play.retrying_writer import RetryingWriter
from tests.support.live_fakes import MemoryRecorder


class RefusingRecorder(MemoryRecorder):
    """Takes pauses at once, after so many refusals."""

    def __init__(self, refusals: int = 0) -> None:
        super().__init__()
        self.refusals = refusals
        self.taken = 0

    async def pause(self, record: PauseRecord) -> None:
        if self.refusals:
            self.refusals -= 1
            raise RecorderDown("not now")
        self.taken += 1


RECORD = PauseRecord("e1", 1, "researcher", datetime(2026, 1, 1, tzinfo=UTC), None)


@pytest.mark.timeout(20)
async def test_what_was_stored_a_moment_ago_is_not_waited_for_without_end() -> None:
    recorder = RefusingRecorder()
    retrying_writer = RetryingWriter(recorder, Clock())
    retrying_writer.pause(RECORD)
    await asyncio.sleep(0)  # stored, but the loop has not come to tell anybody
    assert recorder.taken == 1
    await retrying_writer.flush()


@pytest.mark.timeout(20)
async def test_flush_waits_until_the_database_takes_it() -> None:
    recorder = RefusingRecorder(refusals=2)
    retrying_writer = RetryingWriter(recorder, Clock())
    retrying_writer.pause(RECORD)
    retrying_writer.pause(RECORD)
    await retrying_writer.flush()
    assert recorder.taken == 2
