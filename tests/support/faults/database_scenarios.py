"""Faults of the database (rows 4 to 8): unavailable, locked, full, refusing to sync. Games wait until it commits
again.
"""

import asyncio
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Awaitable, Callable
from pathlib import Path

from sqlalchemy import text

from server.store import studies
from server.store.database import Database
from server.store.engines import SERVER_LOCK_TIMEOUT_S
from server.store.migrate import migrate
from tests.support.faults.fault_scenario import FaultResult, rounded
from tests.support.faults.group import LONG_STUDY, ClientGroup
from tests.support.faults.invariants import held_against
from tests.support.faults.recording_client import RecordingClient
from tests.support.live_server import LiveServer
from tests.support.postgres_server import PostgresServer
from tests.support.real_server import RealServer

NOTICE_TIMEOUT_S = 2.0  # a commit that takes a second counts as failed
Fault = Callable[[], Awaitable[None]]


async def away(group: ClientGroup, begin: Fault, end: Fault, seconds: float) -> tuple[bool, dict[str, float]]:
    """Make the database unavailable for a while: everybody is told, nothing moves, and all games resume by
    themselves."""
    began = time.monotonic()
    await begin()
    stopped = time.monotonic()
    told = await group.told("paused", began, "database")
    await asyncio.sleep(max(0.0, seconds - (time.monotonic() - stopped)))
    fresh = group.since("tick", stopped + NOTICE_TIMEOUT_S)
    healed = time.monotonic()
    await end()
    back = await group.moving(healed, within_s=90)
    figure = {"told_most_s": rounded(max(told)), "moving_again_most_s": rounded(max(back))}
    return max(told) <= NOTICE_TIMEOUT_S and not fresh, figure | {"ticks_meanwhile": len(fresh)}


async def locked(folder: Path, seconds: float) -> FaultResult:
    """Row 8: another program holds the write lock of SQLite."""
    with LiveServer(folder, study=LONG_STUDY, speed=2.0) as live:
        async with ClientGroup(live.url, 3) as group:
            intruder = sqlite3.connect(live.database.removeprefix("sqlite:///"), isolation_level=None, timeout=10)

            async def begin() -> None:
                intruder.execute("BEGIN IMMEDIATE")

            async def end() -> None:
                intruder.execute("ROLLBACK")

            newcomer = RecordingClient(live.url, "short", 99)
            arriving: list[asyncio.Task[None]] = []

            async def begin_with_newcomer() -> None:
                await begin()
                arriving.append(asyncio.create_task(newcomer.to_the_game()))

            passed, figure = await away(group, begin_with_newcomer, end, seconds)
            await arriving[0]
            await newcomer.close()
            intruder.close()
        people = [*group.clients, newcomer]
        found = held_against(live.database, people, silence_s=seconds + 10)
    errors = [error for one in people for error in one.log.errors]
    # A page that has waited long enough says "please try again", and the newcomer does.
    friendly = all(error == 503 for error in errors) and (seconds >= SERVER_LOCK_TIMEOUT_S or not errors)
    figure |= found.figures() | {"5xx": len(errors)}
    return FaultResult(8, f"SQLite locked for {seconds:g} s", 1, passed and found.ok and friendly, figure)


async def postgres_frozen(folder: Path, seconds: float) -> FaultResult:
    """Row 5: every process of PostgreSQL stands still, then continues."""
    return await _postgres(folder, "freeze", seconds)


async def postgres_killed(folder: Path, seconds: float) -> FaultResult:
    """Row 5: PostgreSQL is killed and started again."""
    return await _postgres(folder, "stop", seconds)


async def _postgres(folder: Path, how: str, seconds: float) -> FaultResult:
    postgres = PostgresServer(durable=True)
    try:
        with LiveServer(folder, study=LONG_STUDY, speed=2.0, database=postgres.url()) as live:
            async with ClientGroup(live.url, 5, idle=0.8) as group:
                other = {"freeze": "thaw", "stop": "start"}[how]

                async def begin() -> None:
                    await asyncio.to_thread(getattr(postgres, how))

                async def end() -> None:
                    await asyncio.to_thread(getattr(postgres, other))

                passed, figure = await away(group, begin, end, seconds)
            found = held_against(live.database, group.clients, silence_s=seconds + 10)
    finally:
        postgres.remove()
    fault = f"PostgreSQL {'stands still' if how == 'freeze' else 'killed'} for {seconds:g} s"
    return FaultResult(5, fault, 1, passed and found.ok, found.figures() | figure)


class SmallDisk:
    """A file system of its own, so small that it can be filled."""

    def __init__(self, folder: Path, size: str = "6m") -> None:
        self.folder = folder / "disk"
        self.folder.mkdir()
        subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "none", str(self.folder)], check=True)

    def fill(self) -> None:
        with (self.folder / "ballast").open("wb", buffering=0) as file:
            try:
                while file.write(b"x" * 4096):
                    pass
            except OSError:
                pass

    def free(self) -> None:
        (self.folder / "ballast").unlink()

    def remove(self) -> None:
        subprocess.run(["umount", str(self.folder)], check=True)


def can_mount() -> bool:
    """Whether this process may mount a file system of its own."""
    return (
        os.geteuid() == 0 and not subprocess.run(["unshare", "-m", "true"], capture_output=True, check=False).returncode
    )


async def disk_full(folder: Path, seconds: float) -> FaultResult:
    """Row 7: no space is left; games wait, and resume without a restart once there is some."""
    disk = SmallDisk(folder)
    try:
        with LiveServer(folder, study=LONG_STUDY, speed=2.0, database=f"sqlite:///{disk.folder}/study.sqlite3") as live:
            async with ClientGroup(live.url, 3) as group:
                passed, figure = await away(
                    group, lambda: asyncio.to_thread(disk.fill), lambda: asyncio.to_thread(disk.free), seconds
                )
            found = held_against(live.database, group.clients, silence_s=seconds + 10)
    finally:
        disk.remove()
    return FaultResult(7, f"disk full for {seconds:g} s", 1, passed and found.ok, found.figures() | figure)


async def sync_fails(folder: Path, seconds: float) -> FaultResult:
    """Row 6: the disk refuses to sync (EIO) for a while: nothing is acknowledged that was not synced."""
    with RealServer(folder, speed=2.0, study=LONG_STUDY) as server:
        async with ClientGroup(server.url, 3) as group:
            strace: list[subprocess.Popen[bytes]] = []

            async def begin() -> None:
                words = ["strace", "-f", "-qq", "-e", "trace=fdatasync,fsync", "-e", "inject=fdatasync,fsync:error=EIO"]
                strace.append(subprocess.Popen([*words, "-o", os.devnull, "-p", str(server.pid)]))
                await asyncio.sleep(0.5)

            async def end() -> None:
                strace[0].send_signal(signal.SIGINT)
                await asyncio.to_thread(strace[0].wait)

            passed, figure = await away(group, begin, end, seconds)
        await asyncio.to_thread(server.end, signal.SIGKILL)
        found = held_against(server.database, group.clients, silence_s=seconds + 10)
    return FaultResult(6, f"fsync fails for {seconds:g} s", 1, passed and found.ok, found.figures() | figure)


def power_cuts(folder: Path, tries: int, seed: int = 0) -> FaultResult:
    """Row 4: the power goes. What was synced stays, of what came after it any piece may be there, torn."""
    chance = random.Random(seed)
    file = folder / "study.sqlite3"
    url = f"sqlite:///{file}"
    migrate(url)
    synced: list[tuple[int, int]] = []  # length of the log after a commit was acknowledged, how many there were then
    with Database(url) as database:
        assert database.write_now(lambda connection: connection.execute(text("PRAGMA synchronous")).scalar_one()) == 2
        log = Path(f"{file}-wal")
        for number in range(60):
            database.write_now(studies.register, f"study_{number}", "x" * chance.randrange(10, 9000))
            synced.append((log.stat().st_size, number + 1))
        shutil.copy(file, folder / "base")
        whole = log.read_bytes()
    lost = torn = 0
    for _ in range(tries):
        length, acknowledged = chance.choice(synced)
        tail = bytearray(whole[length : length + chance.randrange(0, 20_000)])
        for _ in range(chance.randrange(0, 20) if tail else 0):
            tail[chance.randrange(len(tail))] = chance.randrange(256)
        cut = folder / "cut.sqlite3"
        for old in folder.glob("cut.sqlite3*"):
            old.unlink()
        shutil.copy(folder / "base", cut)
        Path(f"{cut}-wal").write_bytes(whole[:length] + tail)
        keys = _stored_keys(cut)
        lost += keys[:acknowledged] != [f"study_{number}" for number in range(acknowledged)]
        torn += keys != [f"study_{number}" for number in range(len(keys))]
    return FaultResult(
        4, "power loss with a torn tail", tries, not lost and not torn, {"lost": lost, "torn": torn, "seed": seed}
    )


def _stored_keys(file: Path) -> list[str]:
    connection = sqlite3.connect(file)
    try:
        assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        return [row[0] for row in connection.execute("SELECT key FROM studies ORDER BY id")]
    finally:
        connection.close()


def second_server(folder: Path) -> FaultResult:
    """Row 26: a second server on one database is refused while the first lives, and let in once it was killed."""
    migrate(f"sqlite:///{folder}/study.sqlite3")
    script = (
        "from server.store.database import Database; Database(sys.argv[1]); print('in', flush=True); time.sleep(60)"
    )
    words = [sys.executable, "-c", f"import sys, time; {script}", f"sqlite:///{folder}/study.sqlite3"]
    first = subprocess.Popen(words, stdout=subprocess.PIPE, cwd=Path(__file__).parents[3])
    assert first.stdout is not None
    assert first.stdout.readline() == b"in\n"
    refused = subprocess.run(words, capture_output=True, text=True, check=False, cwd=Path(__file__).parents[3])
    first.kill()
    first.wait()
    first.stdout.close()
    with Database(f"sqlite:///{folder}/study.sqlite3"):
        pass
    passed = refused.returncode != 0 and "DatabaseInUse" in refused.stderr
    return FaultResult(26, "two servers on one database", 1, passed, {"let_in": int(not passed)})
