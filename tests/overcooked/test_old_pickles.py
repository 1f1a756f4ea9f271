"""The guide's script turns overcooked_ai's pickled games of people into trajectories; kitchenmind reads no pickles."""

import gzip
import json
import re
import subprocess
import sys
from io import StringIO
from pathlib import Path

import pytest

import kitchenmind
from overcooked.layout import load_layout
from overcooked.trajectory import write_trajectories

pandas = pytest.importorskip("pandas")

ROOT = Path(__file__).resolve().parents[2]
PEOPLE = ROOT / "tests" / "data" / "forced_coordination_train.jsonl.gz"
GUIDE = ROOT / "docs" / "guides" / "read_the_data.md"


def people(timesteps: int) -> list[list[int]]:
    """The joint actions at the beginning of the first recorded game."""
    with gzip.open(PEOPLE, "rt") as lines:
        states = [line for line in map(json.loads, lines) if line["k"] == "s"]
    return [line["a"] for line in states[:timesteps]]


def pickled(file: Path, joint_actions: list[list[int]]) -> None:
    """Write a game as overcooked_ai has it: a row per timestep, with actions as JavaScript sent them."""
    text = StringIO()
    write_trajectories([(load_layout("forced_coordination"), joint_actions)], text)
    columns = json.loads(text.getvalue())
    words = [[one.upper() if isinstance(one, str) else one for one in both] for both in columns["ep_actions"][0]]
    states = [json.dumps(state) for state in columns["ep_states"][0]]
    table = {"state": states, "joint_action": [str(both) for both in words], "layout_name": "random0", "trial_id": 81}
    pandas.DataFrame(table).to_pickle(file)


def test_the_script_of_the_guide_gives_trajectories_that_replay(tmp_path: Path) -> None:
    joint_actions = people(120)
    pickled(tmp_path / "in.pickle", joint_actions)
    blocks = re.findall(r"```python[^\n]*\n(.*?)```", GUIDE.read_text(encoding="utf-8"), re.DOTALL)
    (script,) = [block for block in blocks if "read_pickle" in block]
    words = [sys.executable, "-c", script, tmp_path / "in.pickle", tmp_path / "people.json"]
    subprocess.run(words, check=True)
    words = ["replay", str(tmp_path / "people.json"), "--states", str(tmp_path / "states.jsonl")]
    assert kitchenmind.main(words) == 0
    (episode,) = map(json.loads, (tmp_path / "states.jsonl").read_text(encoding="utf-8").splitlines())
    assert len(episode["states"]) == len(joint_actions) + 1
