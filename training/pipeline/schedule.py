"""Run a graph of tasks, in a few processes at a time on this machine or on a Ray cluster, and show a table of the
progress.

A task always runs in a separate process, from the same command line, so a task that was killed can be started again.
"""

import ctypes
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.live import Live
from rich.table import Table

from training.pipeline.study_tasks import Graph

_LOOK_S = 1.0
_DIE_WITH_PARENT = 1  # prctl's PR_SET_PDEATHSIG
_TRIES = 3  # of a task whose process died


def run_task(graph: Graph, label: str, kept: Path | None = None) -> int:
    """Run one task in this process, which ends when its parent ends: two processes must never run the same task. Its
    results are also copied to `kept`."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGKILL)
    graph.run(label)
    if kept is not None:
        graph.keep(label, kept)
    return 0


def show_plan(graph: Graph) -> int:
    """Print every task with its state and expected time."""
    Console().print(_table(graph, set(), Counter()))
    return 0


def run_here(graph: Graph, command: Sequence[str], workers: int) -> int:
    """Run all tasks, `workers` at once, each in a process; return 1 if one failed for good."""
    running: dict[str, subprocess.Popen[bytes]] = {}
    failures: Counter[str] = Counter()
    with Live(_table(graph, set(), failures), refresh_per_second=1, transient=False) as live:
        try:
            while _more(graph, running, failures):
                _collect(running, failures)
                for label in graph.tasks:
                    if len(running) >= workers:
                        break
                    if label not in running and failures[label] < _TRIES and graph.ready(label):
                        running[label] = _start(graph, label, command)
                live.update(_table(graph, set(running), failures))
                time.sleep(_LOOK_S)
        finally:
            for process in running.values():
                process.terminate()
    return 1 if any(not graph.done(label) for label in graph.tasks) else 0


def run_on_ray(graph: Graph, command: Sequence[str], address: str, workers: int) -> int:
    """Return the same on a Ray cluster whose machines share the runs folder; a lost worker's task is started again."""
    try:
        import ray
    except ImportError as error:
        raise ValueError("--ray needs Ray: pip install ray") from error
    place = {"num_cpus": workers, "include_dashboard": False} if address == "local" else {"address": address}
    ray.init(**place, log_to_driver=False)
    remote = ray.remote(num_cpus=1, max_retries=0)(_in_a_process)
    waiting: dict[object, str] = {}
    failures: Counter[str] = Counter()
    try:
        with Live(_table(graph, set(), failures), refresh_per_second=1) as live:
            while _more(graph, waiting.values(), failures):
                for label in graph.tasks:
                    if label not in waiting.values() and failures[label] < _TRIES and graph.ready(label):
                        waiting[remote.remote(_command(label, command), str(graph.log(label)))] = label
                finished, _ = ray.wait(list(waiting), timeout=_LOOK_S)
                for reference in finished:
                    label = waiting.pop(reference)
                    failures[label] += not _succeeded(ray, reference)
                live.update(_table(graph, set(waiting.values()), failures))
    finally:
        ray.shutdown()
    return 1 if any(not graph.done(label) for label in graph.tasks) else 0


def _succeeded(ray: object, reference: object) -> bool:
    try:
        return int(ray.get(reference)) == 0  # type: ignore[attr-defined]
    except Exception:  # noqa: BLE001 - whatever happened to the worker, the task is tried again
        return False


def _more(graph: Graph, running: object, failures: Counter[str]) -> bool:
    """Return whether anything runs or could be started."""
    startable = any(failures[label] < _TRIES and graph.ready(label) for label in graph.tasks)
    return bool(running) or startable


def _collect(running: dict[str, subprocess.Popen[bytes]], failures: Counter[str]) -> None:
    for label, process in list(running.items()):
        if process.poll() is not None:
            failures[label] += process.returncode != 0
            del running[label]


def _command(label: str, command: Sequence[str]) -> list[str]:
    return [sys.executable, "-m", "kitchenmind", "train", "study", *command, "--task", label]


def _start(graph: Graph, label: str, command: Sequence[str]) -> subprocess.Popen[bytes]:
    log = graph.log(label)
    with log.open("ab") as file:
        return subprocess.Popen(  # noqa: S603 - our own command
            _command(label, command), stdout=file, stderr=subprocess.STDOUT, env={**os.environ, "OMP_NUM_THREADS": "1"}
        )


def _in_a_process(command: list[str], log: str) -> int:
    """Run the task of a Ray worker in its own process, so that nothing survives a kill."""
    with Path(log).open("ab") as file:
        return subprocess.run(  # noqa: S603 - our own command
            command, stdout=file, stderr=subprocess.STDOUT, check=False, env={**os.environ, "OMP_NUM_THREADS": "1"}
        ).returncode


def _table(graph: Graph, running: set[str], failures: Counter[str]) -> Table:
    """Draw tasks by state: those that run or failed are listed, the others counted."""
    shares = {label: graph.share(label) for label in graph.tasks}
    left = sum(task.cost * (1 - shares[label]) for label, task in graph.tasks.items())
    done = sum(share == 1 for share in shares.values())
    table = Table(title=f"{done} of {len(shares)} tasks done, about {left:.0f} core minutes left")
    for heading in ("task", "state", "done", "minutes left"):
        table.add_column(heading)
    for label, task in graph.tasks.items():
        state = _state(graph, label, running, failures)
        remaining = task.cost * (1 - shares[label])
        table.add_row(label, state, f"{shares[label]:.0%}", f"{remaining:.1f}" if remaining else "")
    return table


def _state(graph: Graph, label: str, running: set[str], failures: Counter[str]) -> str:
    if graph.done(label):
        return "done"
    if label in running:
        return "running"
    if failures[label]:
        return f"failed {failures[label]}x: {graph.log(label)}"
    return "ready" if graph.ready(label) else "waiting"
