"""Whether PostgreSQL can store the ticks of many games at once: python benchmarks/write_path.py [--games 10000]
[--json].

Several processes, each with a connection of its own as server processes have, store one tick a game every 200 ms, with
the check of who owns each game in every transaction. The server is one of our own with fsync on, in a temporary folder,
or the empty database of --database. Prints the rate that was reached and how long commits took; a rate below 5 ticks
per game and second means that this machine cannot run so many games.
"""

import argparse
import json
import multiprocessing
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from sqlalchemy import text

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.store import SPEC, tick  # noqa: E402
from server.store import episodes, fences  # noqa: E402
from server.store.database import Database  # noqa: E402
from server.store.migrate import migrate  # noqa: E402

TICK_S = 0.2
_SIZE = "SELECT pg_total_relation_size('ticks'), count(*) FROM ticks"
SLOTS = 20  # a process commits in so many parts of a tick


def games_of(database: Database, count: int) -> dict[str, int]:
    """Return new games and the fences with which they are owned."""
    new = episodes.NewEpisode(SPEC, "episode-01")

    def make(connection: Any) -> dict[str, int]:
        made = [episodes.create(connection, new) for _ in range(count)]
        taken = {episode: fences.take(connection, episode) for episode in made}
        return {episode: found[0] for episode, found in taken.items() if found is not None}

    return database.write_now(make)


def one_process(url: str, games: int, timesteps: int, begin: Any, results: Any) -> None:
    """Store its games' ticks, each slot at its time, or as fast as possible."""
    with Database(url, shared=True, readers=1) as database:
        owned = games_of(database, games)
        names = list(owned)
        slots = [names[slot::SLOTS] for slot in range(SLOTS)]
        begin.wait()
        began, waits, late = time.perf_counter(), [], 0.0
        for timestep in range(timesteps):
            for number, slot in enumerate(slots):
                due = began + (timestep + number / SLOTS) * TICK_S
                time.sleep(max(0.0, due - time.perf_counter()))
                asked = time.perf_counter()
                records = [tick(episode, timestep) for episode in slot]
                database.write_now(fences.store_ticks, records, {episode: owned[episode] for episode in slot})
                waits.append(time.perf_counter() - asked)
                late = max(late, time.perf_counter() - due)
        results.put((games * timesteps, time.perf_counter() - began, waits, late))


def measure(url: str, games: int, processes: int, timesteps: int) -> dict[str, Any]:
    """Return the rate and the waits of all processes together."""
    begin, results = multiprocessing.Barrier(processes), multiprocessing.Queue()
    share = games // processes
    running = [
        multiprocessing.Process(target=one_process, args=(url, share, timesteps, begin, results))
        for _ in range(processes)
    ]
    for process in running:
        process.start()
    found = [results.get() for _ in running]
    for process in running:
        process.join()
    with Database(url, read_only=True, readers=1) as database:
        size, rows = database.read_now(lambda connection: connection.execute(text(_SIZE)).one())
    waits = np.concatenate([waits for _, _, waits, _ in found]) * 1000
    wall = max(took for _, took, _, _ in found)
    stored = sum(count for count, _, _, _ in found)
    return {
        "games": share * processes,
        "processes": processes,
        "ticks": stored,
        "ticks_per_s": round(stored / wall),
        "wanted_per_s": round(share * processes / TICK_S),
        "commit_p50_ms": round(float(np.percentile(waits, 50)), 1),
        "commit_p99_ms": round(float(np.percentile(waits, 99)), 1),
        "bytes_per_tick": round(size / rows),
        "behind_s": round(max(late for _, _, _, late in found), 2),
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        allow_abbrev=False, description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--games", type=int, nargs="+", default=[10_000])
    parser.add_argument("--processes", type=int, default=4)
    parser.add_argument("--timesteps", type=int, default=40)
    parser.add_argument("--database", metavar="URL", help="an empty PostgreSQL database to fill")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    with ExitStack() as stack:
        url = arguments.database
        if url is None:
            from tests.support.postgres_server import PostgresServer

            server = PostgresServer(durable=True)
            stack.callback(server.remove)
            url = server.url()
        migrate(url)
        found = [measure(url, games, arguments.processes, arguments.timesteps) for games in arguments.games]
    if arguments.json:
        print(json.dumps(found))
        return
    for row in found:
        print("  ".join(f"{name} {value}" for name, value in row.items()))


if __name__ == "__main__":
    main()
