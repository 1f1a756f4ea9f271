"""The guide for agents from outside works: its commands, in order, lead from an ONNX file to a running study.

They run in a copy of the project, so that what they publish is not left among the weights; some with options that make
them short.
"""

import re
import signal
import subprocess
import time
import urllib.error
import urllib.request
from pathlib import Path

import pytest

from tests.support import guide_checkout

GUIDE = guide_checkout.ROOT / "docs" / "guides" / "bring_your_own_agent.md"
SMALL = {"updates": 20, "warm_up": 5, "check_every": 10, "hidden": 32, "heads": 2, "layers": 2}
SHORTER = {  # added to a command that begins so
    "python docs/examples/own_agent.py": "--timesteps 2000 --epochs 2",
    "kitchenmind collect": "--trajectories 1 --timesteps 60 --no-extras",
    "kitchenmind train predictor": " ".join(f"--set {key}={value}" for key, value in SMALL.items())
    + " --no-intentions",
    "kitchenmind evaluate predictor": "--trajectories 1",
    "kitchenmind serve": "--port 0",
    "kitchenmind agent serve": "--port 0",
}
MY_MODULE = """
import numpy as np


class MyAgent:
    def __init__(self, layout):
        self.layout = layout

    def probabilities(self, observations):
        return np.full((len(observations), 6), 1 / 6)
"""


def blocks(language: str) -> list[str]:
    """The guide's blocks of code: "" for commands, "yaml"."""
    found = re.findall(r"^```(\w*)\n(.*?)^```$", GUIDE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    return [text for name, text in found if name == language]


def commands() -> list[str]:
    """Every command line of the guide."""
    return [line for block in blocks("") for line in block.splitlines()]


@pytest.fixture(scope="module")
def checkout(tmp_path_factory) -> Path:
    """With the weights of one kitchen."""
    return guide_checkout.build(tmp_path_factory.mktemp("checkout"), "coordination_ring")


def edit_as_the_guide_says(study: Path) -> None:
    """Put the guide's agents in the place of those in the file."""
    *_, agents = blocks("yaml")
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
def test_every_command_of_the_guide_works_in_its_order(checkout: Path) -> None:
    said = {}
    (checkout / "my_module.py").write_text(MY_MODULE, encoding="utf-8")
    expected = {"kitchenmind serve": "my_study", "kitchenmind agent serve": '"observations"'}
    for line in commands():
        served = next((text for begin, text in expected.items() if line.startswith(begin)), None)
        if served is not None:
            process = guide_checkout.started(line, checkout, SHORTER)
            try:
                assert served in page_of(process)
            finally:
                process.send_signal(signal.SIGINT)
                process.communicate(timeout=60)
            continue
        if line.startswith("curl"):
            continue  # `page_of` has just asked the same
        said[line] = guide_checkout.done(line, checkout, SHORTER)
        if line.startswith("kitchenmind study new"):
            edit_as_the_guide_says(checkout / "my_study.yaml")
    checks = [text for line, text in said.items() if "agent check" in line]
    assert len(checks) == 2
    assert all("it can be used" in text for text in checks)
    assert (checkout / "models/weights/coordination_ring/mine_predictor_stream/card.md").is_file()
    measured = next(text for line, text in said.items() if "evaluate predictor" in line)
    assert re.search(r"coordination_ring +mine +stream", measured)
    assert "no trained" not in next(text for line, text in said.items() if "study check" in line)


def test_the_guide_leads_from_an_agent_to_people() -> None:
    verbs = [" ".join(line.split("=")[-1].split()[:3]) for line in commands()]
    ours = ("agent check", "collect", "train", "evaluate", "study check", "bots", "serve")
    wanted = ["python docs/examples/own_agent.py", *(f"kitchenmind {verb}" for verb in ours)]
    places = [next(k for k, verb in enumerate(verbs) if verb.startswith(want)) for want in wanted]
    assert places == sorted(places)
