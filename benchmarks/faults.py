"""Measure the rows of docs/explanation/faults.md: cause each fault, and compare what participants saw with the
database.

    python benchmarks/faults.py [--quick] [--json] [--rows 1,5,12] [--kills N] [--seed N] [--kill-seconds S]

Needs what the tests need; row 6 is left out without strace, row 7 without the right to mount. Run it on a quiet
machine: rows 1, 10, 19 and 27 measure times.
"""

import argparse
import asyncio
import json
import os
import shutil
import sys
import tempfile
import traceback
from collections.abc import Awaitable, Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import TextIO

ROOT = Path(__file__).resolve().parent.parent
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("NUMBA_NUM_THREADS", "1")
sys.path.insert(0, str(ROOT))

from tests.support.faults import abuse_scenarios as abuse  # noqa: E402
from tests.support.faults import database_scenarios as database  # noqa: E402
from tests.support.faults import line_scenarios as line  # noqa: E402
from tests.support.faults import model_scenarios as model  # noqa: E402
from tests.support.faults import people_scenarios as people  # noqa: E402
from tests.support.faults import process_scenarios as process  # noqa: E402
from tests.support.faults.fault_scenario import FaultResult  # noqa: E402

Scenario = Callable[[Path], FaultResult | Awaitable[FaultResult]]
KILLS_AT_ONCE = 100  # with one database; then the next seed begins with an empty one
SHIFT_MS = 2.0  # a fault in one game may move the others' 99th percentile by less


def scenarios(quick: bool, kills: int, kill_s: float, first: int) -> Iterator[tuple[int, Scenario]]:
    """Return the scenario of each row; `quick`: a short run of each."""
    q = quick
    for seed, start in enumerate(range(0, kills, KILLS_AT_ONCE), start=first):
        count = min(KILLS_AT_ONCE, kills - start)
        yield 1, partial(process.kills, tries=count, games=50, seed=seed, budget_s=kill_s)
    yield 2, lambda folder: process.stops(folder, 1 if q else 5, 10 if q else 100)
    yield 3, lambda folder: process.kills_while_starting(folder, 2 if q else 20)
    yield 4, lambda folder: database.power_cuts(folder, 200 if q else 10_000, seed=1)
    yield 5, lambda folder: database.postgres_frozen(folder, 3 if q else 30)
    yield 5, lambda folder: database.postgres_killed(folder, 3)
    if shutil.which("strace"):
        yield 6, lambda folder: database.sync_fails(folder, 3)
    if database.can_mount():
        yield 7, lambda folder: database.disk_full(folder, 3)
    yield 8, lambda folder: database.locked(folder, 2 if q else 10)
    yield 9, lambda folder: line.slow_reader(folder, 5 if q else 30)
    yield 10, lambda folder: line.half_open(folder, 1 if q else 20)
    yield 11, lambda folder: line.hard_resets(folder, 5 if q else 100, 3)
    yield 12, lambda folder: line.reconnects(folder, 100 if q else 1000)
    yield 12, lambda folder: line.herd(folder, 20 if q else 150)
    yield 16, lambda folder: line.rough_weather(folder, 5 if q else 30)
    yield 17, lambda folder: line.stutter(folder, 3 if q else 20)
    yield 18, lambda _: abuse.decoder(20_000 if q else 1_000_000)
    yield 18, lambda folder: abuse.frames(folder, 400 if q else 20_000)
    yield 19, lambda folder: abuse.flood(folder, 3 if q else 15, SHIFT_MS)
    yield 19, lambda folder: abuse.neighbours(folder, 6 if q else 20, 10, SHIFT_MS)
    yield 20, lambda folder: abuse.idle_connections(folder, 200 if q else 5000, b"")
    yield 23, lambda folder: model.faulty(folder, "Slow", 3 if q else 10)
    yield 24, lambda folder: model.faulty(folder, "SometimesNothing", 3 if q else 10)
    yield 24, lambda folder: process.worker_kills(folder, 1 if q else 10, 5)
    yield 25, lambda folder: people.clock_jumps(folder, 0.3)
    yield 26, database.second_server
    yield 27, lambda folder: people.busy_dashboard(folder, 5 if q else 20, 10, SHIFT_MS)
    yield 28, lambda folder: process.soak(folder, 20 if q else 3600, 20 if q else 250)
    yield 29, people.withdrawal
    yield 30, lambda folder: people.last_page(folder, 10 if q else 1000)


def measure(quick: bool, rows: set[int], kills: int, kill_s: float, first: int) -> Iterator[FaultResult]:
    for number, scenario in scenarios(quick, kills, kill_s, first):
        if rows and number not in rows:
            continue
        with tempfile.TemporaryDirectory(prefix="kitchenmind-faults-") as folder:
            try:
                row = asyncio.run(_done(scenario, Path(folder)))
            except Exception as error:  # noqa: BLE001 - a row that raises counts as failed; the others still run
                traceback.print_exc()
                row = FaultResult(
                    number, "the scenario itself failed", 0, False, {"error": f"{type(error).__name__}: {error}"}
                )
        yield row


async def _done(scenario: Scenario, folder: Path) -> FaultResult:
    made = scenario(folder)
    return made if isinstance(made, FaultResult) else await made


def main() -> int:
    parser = argparse.ArgumentParser(
        allow_abbrev=False, description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="a short run of every row, a few minutes")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--rows", default="", help="only these, separated by commas")
    parser.add_argument("--kills", type=int, help="how many kills in row 1 (1000; quick: 3)")
    parser.add_argument(
        "--seed", type=int, default=1, help="of the first hundred kills; each further hundred has the next"
    )
    parser.add_argument("--kill-seconds", type=float, default=1e9, help="stop killing after this long, each hundred")
    arguments = parser.parse_args()
    rows = {int(number) for number in arguments.rows.split(",") if number}
    kills = arguments.kills or (3 if arguments.quick else 1000)
    sys.stdout, stdout = sys.stderr, sys.stdout  # servers of this process print their address
    found = measure(arguments.quick, rows, kills, arguments.kill_seconds, arguments.seed)
    return 0 if printed(found, stdout, arguments.json) else 1


def printed(found: Iterable[FaultResult], to: TextIO, as_json: bool) -> bool:
    """Print every row as soon as it is done, with `as_json` as items of one JSON list; return whether all passed."""
    passed, first = True, True
    for row in found:
        passed &= row.passed
        if as_json:
            line = ("[" if first else ",\n ") + json.dumps(row.as_json())
        else:
            figures = "  ".join(f"{name} {value}" for name, value in row.figure.items())
            line = f"{row.row:2}  {'ok  ' if row.passed else 'FAIL'}  {row.fault} x {row.tries}:  {figures}\n"
        print(line, end="", file=to, flush=True)
        first = False
    if as_json:
        print("[]" if first else "]", file=to, flush=True)
    return passed


if __name__ == "__main__":
    sys.exit(main())
