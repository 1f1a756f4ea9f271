"""`kitchenmind serve --workers 2` with a real PostgreSQL and a real Redis: processes die, games continue."""

import asyncio
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import Connection, select

from server.bots.participant import Bot
from server.store import ticks
from server.store.database import Database
from server.store.tables import episodes
from tests.support import command_line
from tests.support.postgres_server import PostgresServer
from tests.support.real_server import SHORT_STUDY, RealServer
from tests.support.redis_server import RedisServer

STUDY = SHORT_STUDY.replace("tutorial, ", "")
pytestmark = pytest.mark.postgres


class SeveralWorkers(RealServer):
    """Two server processes behind one address."""

    def __init__(self, folder: Path, database: str, redis: str, horizon: int = 250) -> None:
        super().__init__(folder, 5.0, STUDY.replace("horizon: 60", f"horizon: {horizon}"))
        self.database = database
        self.more_words = ["--workers", "2", "--redis", redis]

    def pids(self) -> list[int]:
        """Of the server processes."""
        return children(self.pid)


def lives(pid: int) -> bool:
    """False also for what has ended and only waits to be cleared away, which the system may take its time with."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def children(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


@pytest.fixture(scope="module")
def serving(
    tmp_path_factory: pytest.TempPathFactory, postgres: PostgresServer, redis: RedisServer
) -> Iterator[SeveralWorkers]:
    """For both tests of this file that are not slow; the second kills it."""
    name = postgres.new_database()
    server = SeveralWorkers(tmp_path_factory.mktemp("several"), postgres.url(name), redis.url)
    with server:
        yield server
    postgres.drop_database(name)


def running(connection: Connection) -> int:
    return len(connection.execute(select(episodes.c.id).where(episodes.c.status == "running")).all())


def played(connection: Connection) -> dict[str, tuple[str, int, list[int]]]:
    """Episode -> status, how often it was taken up, its timesteps."""
    rows = connection.execute(select(episodes.c.id, episodes.c.status, episodes.c.fence)).all()
    return {
        row.id: (row.status, row.fence, [tick.timestep for tick in ticks.of_episode(connection, row.id)])
        for row in rows
    }


async def to_the_game(bot: Bot) -> None:
    """From the consent page to the game, without playing it."""
    page = await bot.consent()
    while not page.is_game:
        page = await bot.submit(page)
    await bot.close()


async def play_through_kills(serving: SeveralWorkers, players: int, kills: int, horizon: int) -> None:
    """Games are begun, processes are killed one after the other, every game is played to its end."""
    bots = [Bot(serving.url, "short", seed) for seed in range(players)]
    await asyncio.gather(*map(to_the_game, bots))
    games = [asyncio.create_task(bot.game().play()) for bot in bots]
    with Database(serving.database, read_only=True) as database:
        for _ in range(kills):
            while await database.read(running) < players and not any(game.done() for game in games):
                await asyncio.sleep(0.05)
            await asyncio.sleep(1)
            victim = serving.pids()[0]  # the older one: the last to be killed has a successor behind it
            os.kill(victim, signal.SIGKILL)
            while len(serving.pids()) < 2 or victim in serving.pids():
                await asyncio.sleep(0.05)
        ends = await asyncio.wait_for(asyncio.gather(*games), 600)
        found = await database.read(played)
    assert all(ends)
    assert [bot.journal.violations for bot in bots] == [[]] * players
    assert {status for status, _, _ in found.values()} == {"done"}
    assert [timesteps for _, _, timesteps in found.values()] == [list(range(horizon + 1))] * players
    assert max(fence for _, fence, _ in found.values()) > 1, "no game was running where a process was killed"


@pytest.mark.slow
async def test_when_a_process_is_killed_its_games_continue_in_the_other(serving: SeveralWorkers) -> None:
    await play_through_kills(serving, players=6, kills=2, horizon=250)


@pytest.mark.slow
@pytest.mark.timeout(900)
async def test_many_kills_lose_and_double_nothing(tmp_path: Path, postgres: PostgresServer, redis: RedisServer) -> None:
    name = postgres.new_database()
    with SeveralWorkers(tmp_path, postgres.url(name), redis.url, horizon=1500) as server:
        await play_through_kills(server, players=20, kills=12, horizon=1500)
    postgres.drop_database(name)


def test_several_workers_are_refused_without_what_they_need() -> None:
    def refused(*words: str) -> str:
        done = command_line.run("serve", "--port", "0", *words)
        assert done.returncode == 2
        return done.stderr

    assert "cannot share SQLite" in refused("--workers", "2")
    assert "need Redis" in refused("--workers", "2", "--database", "postgresql://nobody@localhost/none")


@pytest.mark.slow
def test_the_processes_stop_with_their_supervisor_however_it_dies(serving: SeveralWorkers) -> None:
    pids = serving.pids()
    assert len(pids) == 2
    os.kill(serving.pid, signal.SIGKILL)
    until = time.monotonic() + 30
    while any(map(lives, pids)) and time.monotonic() < until:
        time.sleep(0.05)
    assert not [pid for pid in pids if lives(pid)]
