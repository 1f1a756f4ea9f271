"""The study's command, from its preset to agents on disk, on this machine and on a local Ray."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from models.agents.catalogue import load_agent
from models.networks.checkpoint import load_checkpoint
from overcooked.layout import load_layout
from tests.support.command_line import run

TINY = """
population = 1
targets = 1
[population_sp]
timesteps = {timesteps}
games = 16
snapshots = 4
[target_sp]
timesteps = 6400
games = 16
snapshots = 4
"""


MEASURED = ("--device", "cpu", "--precision", "float32")  # otherwise every task measures what is quickest here


def _words(tmp_path: Path, timesteps: int, *more: str) -> list[str]:
    preset = tmp_path / "tiny.toml"
    preset.write_text(TINY.format(timesteps=timesteps))
    words = ["--preset", str(preset), "--layouts", "coordination_ring", "--only", "population_sp", "target_sp"]
    return ["train", "study", *words, *MEASURED, "--runs", str(tmp_path / "runs"), *more]


def _agents(tmp_path: Path) -> list[str]:
    return sorted(
        path.parent.parent.name.partition("-")[0] for path in (tmp_path / "runs").glob("study/*/*/100/sha256")
    )


@pytest.mark.slow
def test_the_study_command_trains_the_requested_tasks_and_resumes_where_it_stopped(tmp_path: Path) -> None:
    for _ in range(2):  # the second time finds everything done
        finished = run(*_words(tmp_path, 6400))
        assert finished.returncode == 0, finished.stdout + finished.stderr
        assert _agents(tmp_path) == ["population_sp_1", "target_sp_11"]
    assert "2 of 2 tasks done" in finished.stdout
    (checkpoint,) = (tmp_path / "runs").glob("study/coordination_ring/target_sp_11-*/100")
    assert load_checkpoint(checkpoint).config["agent"] == "target_sp_11_100"


@pytest.mark.slow
def test_an_agent_trained_by_the_command_can_be_loaded_and_played(tmp_path: Path) -> None:
    out = tmp_path / "mine"
    words = ["--layout", "coordination_ring", "--seed", "3", "--set", "total_timesteps=6400", "--set", "snapshots=2"]
    finished = run("train", "agent", *words, *MEASURED, "--runs", str(tmp_path), "--out", str(out))
    assert finished.returncode == 0, finished.stderr
    assert "timesteps = 6400" in finished.stdout
    assert load_agent(str(out), load_layout("coordination_ring")).mode.temperature == 0.0
    assert list((tmp_path / "coordination_ring" / "sp_3" / "tensorboard").iterdir())


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["study", "--preset", "none"], "there is no preset 'none'"),
        (["study", "--layouts", "nowhere"], "there is no layout 'nowhere'"),
        (["agent", "--layout", "coordination_ring", "--set", "speed=9"], "unknown key 'speed'"),
    ],
)
def test_wrong_input_ends_with_2_and_a_reason(tmp_path: Path, words: list[str], reason: str) -> None:
    finished = run("train", *words, "--runs", str(tmp_path))
    assert finished.returncode == 2
    assert reason in finished.stderr
    assert not any(tmp_path.iterdir())


@pytest.mark.slow
def test_a_killed_ray_worker_costs_time_but_no_task(tmp_path: Path) -> None:
    pytest.importorskip("ray", reason="pip install 'kitchenmind[cluster]'")
    process = subprocess.Popen(
        [sys.executable, "-m", "kitchenmind", *_words(tmp_path, 400_000, "--ray", "local", "--workers", "2")],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    try:
        worker = _busy_ray_worker(tmp_path, process)
        os.kill(worker, signal.SIGKILL)
        output, _ = process.communicate(timeout=240)
    finally:
        if process.poll() is None:
            process.kill()
            process.communicate()
    assert process.returncode == 0, output
    assert _agents(tmp_path) == ["population_sp_1", "target_sp_11"]


def _busy_ray_worker(tmp_path: Path, process: "subprocess.Popen[str]") -> int:
    """The Ray worker whose task trains the population's agent, once that has begun."""
    for _ in range(600):
        assert process.poll() is None, process.communicate()[0]
        for folder in Path("/proc").glob("[0-9]*"):
            words = _read(folder / "cmdline").split("\0")
            if str(tmp_path / "runs") in words and "coordination_ring/population_sp_1" in words:
                started = list((tmp_path / "runs").glob("study/*/population_sp_1-*/progress"))
                if started:
                    return int(_read(folder / "stat").rpartition(")")[2].split()[1])
        time.sleep(0.2)
    raise AssertionError("no task began within two minutes")


def _read(path: Path) -> str:
    try:
        return path.read_text(errors="replace")
    except OSError:
        return ""
