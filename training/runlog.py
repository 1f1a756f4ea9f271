"""A run's folder: its settings, its metrics, its snapshots and the state from which the same command continues. There
is one state file, replaced atomically; no pickle.
"""

import json
import os
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors import safe_open
from safetensors.torch import save

State = tuple[dict[str, torch.Tensor], dict[str, Any]]


class RunError(ValueError):
    """A run folder that belongs to another run, or from which a run cannot continue; the message says what to do."""


class RunFolder:
    """`settings` identify the run: a folder with other settings is refused."""

    def __init__(self, path: Path, settings: Mapping[str, Any]) -> None:
        self.path = path
        path.mkdir(parents=True, exist_ok=True)
        self.settings: dict[str, Any] = json.loads(json.dumps(settings))
        known = path / "run.json"
        if not known.is_file():
            _replace(known, json.dumps({"settings": self.settings, "revision": revision()}, indent=2).encode())
        written = json.loads(known.read_text(encoding="utf-8"))
        if written["settings"] != self.settings:
            raise RunError(f"{path}: holds a run with other settings. Remove the folder or give another --runs.")
        self.revision: str = written["revision"]
        self._writer: Any = None

    def load(self) -> State | None:
        """Return the newest state, or None at the beginning. Metrics written after it are dropped: they will be written
        again."""
        path = self.path / "state.safetensors"
        if not path.is_file():
            self._keep_metrics(0)  # of a run that was interrupted before its first state
            return None
        with safe_open(path, framework="pt") as file:
            numbers = json.loads(file.metadata()["numbers"])
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - no mapping
        self._keep_metrics(numbers["timesteps"])
        return tensors, numbers

    def _keep_metrics(self, timesteps: int) -> None:
        """Drop the metrics after this timestep."""
        kept = [line for line in self.metrics() if line["timesteps"] <= timesteps]
        _replace(self.path / "metrics.jsonl", "".join(json.dumps(line) + "\n" for line in kept).encode())

    def save(self, tensors: Mapping[str, torch.Tensor], numbers: Mapping[str, Any]) -> None:
        """Replace the state; `numbers` must hold `timesteps`."""
        contiguous = {name: tensor.detach().contiguous() for name, tensor in tensors.items()}
        _replace(self.path / "state.safetensors", save(contiguous, {"numbers": json.dumps(numbers)}))

    def log(self, values: Mapping[str, float]) -> None:
        """Write a line of metrics (with `timesteps`), also to TensorBoard if it is installed."""
        with (self.path / "metrics.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps({key: round(value, 6) for key, value in values.items()}) + "\n")
        if self._writer is None:
            self._writer = _tensorboard(self.path)
        if self._writer:
            for key, value in values.items():
                self._writer.add_scalar(key, value, int(values["timesteps"]))

    def metrics(self) -> list[dict[str, float]]:
        path = self.path / "metrics.jsonl"
        lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
        return [json.loads(line) for line in lines if line.endswith("}")]

    def snapshot(self, tensors: Mapping[str, torch.Tensor], timesteps: int, reward: float) -> None:
        """Keep a copy of the network, named by its timesteps and its reward."""
        contiguous = {name: tensor.detach().half().contiguous() for name, tensor in tensors.items()}
        numbers = json.dumps({"timesteps": timesteps, "reward": reward})
        _replace(self.path / "snapshots" / f"{timesteps:010d}.safetensors", save(contiguous, {"numbers": numbers}))

    def snapshots(self) -> list[tuple[int, float, Path]]:
        """Return (timesteps, reward, file) of every snapshot, oldest first."""
        found = []
        for path in sorted((self.path / "snapshots").glob("*.safetensors")):
            with safe_open(path, framework="pt") as file:
                numbers = json.loads(file.metadata()["numbers"])
            found.append((int(numbers["timesteps"]), float(numbers["reward"]), path))
        return found

    def note_compute(self, chosen: str, measured: Mapping[str, float]) -> None:
        """Record what this process computes the run with; it may differ from one process of the run to the next."""
        line = {"chosen": chosen, "milliseconds": dict(measured)}
        print(f"computing with {chosen} ({_listed(measured)})" if measured else f"computing with {chosen}", flush=True)
        with (self.path / "compute.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")

    def compute(self) -> str:
        """Return the hardware and the form of the run, one entry for each; "unknown" for a run of an older version."""
        path = self.path / "compute.jsonl"
        lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
        return "; ".join(dict.fromkeys(json.loads(line)["chosen"] for line in lines)) or "unknown"

    def seconds(self) -> float:
        """Return the time that the run took, without interruptions."""
        return sum(line.get("seconds", 0.0) for line in self.metrics())

    def done(self) -> bool:
        return (self.path / "done").is_file()

    def finish(self) -> None:
        """Mark the run as complete: delete its state."""
        (self.path / "done").touch()
        (self.path / "state.safetensors").unlink(missing_ok=True)
        if self._writer:
            self._writer.close()


def open_run(path: Path) -> RunFolder:
    """Open an existing run folder, whatever its settings. Raises RunError."""
    known = path / "run.json"
    if not known.is_file():
        raise RunError(f"{path}: there is no run here (no run.json). Give a folder that `kitchenmind train` wrote.")
    return RunFolder(path, json.loads(known.read_text(encoding="utf-8"))["settings"])


def revision() -> str:
    """Return the short name of the code's revision, "unknown" outside a repository."""
    command = ["git", "-C", str(Path(__file__).parent), "rev-parse", "--short", "HEAD"]  # fixed words only
    found = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
    return found.stdout.strip() or "unknown"


def _listed(measured: Mapping[str, float]) -> str:
    return "; ".join(f"{name}: {milliseconds:.1f} ms" for name, milliseconds in measured.items())


def _replace(path: Path, content: bytes) -> None:
    new = path.with_name(f"{path.name}.new-{os.getpid()}")
    new.write_bytes(content)
    new.replace(path)


def _tensorboard(path: Path) -> Any:
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError:
        return False
    return SummaryWriter(str(path / "tensorboard"))
