"""The shortest complete run: consent to code over real HTTP and sockets, then export and verify."""

import asyncio
import csv
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from server.bots.participant import Bot
from server.store.database import Database
from server.store.engines import normal_url
from tests.support.real_server import ROOT, SHORT_STUDY, RealServer


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RealServer]:
    study = SHORT_STUDY.replace("horizon: 60", "horizon: 30")
    with RealServer(tmp_path_factory.mktemp("served"), study=study) as running:
        yield running


def stored_hashes(server: RealServer) -> dict[tuple[str, int], str]:
    """(episode, timestep) -> hash, as the database has it."""
    from sqlalchemy import select

    from server.store.tables import ticks
    from server.store.ticks import record_of

    assert normal_url(server.database)
    with Database(server.database, read_only=True) as database:
        rows = database.read_now(
            lambda connection: connection.execute(select(ticks).order_by(ticks.c.episode_id, ticks.c.timestep)).all()
        )
    records = [record_of(row) for row in rows]
    return {(record.episode, record.timestep): record.state_hash for record in records}


def test_participants_complete_the_study_and_everything_they_saw_is_stored(server: RealServer) -> None:
    bots = [Bot(server.url, "short", seed) for seed in range(3)]

    async def walk() -> None:
        await asyncio.gather(*(bot.take_part() for bot in bots))

    asyncio.run(walk())
    stored = stored_hashes(server)
    for bot in bots:
        journal = bot.journal
        assert journal.code
        assert journal.violations == []
        assert journal.pages[:2] == ["introduction", "game"]
        assert len(journal.ended) == 3
        assert journal.states.items() <= stored.items()
        for episode in journal.ended:
            seen = [timestep for one, timestep in journal.states if one == episode]
            kept = [timestep for one, timestep in stored if one == episode]
            assert seen == sorted(seen)
            assert kept == list(range(len(kept)))
    assert len({bot.journal.code for bot in bots}) == 3


def test_export_and_verify_agree_with_what_was_played(server: RealServer, tmp_path: Path) -> None:
    verified = server.command("verify")
    assert verified.returncode == 0, verified.stdout + verified.stderr
    exported = server.command("export", "--out", str(tmp_path / "export"), "--format", "csv")
    assert exported.returncode == 0, exported.stdout + exported.stderr
    (episodes,) = (tmp_path / "export").rglob("*episodes*.csv")
    with episodes.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 9
    assert {row["status"] for row in rows} == {"done"}


def test_reload_leads_back_to_the_same_page(server: RealServer) -> None:
    import httpx

    with httpx.Client(base_url=server.url, follow_redirects=True, headers={"Accept": "text/html"}) as client:
        assert client.get("/s/short/now").url.path == "/s/short"
        first = client.get("/s/short")
        assert first.status_code == 200
        assert not client.cookies


def serve(*words: str) -> "subprocess.CompletedProcess[str]":
    """In a separate process, as it changes the one that it runs in."""
    line = [sys.executable, str(ROOT / "kitchenmind"), "serve", *words]
    return subprocess.run(line, capture_output=True, text=True, check=False, timeout=120)


def test_second_server_on_the_same_database_is_refused(server: RealServer) -> None:
    refused = serve("--port", "0", "--study", str(server.study), "--database", server.database)
    assert refused.returncode == 1
    assert "kitchenmind serve:" in refused.stderr


def test_wrong_input_of_serve_is_reported_with_exit_code_2(server: RealServer, tmp_path: Path) -> None:
    taken = server.command("serve", "--port", server.url.rpartition(":")[2])  # refused before anything is changed
    assert taken.returncode == 2
    assert "--port" in taken.stderr
    broken = tmp_path / "broken.yaml"
    broken.write_text("name: 7\n", encoding="utf-8")
    wrong = serve("--port", "0", "--study", str(broken), "--database", f"sqlite:///{tmp_path}/new.sqlite3")
    assert wrong.returncode == 2
    assert "broken.yaml:1" in wrong.stderr


# `kill -9` in a game is also tests/faults/test_process_faults.py, in every run.
@pytest.mark.parametrize("how", [pytest.param(signal.SIGKILL, marks=pytest.mark.slow), signal.SIGTERM])
def test_server_that_goes_down_in_the_middle_loses_and_doubles_nothing(tmp_path: Path, how: signal.Signals) -> None:
    with RealServer(tmp_path, speed=8.0, study=SHORT_STUDY.replace("tutorial, ", "")) as server:
        bots = [Bot(server.url, "short", seed) for seed in range(2)]

        async def walk() -> None:
            walking = [asyncio.create_task(bot.take_part()) for bot in bots]
            while not all(len(bot.journal.states) > 30 for bot in bots):
                await asyncio.sleep(0.02)
                for task in walking:
                    if task.done():
                        task.result()
            status = await asyncio.to_thread(server.end, how)
            assert status == (0 if how is signal.SIGTERM else -how)
            await asyncio.to_thread(server.start)
            await asyncio.gather(*walking)

        asyncio.run(walk())
        stored = stored_hashes(server)
        for bot in bots:
            assert bot.journal.code
            assert bot.journal.violations == []
            assert bot.journal.reconnects >= 1
            assert bot.journal.states.items() <= stored.items()
        assert server.command("verify").returncode == 0
