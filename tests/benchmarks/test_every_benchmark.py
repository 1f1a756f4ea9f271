"""Every benchmark runs to its end in its quick form and prints what it measured. The figures are not checked."""

import importlib.util
import io
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent
# The arguments that make each short.
QUICK = {
    "against_r": ["--quick"],
    "agent_modes": ["--quick"],
    "classic_kitchens": ["--quick"],
    "classic_predictors": ["--quick"],
    "browser": ["--seconds", "1", "--json"],
    "results": ["--quick"],
    "dashboard": ["--games", "4", "--window-s", "2", "--turns", "1", "--json"],
    "engine": ["--quick", "--json"],
    "export": ["--people", "10", "--json"],
    "faults": ["--quick", "--json"],
    "fit_simulated_participants": ["--quick"],
    "foresight": ["--quick", "--json"],
    "gpu": ["--seconds", "1", "--json"],
    "installation": ["--in", ".", "--json"],
    "accuracy_ceiling": ["--states", "60", "--json"],
    "participant": ["--json"],
    "frame_rate": ["--seconds", "1", "--json"],
    "predictor": ["--seconds", "0.1", "--json"],
    "processor": [],
    "serve": ["--games", "1", "4", "--window-s", "3", "--json"],
    "startup": ["--turns", "1", "--json"],
    "store": ["--quick", "--json"],
    "training": ["--seeds", "1", "--seconds", "1", "--json"],
    "write_path": ["--games", "40", "--processes", "2", "--timesteps", "10", "--json"],
}
specification = importlib.util.spec_from_file_location("faults_benchmark", ROOT / "benchmarks" / "faults.py")
assert specification is not None
assert specification.loader is not None
faults = importlib.util.module_from_spec(specification)
specification.loader.exec_module(faults)


def source_of(name: str) -> str:
    return (ROOT / "benchmarks" / f"{name}.py").read_text(encoding="utf-8")


def test_every_benchmark_has_a_quick_form() -> None:
    assert set(QUICK) == {path.stem for path in (ROOT / "benchmarks").glob("*.py")}


@pytest.mark.parametrize("name", [name for name in QUICK if "from tests" in source_of(name)])
def test_a_benchmark_that_imports_test_helpers_finds_them(name: str) -> None:
    assert re.search(r"^sys\.path.*str\(ROOT\)", source_of(name), re.MULTILINE)


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("name", QUICK)
def test_the_benchmark_runs_in_its_quick_form(name: str) -> None:
    command = [sys.executable, f"benchmarks/{name}.py", *QUICK[name]]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stderr  # 1: a figure beyond its limit, on whatever machine this is
    assert "Traceback" not in done.stderr, done.stderr
    assert done.stdout.strip()
    if "--json" in QUICK[name]:
        figures = json.loads(done.stdout)
        assert figures
        if name == "faults":
            assert len({row["row"] for row in figures}) >= 20
            assert [row for row in figures if "error" in row["figure"]] == []


def row(number: int, passed: bool = True) -> "faults.FaultResult":
    return faults.FaultResult(number, "a fault", 1, passed, {"lost": 0})


def test_a_scenario_that_raises_counts_as_failed_and_the_others_continue(monkeypatch: pytest.MonkeyPatch) -> None:
    def breaks(folder: Path) -> "faults.FaultResult":
        raise ValueError("min() iterable argument is empty")

    made = [(1, lambda folder: row(1)), (28, breaks), (30, lambda folder: row(30))]
    monkeypatch.setattr(faults, "scenarios", lambda *_: iter(made))
    rows = list(faults.measure(True, set(), 1, 1.0, 1))
    assert [(one.row, one.passed) for one in rows] == [(1, True), (28, False), (30, True)]
    assert rows[1].figure["error"] == "ValueError: min() iterable argument is empty"


@pytest.mark.parametrize("as_json", [True, False])
def test_every_row_is_printed_as_soon_as_it_is_made(as_json: bool) -> None:
    out = io.StringIO()
    seen = []

    def rows() -> Iterator["faults.FaultResult"]:
        for number in (1, 2):
            yield row(number, passed=number == 1)
            seen.append(out.getvalue())  # what was printed when the next row is asked for

    assert faults.printed(rows(), out, as_json) is False
    assert ["a fault" in text for text in seen] == [True, True]
    assert seen[0] != seen[1]
    if as_json:
        assert [one["row"] for one in json.loads(out.getvalue())] == [1, 2]


def test_no_row_at_all_is_an_empty_list() -> None:
    out = io.StringIO()
    assert faults.printed(iter(()), out, as_json=True) is True
    assert json.loads(out.getvalue()) == []
