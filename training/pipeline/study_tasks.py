"""Everything a study needs as a graph of tasks: each identified by its settings and inputs, run once, resumable.

A task works in a folder named by its key, the hash of its settings and of its inputs' keys: after a change of a
setting, only the tasks that depend on it run again.
"""

import hashlib
import json
import shutil
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

_ONLY_HERE = ("run", "run_*", "games", "log.txt", "progress", "task_done")  # files that a finished task no longer needs
Settings = Mapping[str, Any]
Report = Callable[[float], None]  # the share of the task that is done
Action = Callable[["Work"], None]


@dataclass(frozen=True)
class Task:
    """One step for one layout: `action` fills its folder from the folders of its inputs."""

    layout: str
    name: str
    action: Action
    settings: Settings
    inputs: tuple[str, ...] = ()  # names of tasks of the same layout
    cost: float = 1.0  # about how many minutes of one core, for the remaining time

    @property
    def label(self) -> str:
        return f"{self.layout}/{self.name}"


@dataclass(frozen=True)
class Work:
    """The argument of a task's action."""

    task: Task
    folder: Path
    inputs: Mapping[str, Path]  # name -> folder
    report: Report = field(repr=False)


class Graph:
    """The tasks of a study, in an order in which inputs come first, and their folders under `runs`."""

    def __init__(self, tasks: Iterable[Task], runs: Path) -> None:
        self.runs = runs
        self.tasks: dict[str, Task] = {}
        self.keys: dict[str, str] = {}
        for task in tasks:
            self.tasks[task.label] = task
            inputs = {name: self.keys[f"{task.layout}/{name}"] for name in task.inputs}
            text = json.dumps([task.layout, task.name, dict(task.settings), inputs], sort_keys=True)
            self.keys[task.label] = hashlib.sha256(text.encode()).hexdigest()

    def folder(self, label: str) -> Path:
        """Return the folder in which a task works and leaves its results."""
        task = self.tasks[label]
        return self.runs / task.layout / f"{task.name}-{self.keys[label][:8]}"

    def done(self, label: str) -> bool:
        return (self.folder(label) / "task_done").is_file()

    def ready(self, label: str) -> bool:
        """Return whether a task is not done yet but all its inputs are."""
        task = self.tasks[label]
        return not self.done(label) and all(self.done(f"{task.layout}/{name}") for name in task.inputs)

    def share(self, label: str) -> float:
        """Return the share of a task that is done, 0 to 1."""
        if self.done(label):
            return 1.0
        try:
            return float((self.folder(label) / "progress").read_text())
        except (OSError, ValueError):
            return 0.0

    def log(self, label: str) -> Path:
        """Return the file for the output of a task's process."""
        folder = self.folder(label)
        folder.mkdir(parents=True, exist_ok=True)
        return folder / "log.txt"

    def limited(self, prefixes: Iterable[str]) -> "Graph":
        """Return only the tasks whose names (or layout/names) begin with one of `prefixes`, and their inputs."""
        wanted: set[str] = set()
        for label, task in reversed(self.tasks.items()):
            chosen = any(task.name.startswith(prefix) or label.startswith(prefix) for prefix in prefixes)
            if chosen or label in wanted:
                wanted |= {label, *(f"{task.layout}/{name}" for name in task.inputs)}
        return Graph([task for label, task in self.tasks.items() if label in wanted], self.runs)

    def keep(self, label: str, kept: Path) -> None:
        """Copy the results of a finished task (not its run) to `kept`, a folder that can be copied to another
        machine."""
        task, target = self.tasks[label], kept / label
        new = target.with_name(f"{task.name}.new")
        shutil.rmtree(new, ignore_errors=True)
        shutil.copytree(self.folder(label), new, ignore=shutil.ignore_patterns(*_ONLY_HERE))
        (new / "key").write_text(self.keys[label] + "\n", encoding="utf-8")
        shutil.rmtree(target, ignore_errors=True)
        new.replace(target)

    def keep_finished(self, kept: Path) -> list[str]:
        """Copy the results of finished tasks that `kept` does not have, such as those that were trained before it was
        given; return their labels."""
        known = self.kept_in(kept)
        missing = [label for label in self.tasks if self.done(label) and label not in known]
        for label in missing:
            self.keep(label, kept)
        return missing

    def kept_in(self, kept: Path) -> dict[str, Path]:
        """Return the folder of each task that `keep` copied to `kept` with the same settings and inputs."""
        files = {label: kept / label / "key" for label in self.tasks}
        return {
            label: file.parent
            for label, file in files.items()
            if file.is_file() and file.read_text(encoding="utf-8").strip() == self.keys[label]
        }

    def take_over(self, kept: Path) -> list[str]:
        """Mark tasks as done whose results are in `kept` with the same settings and inputs; return their labels."""
        taken = []
        for label, source in self.kept_in(kept).items():
            if self.done(label):
                continue
            shutil.copytree(source, self.folder(label), dirs_exist_ok=True)
            (self.folder(label) / "task_done").touch()
            taken.append(label)
        return taken

    def run(self, label: str) -> None:
        """Run one task (or the rest of it); its inputs must be done."""
        task, folder = self.tasks[label], self.folder(label)
        folder.mkdir(parents=True, exist_ok=True)

        def report(share: float) -> None:
            (folder / "progress").write_text(f"{share:.4f}")

        inputs = {name: self.folder(f"{task.layout}/{name}") for name in task.inputs}
        task.action(Work(task, folder, inputs, report))
        (folder / "task_done").touch()
