"""Faults around participants (rows 25, 27, 29, 30): clocks that jump, a busy dashboard, leaving, and the last page."""

import asyncio
import random
import re
import time
from datetime import datetime, timedelta
from pathlib import Path
from typing import Final
from unittest.mock import patch

import httpx
from sqlalchemy import func, select

from server.play.clock import Clock
from server.store.database import Database
from server.store.tables import episodes, participants, pauses, ticks, withdrawals
from tests.support.faults.fault_scenario import FaultResult, rounded
from tests.support.faults.group import LONG_STUDY, ClientGroup
from tests.support.faults.invariants import held_against, lateness_ms, p99
from tests.support.faults.recording_client import RecordingClient
from tests.support.faults.researcher import FaultResearcher, account_for
from tests.support.live_server import LiveServer
from tests.support.real_server import SHORT_STUDY, RealServer

PAGES_ONLY = SHORT_STUDY.replace(
    "after_episode: teamwork\nflow: [introduction, tutorial, episodes, thanks]",
    "flow: [introduction, teamwork, thanks]",
)
JUMP_S: Final = 3600
_MARK = "everything-that-this-person-wrote"


async def clock_jumps(folder: Path, seconds: float) -> FaultResult:
    """Row 25: the machine's clock jumps an hour ahead and back while games run and pages are filled in."""
    real, wall = time.time, Clock.wall
    with LiveServer(folder, study=LONG_STUDY, speed=5.0) as live:
        async with ClientGroup(live.url, 2) as group:
            for hours in (1, -1, 0):
                newcomer = RecordingClient(live.url, "short", 100 + hours)
                page = await newcomer.ask("GET", "/s/short")
                shift = JUMP_S * hours

                def jumped(shift: int = shift) -> float:
                    return real() + shift

                with (
                    patch("time.time", jumped),
                    patch.object(Clock, "wall", lambda self, s=shift: _later(wall(self), s)),
                ):
                    consented = await newcomer.http.post("/s/short/consent", data=page.form)
                    assert consented.status_code == 200, consented.text
                    began = time.monotonic()
                    next(iter(live.app.state.services.games)).pause(0, "blur")
                    await asyncio.sleep(seconds)
                    await group.moving(began)
                await newcomer.close()
        found = held_against(live.database, group.clients)
        found.people.clear()  # three more consented
        negative = select(func.count()).where(pauses.c.duration_ms < 0)
        with Database(live.database, read_only=True) as database:
            backwards = database.read_now(lambda connection: connection.execute(negative).scalar_one())
            rows = database.read_now(lambda connection: connection.execute(select(ticks.c.late_ms)).scalars().all())
    figure = found.figures() | {"negative_durations": backwards, "late_p99_ms": rounded(p99(rows))}
    jumped_along = (
        p99(rows) > JUMP_S * 1000 / 2
    )  # timesteps that wait for the jumped clock; a busy machine is not a fault
    return FaultResult(25, "clock jumps by an hour", 3, found.ok and not backwards and not jumped_along, figure)


def _later(moment: datetime, seconds: int) -> datetime:
    return moment + timedelta(seconds=seconds)


async def withdrawal(folder: Path) -> FaultResult:
    """Row 29: somebody leaves in the middle of a game, and nothing of them is left in any file; a count is."""
    study = SHORT_STUDY.replace(
        "{key: satisfied,", "{key: words, type: text, text: {en: 'Words?'}}\n      - {key: satisfied,"
    )
    with LiveServer(
        folder, study=study.replace("flow: [introduction, tutorial,", "flow: [introduction, teamwork,")
    ) as live:
        client = RecordingClient(live.url)
        page = await client.ask("GET", "/s/short")
        await client.ask("POST", "/s/short/consent", page.form)
        page = await client.submit(await client.ask("GET", "/s/short/now"))
        page.form["words"] = _MARK
        await client.submit(page)
        with Database(live.database, read_only=True) as database:
            person = database.read_now(lambda connection: connection.execute(select(participants.c.id)).scalar_one())
            token = database.read_now(
                lambda connection: connection.execute(select(participants.c.token_hash)).scalar_one()
            )
        page = await client.ask("GET", "/s/short/now")
        while not page.is_game:
            page = await client.submit(page)
        playing = asyncio.create_task(client.game().play())
        while client.log.first("tick", 0.0) is None or len(client.log.states) < 5:
            await asyncio.sleep(0.02)
        episode = next(iter(client.log.states))[0]
        asked = await client.http.get("/s/short/withdraw")
        left = await client.http.post("/s/short/withdraw", data=_token_of(asked))
        assert left.status_code == 200
        await asyncio.wait({playing}, timeout=10)
        closed = playing.done()
        playing.cancel()
        await client.close()
    words = {
        name: word.encode() for name, word in (("id", person), ("token", token), ("words", _MARK), ("episode", episode))
    }
    residual = _occurrences(folder, words)
    with Database(live.database, read_only=True) as database:
        counted = database.read_now(lambda c: c.execute(select(func.count()).select_from(withdrawals)).scalar_one())
        kept = database.read_now(lambda c: c.execute(select(func.count()).select_from(episodes)).scalar_one())
    figure = {"residual": len(residual), "counted": counted, "episodes_kept": kept, "socket_closed": int(closed)}
    return FaultResult(
        29, "withdrawal in the middle of a game", 1, not residual and counted == 1 and not kept and closed, figure
    )


def _token_of(page: httpx.Response) -> dict[str, str]:
    return dict(re.findall(r'type="hidden" name="([^"]*)" value="([^"]*)"', page.text))


def _occurrences(folder: Path, words: dict[str, bytes]) -> list[str]:
    files = [file for file in folder.rglob("*") if file.is_file()]
    return [f"{name} in {file.name}" for file in files for name, word in words.items() if word in file.read_bytes()]


async def last_page(folder: Path, tries: int, seed: int = 0) -> FaultResult:
    """Row 30: the server is killed at the very moment of the last answer; nobody sees a code without complete data."""
    chance, clients = random.Random(seed), []
    with LiveServer(folder, study=PAGES_ONLY) as live:
        for number in range(tries):
            client = RecordingClient(live.url, "short", seed + number)
            clients.append(client)
            page = await client.ask("GET", "/s/short")
            await client.ask("POST", "/s/short/consent", page.form)
            last = await client.submit(await client.ask("GET", "/s/short/now"))
            assert last.form["step"] == "teamwork"
            sending = asyncio.create_task(client.http.post("/s/short/now", data=last.form))
            await asyncio.sleep(chance.uniform(0.0, 0.02))
            await asyncio.to_thread(live.kill)
            await asyncio.gather(sending, return_exceptions=True)
            await asyncio.to_thread(live.start)
            await client.walk_on()
            await client.close()
        found = held_against(live.database, clients)
    codes = sum(one.log.code is not None for one in clients)
    figure = found.figures() | {"codes": codes, "seed": seed}
    return FaultResult(30, "killed at the last answer", tries, found.ok and codes == tries, figure)


async def busy_dashboard(folder: Path, seconds: float, games: int, goal_ms: float | None = None) -> FaultResult:
    """Row 27: twenty dashboards are open and an export is made while people play."""
    with RealServer(folder, speed=1.0, study=LONG_STUDY) as server:
        account_for(server)
        async with ClientGroup(server.url, games, idle=0.9) as group:
            await asyncio.sleep(seconds)
            calm, since_ms = lateness_ms(server.database), time.time() * 1000
            async with FaultResearcher(server.url) as researcher:
                await researcher.watch("short", screens=20)
                size = await researcher.export("short")
                await asyncio.sleep(seconds)
            busy = lateness_ms(server.database, since_ms=since_ms)
        found = held_against(server.database, group.clients)
    shift = p99(busy) - p99(calm)
    figure = found.figures() | {"shift_p99_ms": rounded(shift), "p99_ms_before": rounded(p99(calm)), "zip_bytes": size}
    passed = found.ok and size > 1000 and (goal_ms is None or shift < goal_ms)
    return FaultResult(27, "export and twenty dashboards", games, passed, figure)
