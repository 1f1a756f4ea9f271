"""overcooked_ai's own code, in a separate environment, loads the trajectories that we write."""

import gzip
import json
import subprocess
import venv
from pathlib import Path

import pytest

from overcooked.layout import load_layout
from overcooked.trajectory import JointActions, write_trajectories

DATA = Path(__file__).parent.parent / "data"
# The newest release. It needs numpy before 2 and scipy, and does not say so.
PACKAGES = ("overcooked-ai==1.1.0", "numpy<2", "scipy", "setuptools<81")
LAYOUTS = ("coordination_ring", "cramped_room", "asymmetric_advantages")
# Run by the other Python. The release configures the recipes when it builds a kitchen, and loads states before that.
PROGRAM = """
import json
import sys
from overcooked_ai_py.agents.benchmarking import AgentEvaluator
from overcooked_ai_py.mdp.overcooked_mdp import OvercookedGridworld
OvercookedGridworld.from_layout_name("cramped_room")
loaded = AgentEvaluator.load_traj_from_json(sys.argv[1])
AgentEvaluator._check_right_types(loaded)
players = [[[list(chef.position) for chef in state.players] for state in states] for states in loaded["ep_states"]]
served = [sum(rewards) for rewards in loaded["ep_rewards"]]
print(json.dumps({"players": players, "served": served, "returns": loaded["ep_returns"]}))
"""


def recorded(layout: str, timesteps: int = 400) -> tuple[JointActions, list[list[list[int]]]]:
    """The joint actions and positions of the first recorded game of people in a kitchen."""
    actions: JointActions = []
    positions = []
    with gzip.open(DATA / f"{layout}_train.jsonl.gz", "rt") as lines:
        for line in map(json.loads, lines):
            if line["k"] == "s" and line.get("a") and len(actions) < timesteps:
                actions.append(line["a"])
                positions.append([player[:2] for player in line["p"]])
    return actions, positions


@pytest.fixture(scope="module")
def python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A Python that has the published overcooked_ai and nothing of ours."""
    folder = tmp_path_factory.mktemp("overcooked_ai")
    venv.create(folder, with_pip=True)
    words = [folder / "bin" / "pip", "install", "--quiet", *PACKAGES]
    installed = subprocess.run(words, check=False, capture_output=True, text=True)
    if installed.returncode != 0:
        pytest.skip(f"overcooked_ai cannot be installed here: {installed.stderr[-300:]}")
    return folder / "bin" / "python"


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_the_published_overcooked_ai_loads_games_of_people(python: Path, tmp_path: Path) -> None:
    games = {layout: recorded(layout) for layout in LAYOUTS}
    file = tmp_path / "ours.json"
    with file.open("w") as text:
        write_trajectories([(load_layout(layout), actions) for layout, (actions, _) in games.items()], text)
    words = [python, "-W", "ignore", "-c", PROGRAM, file]
    loaded = subprocess.run(words, check=False, capture_output=True, text=True)
    assert loaded.returncode == 0, loaded.stderr
    found = json.loads(loaded.stdout.splitlines()[-1])
    assert found["players"] == [positions for _, positions in games.values()]
    assert found["served"] == found["returns"]
    assert sum(found["returns"]) > 0
