"""What a fresh `make serve` takes: seconds until the page answers, megabytes on disk, memory of the running processes.

    python benchmarks/installation.py [--in FOLDER] [--json]

Clones this checkout's last commit into a temporary folder and runs `make serve` there. pip installs from its cache if
the packages were downloaded before. `--in FOLDER` installs nothing and starts the server of another checkout (or of
this one: `--in .`) with this Python.
"""

import argparse
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from dataclasses import asdict, dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.processor import described  # noqa: E402

MAX_S = 900.0
MEGA = 1_000_000


@dataclass
class Installation:
    """One start from nothing."""

    processor: str
    page_after_s: float
    installed_mb: float  # files in .venv, without what Python compiled while it ran
    compiled_mb: float
    memory_mb: float  # of the server and its model workers; shared pages count once


def main() -> None:
    parser = argparse.ArgumentParser(allow_abbrev=False, description=__doc__)
    parser.add_argument("--in", dest="folder", type=Path, help="start this checkout's server, without an installation")
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        checkout = arguments.folder or Path(folder) / "clone"
        if arguments.folder is None:
            subprocess.run(["git", "clone", "--quiet", ROOT, checkout], check=True)
        found = measured(checkout, Path(folder) / "study.db", arguments.folder is not None)
    if arguments.json:
        print(json.dumps(asdict(found)))
        return
    print(found.processor)
    print(f"page after {found.page_after_s:.1f} s, memory {found.memory_mb:.0f} MB")
    print(f".venv: {found.installed_mb:.0f} MB installed, {found.compiled_mb:.0f} MB compiled since")


def measured(checkout: Path, database: Path, is_installed: bool) -> Installation:
    """Start the server of a checkout, wait for its page, and measure."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    options = f"--port {port} --database sqlite:///{database}"
    command = [sys.executable, "-m", "kitchenmind", "serve", *options.split()]
    if not is_installed:
        command = ["make", "serve", f"ARGS={options}"]
    began = time.monotonic()
    process = subprocess.Popen(
        command, cwd=checkout, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        wait_for_page(f"http://127.0.0.1:{port}/", began)
        seconds = time.monotonic() - began
        time.sleep(3)  # the model workers have loaded what they keep
        memory = sum(map(memory_of, processes_of(process.pid)))
    finally:
        os.killpg(process.pid, signal.SIGTERM)
        process.wait()
    compiled, others = sizes(checkout / ".venv")
    return Installation(described(), seconds, others, compiled, memory)


def wait_for_page(url: str, began: float) -> None:
    while time.monotonic() - began < MAX_S:
        try:
            with urllib.request.urlopen(url, timeout=5):
                return
        except OSError:
            time.sleep(0.05)
    raise SystemExit(f"{url} did not answer within {MAX_S:g} s")


def processes_of(session: int) -> list[int]:
    """Return the processes of a session that run Python."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
            if int(fields[3]) == session and b"python" in (folder / "cmdline").read_bytes():
                found.append(int(folder.name))
        except OSError:
            continue
    return found


def memory_of(pid: int) -> float:
    """Return a process's memory; pages that several share count for each in proportion."""
    text = Path(f"/proc/{pid}/smaps_rollup").read_text()
    return int(text.partition("\nPss:")[2].split()[0]) * 1024 / MEGA


def sizes(environment: Path) -> tuple[float, float]:
    """Return the megabytes of compiled Python and of all other files."""
    compiled = others = 0
    for file in environment.rglob("*"):
        if file.is_file() and not file.is_symlink():
            if file.suffix == ".pyc":
                compiled += file.stat().st_size
            else:
                others += file.stat().st_size
    return compiled / MEGA, others / MEGA


if __name__ == "__main__":
    main()
