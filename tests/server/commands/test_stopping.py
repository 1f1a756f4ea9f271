"""Stopping `kitchenmind serve` has a time limit, whatever the database does."""

import asyncio
import signal
from pathlib import Path

import pytest

from server.bots.participant import Bot
from tests.support.postgres_server import PostgresServer
from tests.support.real_server import RealServer

pytestmark = pytest.mark.postgres


@pytest.mark.slow
async def test_a_stop_does_not_wait_forever_for_a_database_that_hangs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("KITCHENMIND_STOP_WITHIN_S", "3")
    postgres = PostgresServer()
    server = RealServer(tmp_path)
    server.database = postgres.url(postgres.new_database())
    with server:
        bot = Bot(server.url, "short", 1)
        page = await bot.consent()
        postgres.freeze()
        answered = asyncio.create_task(bot.submit(page))
        await asyncio.sleep(0.5)  # now it waits for the commit
        assert await asyncio.to_thread(server.end, signal.SIGTERM) == 1
        answered.cancel()
        await asyncio.gather(answered, return_exceptions=True)
        await bot.close()
    postgres.thaw()
    postgres.remove()
    said = server.log.read_text()
    assert "Timeout (0:00:03)!" in said
    assert "database-writer" in said or "server/store/database.py" in said, "it does not say where it hung"
