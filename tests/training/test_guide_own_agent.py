"""The guide for other people's agents is true: its commands, in its order, lead from an ONNX file to a study that runs.

They run in a copy of the house, so that what they ship is not left among the weights; some with options that make them
short.
"""

import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent
GUIDE = ROOT / "docs" / "guides" / "bring_your_own_agent.md"
PACKAGES = ("overcooked", "models", "training", "server", "analysis", "studies", "static", "templates", "migrations")
SMALL = {"updates": 20, "warm_up": 5, "check_every": 10, "hidden": 32, "heads": 2, "layers": 2}
SHORTER = {  # added to a command that begins so
    "python docs/examples/own_agent.py": "--timesteps 2000 --epochs 2",
    "kitchenmind collect": "--trajectories 1 --timesteps 60 --no-extras",
    "kitchenmind train predictor": " ".join(f"--set {key}={value}" for key, value in SMALL.items()),
    "kitchenmind evaluate predictor": "--trajectories 1",
    "kitchenmind serve": "--port 0",
}


def blocks(language: str) -> list[str]:
    """The guide's blocks of code: "" for commands, "yaml"."""
    found = re.findall(r"^```(\w*)\n(.*?)^```$", GUIDE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    return [text for name, text in found if name == language]


def commands() -> list[str]:
    """Every command line of the guide."""
    return [line for block in blocks("") for line in block.splitlines()]


def started(line: str, house: Path) -> "subprocess.Popen[str]":
    """The command in the copy, made short."""
    settings, words = {}, shlex.split(line)
    while "=" in words[0]:
        name, _, value = words.pop(0).partition("=")
        settings[name] = str(house / value)
    bare = " ".join(words)
    more = next((extra for begin, extra in SHORTER.items() if bare.startswith(begin)), "")
    program = [sys.executable, "-m", "kitchenmind"] if words[0] == "kitchenmind" else [sys.executable]
    paths = os.pathsep.join([str(house), *settings.values()])
    return subprocess.Popen(
        [*program, *words[1:], *shlex.split(more)],
        cwd=house,
        env={**os.environ, "PYTHONPATH": paths, "PYTHONUNBUFFERED": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def done(line: str, house: Path) -> str:
    """What a command that ends well says."""
    process = started(line, house)
    said, _ = process.communicate(timeout=280)
    assert process.returncode == 0, f"{line}\n{said}"
    return said


@pytest.fixture(scope="module")
def house(tmp_path_factory) -> Path:
    """A copy of the house with the weights of one kitchen."""
    folder = tmp_path_factory.mktemp("house")
    leave_out = shutil.ignore_patterns("weights", "__pycache__")
    for name in PACKAGES:
        shutil.copytree(ROOT / name, folder / name, ignore=leave_out)
    shutil.copytree(ROOT / "docs" / "examples", folder / "docs" / "examples", ignore=leave_out)
    shutil.copytree(ROOT / "models/weights/coordination_ring", folder / "models/weights/coordination_ring")
    for name in ("kitchenmind.py", "alembic.ini"):
        shutil.copy(ROOT / name, folder / name)
    return folder


def edit_as_the_guide_says(study: Path) -> None:
    """Puts the guide's agents in the place of those in the file."""
    (agents,) = blocks("yaml")
    text, changed = re.subn(r"^agents:\n(  - .*\n)+", agents, study.read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert changed == 1
    study.write_text(text, encoding="utf-8")


def page_of(process: "subprocess.Popen[str]") -> str:
    """The first page of a server that says its address."""
    assert process.stdout is not None
    address = ""
    for line in process.stdout:
        found = re.search(r"http://127\.0\.0\.1:\d+", line)
        if found:
            address = found[0]
            break
    for _ in range(300):
        try:
            with urllib.request.urlopen(address, timeout=20) as answer:
                return str(answer.read().decode())
        except urllib.error.URLError:
            time.sleep(0.1)
    raise AssertionError(f"nobody answers at {address}")


@pytest.mark.slow
def test_every_command_of_the_guide_works_in_its_order(house: Path) -> None:
    said = {}
    for line in commands():
        if line.startswith("kitchenmind serve"):
            process = started(line, house)
            try:
                assert "my_study" in page_of(process)
            finally:
                process.send_signal(signal.SIGINT)
                process.communicate(timeout=60)
            continue
        said[line] = done(line, house)
        if line.startswith("kitchenmind study new"):
            edit_as_the_guide_says(house / "my_study.yaml")
    checks = [text for line, text in said.items() if "agent check" in line]
    assert len(checks) == 2
    assert all("it can be used" in text for text in checks)
    assert (house / "models/weights/coordination_ring/mine_predictor_stream/card.md").is_file()
    measured = next(text for line, text in said.items() if "evaluate predictor" in line)
    assert re.search(r"coordination_ring +mine +stream", measured)
    assert "there are no weights" not in next(text for line, text in said.items() if "study check" in line)


def test_the_guide_leads_from_an_agent_to_people() -> None:
    verbs = [" ".join(line.split("=")[-1].split()[:3]) for line in commands()]
    ours = ("agent check", "collect", "train", "evaluate", "study check", "bots", "serve")
    wanted = ["python docs/examples/own_agent.py", *(f"kitchenmind {verb}" for verb in ours)]
    places = [next(k for k, verb in enumerate(verbs) if verb.startswith(want)) for want in wanted]
    assert places == sorted(places)
