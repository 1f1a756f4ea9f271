"""How long `kitchenmind export` takes and how much memory, for studies of growing size.

`python benchmarks/export.py [--people 100 1000] [--json]`: people with 10 episodes of 400 timesteps each, in SQLite,
exported as CSV and Parquet by the command itself in a separate process, whose largest memory is read afterwards.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.store import PEOPLE, fill_study  # noqa: E402
from server.store.database import Database  # noqa: E402
from server.store.migrate import migrate  # noqa: E402

_TABLES = ("participants", "episodes", "ticks")
_KEYS = {"participants": ("id", "token_hash"), "episodes": ("id", "participant_0"), "ticks": ("episode_id",)}


def fill(database: Database, people: int) -> None:
    """Store 100 people as the store's benchmark makes them, and copies of them with ids of their own."""
    fill_study(database)
    for copy in range(1, people // PEOPLE):
        database.write_now(_copy, copy)


def _copy(connection: Any, copy: int) -> None:
    for table in _TABLES:
        columns = [row[1] for row in connection.exec_driver_sql(f"pragma table_info({table})")]
        chosen = ", ".join(_copied(table, column, copy) for column in columns)
        first = f"{_KEYS[table][0]} not like '%-%'"
        connection.exec_driver_sql(
            f"insert into {table} ({', '.join(columns)}) select {chosen} from {table} where {first}"
        )


def _copied(table: str, column: str, copy: int) -> str:
    if column in _KEYS[table]:
        return f"{column} || '-{copy}'"
    return f"{column} + {copy * PEOPLE}" if (table, column) == ("participants", "number") else column


def measured(people: int, folder: Path) -> dict[str, Any]:
    """Measure one export."""
    url = f"sqlite:///{folder}/{people}.db"
    migrate(url)
    with Database(url) as database:
        fill(database, people)
    line = [
        sys.executable,
        str(ROOT / "kitchenmind"),
        "export",
        "--database",
        url,
        "--out",
        str(folder / str(people)),
    ]
    began = time.perf_counter()
    child = subprocess.Popen(line, stdout=subprocess.PIPE, text=True)
    assert child.stdout is not None
    output = child.stdout.read()
    if child.wait():
        raise SystemExit("the export failed")
    took = time.perf_counter() - began
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    ticks = next(word for word in output.split(", ") if word.endswith(" ticks")).split()[0]
    return {
        "episodes": people * 10,
        "ticks": int(ticks),
        "seconds": round(took, 1),
        "largest_mb": round(usage.ru_maxrss / 1024),
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        allow_abbrev=False, description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--people", type=int, nargs="+", default=[100, 1000], help=f"multiples of {PEOPLE}, growing")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    results = []
    with tempfile.TemporaryDirectory(prefix="kitchenmind-export-") as folder:
        for people in arguments.people:
            results.append(measured(people, Path(folder)))
            if not arguments.json:
                print("  ".join(f"{name} {value}" for name, value in results[-1].items()), flush=True)
    if arguments.json:
        print(json.dumps(results))


if __name__ == "__main__":
    main()
