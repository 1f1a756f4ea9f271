"""Faults of the server's process (rows 1 to 3, 24, 28): a real `kitchenmind serve` that is killed and restarted."""

import asyncio
import gc
import os
import random
import signal
import time
from collections.abc import Sequence
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from sqlalchemy import func, select

from models.inference.supervised_worker import SPARE_AFTER_S
from server.store.database import Database
from server.store.tables import episodes, pauses, ticks
from tests.support.faults.fault_scenario import FaultResult, rounded
from tests.support.faults.group import LONG_STUDY, ClientGroup
from tests.support.faults.invariants import Holdings, held_against, p99
from tests.support.faults.recording_client import RecordingClient
from tests.support.real_server import RealServer


def children(pid: int) -> list[int]:
    """The processes that a process has started, and theirs."""
    try:
        found = [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:
        return []
    return [one for child in found for one in (child, *children(child))]


def last_timesteps(url: str) -> dict[str, int]:
    """How far each episode is stored."""
    query = select(ticks.c.episode_id, func.max(ticks.c.timestep)).group_by(ticks.c.episode_id)
    with Database(url, read_only=True) as database:
        return {row[0]: row[1] for row in database.read_now(lambda connection: connection.execute(query).all())}


def peers(group: ClientGroup, stood: dict[str, int], after: float) -> list[str]:
    """Return games that did not continue at their stored timestep."""
    found = []
    for one in group.clients:
        welcome = one.log.first("welcome", after)
        episode = max(one.log.states, key=lambda place: place[1])[0]
        if welcome is not None and stood.get(episode, 0) != welcome.detail:
            found.append(f"{episode} stood at {stood.get(episode)} and was taken up at {welcome.detail}")
    return found


Downtime = tuple[datetime, datetime, set[str]]  # killed, opened again, the episodes that had begun


def untold(url: str, downtimes: Sequence[Downtime]) -> list[str]:
    """Interruptions that no pause in the data covers."""
    query = select(pauses.c.episode_id, pauses.c.started_at, pauses.c.duration_ms)
    over = select(episodes.c.id, episodes.c.ended_at)
    with Database(url, read_only=True) as database:
        rows = database.read_now(lambda connection: connection.execute(query).all())
        ends = dict(database.read_now(lambda connection: connection.execute(over).all()))  # type: ignore[arg-type]

    def covers(row: Any, killed: datetime, opened: datetime) -> bool:
        lasted = timedelta(milliseconds=row.duration_ms) if row.duration_ms is not None else timedelta(days=1)
        return row.started_at <= killed and row.started_at.replace(tzinfo=None) + lasted >= opened.replace(tzinfo=None)

    return [
        f"{episode} stood still from {killed} to {opened}"
        for killed, opened, begun in downtimes
        for episode in sorted(begun)
        if (ends[episode] is None or ends[episode] > killed)
        and not any(covers(row, killed, opened) for row in rows if row.episode_id == episode)
    ]


async def kills(folder: Path, tries: int, games: int, seed: int = 0, budget_s: float = 1e9) -> FaultResult:
    """Row 1: `kill -9` at random instants, restarted each time; at most `budget_s` seconds of it."""
    chance, ends = random.Random(seed), time.monotonic() + budget_s
    opened: list[float] = []
    welcomed: list[float] = []
    slowest: list[float] = []  # of the games, at each kill
    moving: list[float] = []
    wrong: list[str] = []
    downtimes: list[Downtime] = []
    done, had = 0, set[int]()
    # At the speed of the wall clock: the ends of pauses are compared with it when a game is taken up.
    with RealServer(folder, speed=1.0, study=LONG_STUDY) as server:
        async with ClientGroup(server.url, games, seed, idle=0.9) as group:
            while done < tries and time.monotonic() < ends:
                await asyncio.sleep(chance.uniform(0.0, 2.0))
                had.update(children(server.pid))
                await asyncio.to_thread(server.end, signal.SIGKILL)
                done += 1
                killed, stood, began = datetime.now(UTC), last_timesteps(server.database), time.monotonic()
                await asyncio.to_thread(server.start)
                downtimes.append((killed, datetime.now(UTC), set(stood)))
                opened.append(time.monotonic() - began)
                if chance.random() < 0.3 and done < tries:
                    continue  # the next kill comes while games are being taken up
                try:
                    back = await group.told("welcome", began)
                except TimeoutError as late:
                    raise TimeoutError(f"{late}\nkill {done}, the server says: {server.log.read_text()}") from None
                welcomed += back
                slowest.append(max(back))
                moving += await group.moving(began)
                wrong += peers(group, stood, began)
        await asyncio.to_thread(server.end, signal.SIGTERM)
        found = held_against(server.database, group.clients, silence_s=10)
        gaps = untold(server.database, downtimes)
    orphans = sum(map(_is_model_worker, had))
    figure = found.figures() | {"games": games, "elsewhere": len(wrong), "orphans": orphans, "seed": seed}
    figure |= {"interruptions_untold": gaps[:3]} if gaps else {}
    figure |= {"pages_open_p50_s": rounded(sorted(opened)[len(opened) // 2]), "pages_open_most_s": rounded(max(opened))}
    figure |= {"all_games_back_p50_s": rounded(sorted(slowest)[len(slowest) // 2])} if slowest else {}
    figure |= {"games_back_p99_s": rounded(p99(welcomed)), "games_moving_p99_s": rounded(p99(moving))}
    figure |= {"back_after_open_p99_s": rounded(p99(_after(welcomed, opened)))}
    passed = found.ok and not wrong and not gaps and not orphans and found.compared > 0
    return FaultResult(1, "kill -9 of the server", done, passed, figure)


def _after(moments: Sequence[float], opened: Sequence[float]) -> list[float]:
    """How long after the pages could be opened, the median of which stands for all."""
    middle = sorted(opened)[len(opened) // 2]
    return [max(0.0, moment - middle) for moment in moments]


async def stops(folder: Path, tries: int, games: int) -> FaultResult:
    """Row 2: SIGTERM under games: everybody is told, sockets close with 1012, games continue in the next process."""
    took, codes = [], []
    with RealServer(folder, speed=2.0, study=LONG_STUDY) as server:
        async with ClientGroup(server.url, games, idle=0.9) as group:
            for _ in range(tries):
                began = time.monotonic()
                status = await asyncio.to_thread(server.end, signal.SIGTERM)
                took.append(time.monotonic() - began)
                assert status == 0, status
                await group.told("closed", began)
                codes += [told.detail for told in group.since("closed", began) if told.detail]
                back = time.monotonic()
                await asyncio.to_thread(server.start)
                await group.moving(back)
        await asyncio.to_thread(server.end, signal.SIGTERM)
        found = held_against(server.database, group.clients, silence_s=10)
        query = select(func.count()).where(pauses.c.duration_ms.is_(None), pauses.c.reason != "server")
        with Database(server.database, read_only=True) as database:
            open_pauses = database.read_now(lambda connection: connection.execute(query).scalar_one())
    figure = found.figures() | {"stop_most_s": rounded(max(took)), "other_codes": sum(code != 1012 for code in codes)}
    passed = found.ok and bool(codes) and not figure["other_codes"]
    return FaultResult(2, "stop and start again", tries, passed, figure | {"pauses_without_end": open_pauses})


async def kills_while_starting(folder: Path, tries: int, seed: int = 0) -> FaultResult:
    """Row 3: the server is killed again and again while it comes up, then left alone."""
    chance = random.Random(seed)
    with RealServer(folder, speed=4.0, study=LONG_STUDY) as server:
        async with ClientGroup(server.url, 3, seed) as group:
            await asyncio.to_thread(server.end, signal.SIGKILL)
            stood = last_timesteps(server.database)
            for _ in range(tries):
                starting = asyncio.create_task(asyncio.to_thread(_try_to_start, server))
                await asyncio.sleep(chance.uniform(0.05, 5.0))
                await asyncio.to_thread(server.end, signal.SIGKILL)
                await starting
            began = time.monotonic()
            await asyncio.to_thread(server.start)
            await group.moving(began)
        await asyncio.to_thread(server.end, signal.SIGTERM)
        found = held_against(server.database, group.clients, silence_s=10)
    went_back = [episode for episode, last in stood.items() if last_timesteps(server.database)[episode] < last]
    figure = found.figures() | {"went_back": len(went_back), "seed": seed}
    return FaultResult(3, "kill -9 while starting", tries, found.ok and not went_back, figure)


def _try_to_start(server: RealServer) -> None:
    with suppress(AssertionError):  # killed before it could be opened, as it is meant to be
        server.start()


async def worker_kills(folder: Path, tries: int, games: int) -> FaultResult:
    """Row 24: the process that runs the models is killed under the games; none ends."""
    gone: list[float] = []
    with RealServer(folder, speed=1.0, study=LONG_STUDY) as server:
        async with ClientGroup(server.url, games, idle=0.9) as group:
            for _ in range(tries):
                before = set(children(server.pid))
                await asyncio.sleep(4.0)  # a spare is there
                killed = time.monotonic()
                _kill_a_model_worker(server.pid)
                await asyncio.sleep(2.0)
                await group.moving(time.monotonic())
                gone.append(await _late_until(server.database, killed))
                assert before
        found = held_against(server.database, group.clients)
        aborted = [one for client in group.clients for one in client.log.ended]
    figure = found.figures() | {"games_ended": len(aborted), "without_models_most_s": rounded(max(gone))}
    passed = found.ok and not aborted and max(gone) <= 1.0
    return FaultResult(24, "model worker killed", tries, passed, figure)


def _kill_a_model_worker(pid: int) -> None:
    """The one that answers: the oldest."""
    os.kill(min(filter(_is_model_worker, children(pid))), signal.SIGKILL)


def _is_model_worker(pid: int) -> bool:
    try:
        return b"models.inference.worker" in Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:  # it is gone
        return False


async def _late_until(url: str, _killed: float) -> float:
    """Seconds of game time in which the partner had to wait, of the worst game, in the last 20 timesteps."""
    query = select(ticks.c.episode_id, ticks.c.timestep, ticks.c.late).order_by(ticks.c.episode_id, ticks.c.timestep)
    with Database(url, read_only=True) as database:
        rows = database.read_now(lambda connection: connection.execute(query).all())
    worst = 0
    for episode in {row.episode_id for row in rows}:
        worst = max(worst, sum(row.late for row in [one for one in rows if one.episode_id == episode][-20:]))
    return worst * 0.2


SOAK_STUDY = LONG_STUDY.replace("horizon: 10000", "horizon: 400")
MIN_SAMPLES = 2  # one early, one late
MAX_GROWTH = 0.1  # of its memory: what a server may hold more at the end of a soak than when its caches had filled
WARM_S = 1200.0  # by then a database of some hundred megabytes has filled SQLite's caches, 64 MiB a connection


async def soak(folder: Path, seconds: float, games: int) -> FaultResult:
    """Row 28: all seats are always taken, one person after the other plays a whole study, and others leave in the
    middle of a game; memory and open files of the server and its models stay where they are, and when all have gone
    no socket of theirs is left."""
    ends = time.monotonic() + seconds
    people: list[RecordingClient] = []
    samples: list[Holdings] = []
    gc.disable()  # millions of journal entries are not garbage; scanning them would delay the clients
    with RealServer(folder, speed=1.0, study=SOAK_STUDY) as server:
        alone = await settled(server.pid)
        seats = [asyncio.create_task(_one_after_the_other(server.url, people, ends)) for _ in range(games)]
        await asyncio.sleep(min(30.0, seconds / 4))
        while time.monotonic() < ends or len(samples) < MIN_SAMPLES:  # a busy machine is slow to get to a game
            await _leaves_in_the_middle(server.url, people, min(5.0, seconds / 10))
            samples.append(_held_by(server.pid))
        await asyncio.gather(*seats)
        left = await sockets_beyond(alone.sockets, server.pid)
        await asyncio.to_thread(server.end, signal.SIGTERM)
        found = held_against(server.database, people, silence_s=10)
    gc.enable()
    warm = samples[int(len(samples) * min(0.5, WARM_S / seconds)) :]
    early, late = warm[: len(warm) // 4 + 1], warm[-(len(warm) // 4 + 1) :]
    rss_mib = min(one.rss_kib for one in early) / 1024
    grown_mib = min(one.rss_kib for one in late) / 1024 - rss_mib
    left += max(0, min(one.files for one in late) - min(one.files for one in early))
    done = sum(person.log.code is not None for person in people)
    figure = found.figures() | {"seconds": seconds, "games": games, "participants": len(people)}
    figure |= {"walked_to_the_end": done, "descriptors_left": left, "grown_mib": rounded(grown_mib)}
    figure |= {"rss_mib": [round(one.rss_kib / 1024) for one in samples[:: len(samples) // 12 + 1]]}
    passed = found.ok and left <= 0 and grown_mib <= MAX_GROWTH * rss_mib
    return FaultResult(28, "soak with people who come and go", len(people), passed, figure)


async def _one_after_the_other(url: str, people: list[RecordingClient], ends: float) -> None:
    while time.monotonic() < ends:
        person = RecordingClient(url, "short", len(people))
        person.idle = 0.9
        people.append(person)
        await person.to_the_game()
        await person.walk_on()
        await person.close()


async def _leaves_in_the_middle(url: str, people: list[RecordingClient], after_s: float) -> None:
    person = RecordingClient(url, "short", len(people))
    people.append(person)
    await person.to_the_game()
    playing = asyncio.create_task(person.game().play())
    await asyncio.sleep(after_s)
    playing.cancel()
    await asyncio.gather(playing, return_exceptions=True)
    await person.close()


async def settled(pid: int) -> Holdings:
    """What a server that has just started holds, once its spare model worker is there."""
    await asyncio.sleep(SPARE_AFTER_S + 3)
    return _held_by(pid)


async def sockets_beyond(before: int, pid: int, within_s: float = 60.0) -> int:
    """How many sockets the server keeps of people who have all gone, however many came and went together before."""
    until = time.monotonic() + within_s
    while (left := _held_by(pid).sockets - before) > 0 and time.monotonic() < until:
        await asyncio.sleep(0.5)
    return max(0, left)


def _held_by(pid: int) -> Holdings:
    """By the server and the models' processes together."""
    each = [Holdings.of(one) for one in (pid, *filter(_is_model_worker, children(pid)))]
    return Holdings(*(sum(getattr(one, name) for one in each) for name in ("descriptors", "sockets", "rss_kib")))
