"""Rows 1 to 3, 24 and 28 of docs/explanation/faults.md: a server killed, stopped, killed at start, left running."""

import asyncio
from pathlib import Path

import pytest

from tests.support.faults import process_scenarios as process
from tests.support.real_server import RealServer


async def test_a_restarted_server_continues_every_game_where_it_was_killed(tmp_path: Path) -> None:
    (await process.kills(tmp_path, tries=1, games=4, seed=1)).hold()


@pytest.mark.slow
@pytest.mark.timeout(1200)
async def test_many_kills_under_fifty_games_lose_and_double_nothing(tmp_path: Path) -> None:
    (await process.kills(tmp_path, tries=20, games=50, seed=2)).hold()


@pytest.mark.slow
async def test_a_stopped_server_tells_participants_and_continues_after_the_restart(tmp_path: Path) -> None:
    (await process.stops(tmp_path, tries=3, games=10)).hold()


@pytest.mark.slow
@pytest.mark.timeout(600)
async def test_a_server_killed_while_it_starts_comes_up_at_last(tmp_path: Path) -> None:
    (await process.kills_while_starting(tmp_path, tries=15)).hold()


@pytest.mark.slow
async def test_a_killed_model_worker_is_back_within_a_second_and_no_game_ends(tmp_path: Path) -> None:
    (await process.worker_kills(tmp_path, tries=3, games=5)).hold()


@pytest.mark.slow
async def test_a_socket_that_stays_is_counted(tmp_path: Path) -> None:
    with RealServer(tmp_path) as server:
        before = await process.settled(server.pid)
        answers, held = await asyncio.open_connection("127.0.0.1", int(server.url.rsplit(":", 1)[1]))
        held.write(b"GET /health/live HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        assert await answers.readline()  # the server has it now, and keeps it for the next request
        assert await process.sockets_beyond(before.sockets, server.pid, within_s=1) == 1
        held.close()
        assert await process.sockets_beyond(before.sockets, server.pid) == 0


@pytest.mark.slow
async def test_people_who_come_and_go_leave_neither_descriptors_nor_memory_behind(tmp_path: Path) -> None:
    (await process.soak(tmp_path, seconds=60, games=20)).hold()
