"""Faults of somebody else's agent: the message names the agent, the place in its code and the remedy."""

import sys
from pathlib import Path

import numpy as np
import pytest

import kitchenmind
from models.agents.blackbox import load_foreign_agent
from models.agents.checked_policy import CheckedPolicy
from models.protocols import BlackBoxError, Observations, Probabilities
from overcooked.layout import load_layout
from overcooked.state import Kitchens

RING = load_layout("coordination_ring")
STATES = Kitchens.start(RING, 3).encode()[:, 0].copy()
AGENTS = """
import numpy as np

class Fails:
    def __init__(self, layout):
        self.calls = 0

    def probabilities(self, observations):
        return {}["north"]

class LateNaN(Fails):
    def probabilities(self, observations):
        self.calls += 1
        return np.full((len(observations), 6), np.nan if self.calls > 200 else 1 / 6, np.float32)

class WithoutConstructor:
    def probabilities(self, observations):
        return np.full((len(observations), 6), 1 / 6, np.float32)

class WithoutWeights:
    def __init__(self, layout):
        raise RuntimeError("no weights.pt")

class ModeIsText(LateNaN):
    mode = "greedy"
"""


@pytest.fixture(autouse=True)
def modules(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Modules of somebody else that can be imported, each with a fault of its own."""
    sources = {"faulty_agents": AGENTS, "needs_more": "import no_such_package", "stops": "raise SystemExit('usage')"}
    for name, source in {**sources, "no_python": "class A(:", "raises": "raise RuntimeError('no GPU')"}.items():
        (tmp_path / f"{name}.py").write_text(source, encoding="utf-8")
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.syspath_prepend(tmp_path)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("needs_more:A", "needs_more:A needs the Python package no_such_package. Install it for "),
        ("stops:A", "SystemExit: usage (stops.py, line 1). Move the code that runs as a program under `if __name__"),
        ("no_python:A", "cannot be imported: SyntaxError: invalid syntax (no_python.py, line 1)"),
        ("raises:A", "cannot be imported: RuntimeError: no GPU (raises.py, line 1)"),
        ("faulty_agents:", "faulty_agents: was not found. Write package.module:Class"),
        ("faulty_agents:Nobody", "has no attribute 'Nobody'). Write package.module:Class"),
        ("faulty_agents:WithoutConstructor", "takes no arguments. Its constructor gets one argument, the layout."),
        ("faulty_agents:WithoutWeights", "RuntimeError: no weights.pt (faulty_agents.py, line 22)"),
        ("faulty_agents:ModeIsText", "has the attribute mode = 'greedy'. Remove it, or set it to"),
    ],
)
def test_a_class_that_cannot_be_used_is_refused_with_place_and_remedy(name: str, said: str) -> None:
    with pytest.raises(BlackBoxError) as refused:
        load_foreign_agent(name, RING)
    assert said in str(refused.value)


def test_a_failing_agent_is_named_with_the_line_of_its_code() -> None:
    policy, _ = load_foreign_agent("faulty_agents:Fails", RING)
    with pytest.raises(BlackBoxError, match=r"mine failed: KeyError: 'north' \(faulty_agents.py, line 9\)"):
        CheckedPolicy(policy, "mine").probabilities(STATES)


@pytest.mark.parametrize("answer", [np.nan, -1.0, 0.5])
def test_answers_that_are_not_probabilities_are_refused(answer: float) -> None:
    class Improbable:
        def probabilities(self, observations: Observations) -> Probabilities:
            return np.full((len(observations), 6), answer, np.float32)

    with pytest.raises(BlackBoxError, match="mine gave"):
        CheckedPolicy(Improbable(), "mine").probabilities(STATES)


def test_agent_check_finds_nan_late_in_an_episode_and_names_lines(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--layout", "coordination_ring", "--deadline-ms", "60000"]
    assert kitchenmind.main(["agent", "check", "faulty_agents:LateNaN", *words]) == 1
    assert "gave NaN, infinite or negative probabilities" in capsys.readouterr().err
    assert kitchenmind.main(["agent", "check", "faulty_agents:Fails", *words]) == 2
    assert "cannot be used: KeyError: 'north' (faulty_agents.py, line 9)" in capsys.readouterr().err


@pytest.mark.parametrize("agent", ["faulty_agents:LateNaN", "faulty_agents:Fails"])
def test_no_games_are_collected_or_measured_with_a_faulty_agent(
    agent: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    games = ["--out", str(tmp_path / "games"), "--trajectories", "1", "--timesteps", "250"]
    for words in (
        ["collect", "--layout", "coordination_ring", "--agent", agent, *games],
        ["evaluate", "agents", "--layouts", "coordination_ring", "--partner", agent, "--episodes", "1"],
    ):
        assert kitchenmind.main(words) == 2
        assert f": {agent} " in capsys.readouterr().err
    assert not list(tmp_path.glob("games/*.safetensors"))
