"""How long processes take to start: the first step of a game, commands, a server until its page can be opened.

    python benchmarks/startup.py [--turns N] [--only WORD] [--against FOLDER] [--json]

Prints for each process the shortest wall time and the least processor time (user and system, with its children) of all
turns, and how many modules it imports. The first turn, which fills caches, does not count. `--against FOLDER` starts
each process of another checkout in turn with this one's and adds the ratio: only such pairs can be compared on a
machine that runs other programs.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.engine import FIRST_STEP  # noqa: E402
from benchmarks.processor import described  # noqa: E402
from benchmarks.support.process_cpu import cpu_s  # noqa: E402
from server.bots.local_server import LOCAL  # noqa: E402
from server.store.migrate import migrate  # noqa: E402

STUDY = "studies/quick_look.yaml"
WORKER = "import sys; sys.argv[1:] = ['worker', '0']\nimport models.inference.worker"
COMMANDS = {
    "Python alone": ["-c", "pass"],
    "numpy": ["-c", "import numpy"],
    "first step of a game": ["-c", FIRST_STEP, "coordination_ring"],
    "model worker, imports": ["-c", WORKER],
    "server, imports": ["-c", "import server.main, uvicorn"],
    "--help": ["kitchenmind", "--help"],
    "study check": ["kitchenmind", "study", "check", STUDY],
    "doctor": ["kitchenmind", "doctor"],
    "admin list": ["kitchenmind", "admin", "list", "--database", "DATABASE"],
    "export": ["kitchenmind", "export", "--out", "OUT", "--database", "DATABASE"],
    "verify": ["kitchenmind", "verify", "--database", "DATABASE"],
    "bots, refused": ["kitchenmind", "bots", "1", "--study", "none.yaml"],
}
READY, STOPPED = "server until its page is ready", "server, start and stop"


@dataclass
class Turn:
    """One start of one process."""

    wall_s: float
    cpu_s: float


@dataclass
class StartupFigures:
    """All turns of one process. `ratio`: its processor time as a share of the other checkout's."""

    process: str
    wall_s: float
    cpu_s: float
    modules: int | None
    other_cpu_s: float | None = None
    ratio: float | None = None


def environment() -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("KITCHENMIND_", "PYTHON"))}
    return kept | LOCAL | {"KITCHENMIND_SECRET": "a secret of the benchmark, long enough"}


def run_to_its_end(folder: Path, words: list[str]) -> Turn:
    """Start a process in the checkout `folder` and wait for its end, whatever its exit status is."""
    began = time.perf_counter()
    null = subprocess.DEVNULL
    process = subprocess.Popen([sys.executable, *words], cwd=folder, env=environment(), stdout=null, stderr=null)
    used = os.wait4(process.pid, 0)[2]
    return Turn(time.perf_counter() - began, used.ru_utime + used.ru_stime)


def serve(folder: Path, database: str) -> list[Turn]:
    """Start a server and stop it as soon as its page can be opened; return both times."""
    words = [sys.executable, "kitchenmind", "serve", "--port", "0", "--study", STUDY, "--database", database]
    began = time.perf_counter()
    with subprocess.Popen(words, cwd=folder, env=environment(), stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        while "http://" not in process.stdout.readline():
            if process.poll() is not None:
                raise SystemExit("the server does not start")
        ready = Turn(time.perf_counter() - began, cpu_s(process.pid) + sum(map(cpu_s, children_of(process.pid))))
        process.terminate()
        process.stdout.read()
        used = os.wait4(process.pid, 0)[2]
        process.returncode = 0
    return [ready, Turn(time.perf_counter() - began, used.ru_utime + used.ru_stime)]


def children_of(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def modules_of(words: list[str]) -> int:
    """Count the modules that a process imports before it ends."""
    process = subprocess.run(
        [sys.executable, "-X", "importtime", *words], cwd=ROOT, env=environment(), capture_output=True, text=True
    )
    return len(re.findall(r"(?m)^import time: +\d", process.stderr))


def measure(folders: list[Path], turns: int, start: Callable[[Path], list[Turn]]) -> list[list[Turn]]:
    """Start the process of every checkout in turn; return for each what it can do at its best."""
    seen: list[list[list[Turn]]] = [[] for _ in folders]
    for turn in range(1 + turns):
        for place, folder in enumerate(folders):
            one = start(folder)
            if turn > 0:
                seen[place].append(one)
    return [
        [Turn(min(one.wall_s for one in part), min(one.cpu_s for one in part)) for part in zip(*each, strict=True)]
        for each in seen
    ]


def figures(names: list[str], best: list[list[Turn]], modules: int | None = None) -> list[StartupFigures]:
    """Return a row for each process; `best`: of each checkout."""
    rows = []
    for place, name in enumerate(names):
        here = best[0][place]
        row = StartupFigures(name, round(here.wall_s, 3), round(here.cpu_s, 3), modules)
        if len(best) > 1:
            other = best[1][place].cpu_s
            row.other_cpu_s, row.ratio = round(other, 3), round(here.cpu_s / other, 2)
        rows.append(row)
    return rows


def starts(folders: list[Path], turns: int, only: str, scratch: Path) -> list[StartupFigures]:
    """Measure every process whose name contains `only`."""
    rows: list[StartupFigures] = []
    database = f"sqlite:///{scratch / 'startup.sqlite3'}"
    migrate(database)
    for name, words in COMMANDS.items():
        if only not in name:
            continue

        def filled(words: list[str] = words) -> list[str]:
            """Start with a new folder."""
            places = {"DATABASE": database, "OUT": f"{tempfile.mkdtemp(dir=scratch)}/export"}
            return [places.get(word, word) for word in words]

        def start(folder: Path, filled: Callable[[], list[str]] = filled) -> list[Turn]:
            return [run_to_its_end(folder, filled())]

        rows += figures([name], measure(folders, turns, start), modules_of(filled()))
    if only in READY or only in STOPPED:
        rows += figures([READY, STOPPED], measure(folders, turns, partial(serve, database=database)))
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(allow_abbrev=False, description=__doc__.split("\n")[0])
    parser.add_argument("--turns", type=int, default=10, help="how often each process is started (10)")
    parser.add_argument("--only", default="", metavar="WORD", help="only processes whose name contains this")
    parser.add_argument("--against", type=Path, metavar="FOLDER", help="another checkout, to compare")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    folders = [ROOT, *([arguments.against.resolve()] if arguments.against else [])]
    with tempfile.TemporaryDirectory() as scratch:
        rows = starts(folders, arguments.turns, arguments.only, Path(scratch))
    if arguments.json:
        print(json.dumps({"processor": described(), "turns": arguments.turns, "starts": [asdict(row) for row in rows]}))
        return
    print(f"{described()}; the best of {arguments.turns} turns")
    print(f"{'':32} {'wall s':>8} {'CPU s':>8} {'modules':>8} {'other':>8} {'ratio':>6}")
    for row in rows:
        compared = "" if row.ratio is None else f" {row.other_cpu_s:>8.3f} {row.ratio:>6.2f}"
        print(f"{row.process:32} {row.wall_s:>8.3f} {row.cpu_s:>8.3f} {row.modules or '':>8}{compared}")


if __name__ == "__main__":
    main()
