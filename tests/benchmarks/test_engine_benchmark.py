"""The engine's benchmark runs and prints what documents may quote."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent


@pytest.mark.slow
def test_benchmark_prints_every_size_and_the_first_step() -> None:
    command = [sys.executable, "benchmarks/engine.py", "--quick", "--json"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    figures = json.loads(done.stdout)
    assert [row["games"] for row in figures["steps_per_s"]] == [1, 64, 1024, 4096]
    assert all(row["step"] > 0 and row["play"] > 0 for row in figures["steps_per_s"])
    assert figures["first_step_s"] > 0
