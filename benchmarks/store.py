"""How many ticks a second the database commits, how long a commit takes, and how long an export takes.

    python benchmarks/store.py [--database URL] [--quick] [--json]

Without --database: SQLite in a temporary folder, and a separate PostgreSQL server (both wait for the disk at every
commit). "alone": one slot after the other, as many ticks in a commit as the slot has games. "slots": 5 slots of 120
games that write at once, as 600 live games do. Pinned to one core; PostgreSQL's processes are elsewhere.
"""

import argparse
import asyncio
import json
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from server.export.writer import export  # noqa: E402
from server.play.episode_spec import EpisodeSpec  # noqa: E402
from server.play.recorder import EpisodeResult, KeyRecord, TickRecord  # noqa: E402
from server.store import episodes, participants, studies  # noqa: E402
from server.store.database import Database  # noqa: E402
from server.store.migrate import migrate  # noqa: E402
from server.store.store_recorder import StoreRecorder  # noqa: E402

GAMES = (1, 10, 30, 100)
SLOTS, SLOT_GAMES = 5, 120
COMMITS = 240
PEOPLE, PER_PERSON, TIMESTEPS = 100, 10, 400
GRID = (ROOT / "overcooked" / "layouts" / "coordination_ring.layout").read_text(encoding="utf-8").strip("\n")
SPEC = EpisodeSpec(
    "episode", 1, 10, "coordination_ring", GRID, "Ring", (None, "sp"), "sp_predictor_window", 1, "predictor", 7
)
PREDICTION = tuple(tuple(float(np.float32(p)) for p in (0.5, 0.1, 0.1, 0.1, 0.1, 0.1)) for _ in range(3))


def tick(episode: str, timestep: int) -> TickRecord:
    """Return a tick of a usual size."""
    return TickRecord(
        episode=episode,
        timestep=timestep,
        actions=(timestep % 6, 4) if timestep else None,
        state_hash=f"{timestep:016x}",
        rewards=(0, 0),
        shaped=(0, 3),
        events=(1, 2),
        next_actions=(None, 4),
        prediction=PREDICTION,
        displayed=((0, 100), (4, 85), (5, 70)),
        keys=(KeyRecord(0, timestep, 1e5 + timestep * 200.1, timestep * 200.2),),
        scheduled_ms=timestep * 200.0,
        late_ms=0.123,
        models_ms=4.567,
        late=False,
    )


async def new_episodes(database: Database, count: int) -> list[str]:
    new = episodes.NewEpisode(SPEC, "episode-01")
    return list(await asyncio.gather(*(database.write(episodes.create, new) for _ in range(count))))


async def alone(database: Database, games: int) -> dict[str, Any]:
    """Commit after commit, a tick of each game in every one."""
    played = await new_episodes(database, games)
    slots = [[tick(episode, timestep) for episode in played] for timestep in range(COMMITS)]
    return await measured(database, "alone", games, [slots])


async def slots(database: Database) -> dict[str, Any]:
    """Write many slots at once: those that wait share a commit."""
    played = [await new_episodes(database, SLOT_GAMES) for _ in range(SLOTS)]
    work = [[[tick(episode, timestep) for episode in slot] for timestep in range(COMMITS // 3)] for slot in played]
    return await measured(database, "slots", SLOTS * SLOT_GAMES, work)


async def measured(database: Database, what: str, games: int, work: list[list[list[TickRecord]]]) -> dict[str, Any]:
    recorder = StoreRecorder(database, patience_s=60)
    waits: list[float] = []

    async def write(batches: list[list[TickRecord]]) -> None:
        for batch in batches:
            began = time.perf_counter()
            await recorder.ticks(batch)
            waits.append(time.perf_counter() - began)

    began, cpu = time.perf_counter(), time.process_time()
    await asyncio.gather(*(write(batches) for batches in work))
    wall, cpu = time.perf_counter() - began, time.process_time() - cpu
    count = sum(len(batch) for batches in work for batch in batches)
    p50, p99 = np.percentile(waits, [50, 99]) * 1000
    return {
        "what": what,
        "games": games,
        "ticks_per_s": round(count / wall),
        "wait_p50_ms": round(p50, 2),
        "wait_p99_ms": round(p99, 2),
        "cpu_us_per_tick": round(cpu / count * 1e6, 1),
    }


def fill_study(database: Database) -> None:
    """Store a study of 100 people with 10 episodes each."""

    def person(connection: Any, study_id: int, number: int) -> None:
        from server.store import ticks

        new = participants.NewParticipant(study_id, "tom", number, participants.new_token())
        participant = participants.create(connection, new).id
        for step in range(PER_PERSON):
            drawn = episodes.NewEpisode(SPEC, f"episode-{step:02d}", (participant, None), study_id, "tom")
            episode = episodes.create(connection, drawn)
            ticks.insert(connection, [tick(episode, timestep) for timestep in range(TIMESTEPS + 1)])
            episodes.end(connection, EpisodeResult(episode, "done", "horizon", 0, 0, 0.0, True, "0" * 16))

    study = database.write_now(studies.register, "study", "name: study")
    for number in range(PEOPLE):
        database.write_now(person, study.id, number)


def export_time(database: Database, folder: Path) -> dict[str, Any]:
    fill_study(database)
    began = time.perf_counter()
    summary = database.read_now(export, folder / "export", ("csv", "parquet"), "study")
    return {"what": "export", "ticks": summary.rows["ticks"], "seconds": round(time.perf_counter() - began, 2)}


def measure(url: str, folder: Path) -> Iterator[dict[str, Any]]:
    migrate(url)
    with Database(url) as database:
        kind = {"database": database.url.get_backend_name()}
        for games in GAMES:
            yield kind | asyncio.run(alone(database, games))
        yield kind | asyncio.run(slots(database))
        yield kind | export_time(database, folder / kind["database"])


def main() -> None:
    parser = argparse.ArgumentParser(
        allow_abbrev=False, description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--database", metavar="URL", help="an empty database to fill")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--quick", action="store_true", help="few commits: rough figures")
    arguments = parser.parse_args()
    if arguments.quick:
        globals()["COMMITS"] = 12
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="kitchenmind-store-")))
        urls = [arguments.database] if arguments.database else [f"sqlite:///{folder}/study.db"]
        if not arguments.database:
            from tests.support.postgres_server import PostgresServer

            server = PostgresServer(durable=True)
            stack.callback(server.remove)
            urls.append(server.url())
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
        results = []
        for result in (result for url in urls for result in measure(url, folder)):
            results.append(result)
            if not arguments.json:
                print("  ".join(f"{name} {value}" for name, value in result.items()), flush=True)
    if arguments.json:
        print(json.dumps(results))


if __name__ == "__main__":
    main()
