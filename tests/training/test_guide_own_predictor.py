"""The guide for predicting an own agent works: its commands, in order, lead to a study with predictions."""

import json
import re
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from tests.support import guide_checkout

GUIDE = guide_checkout.ROOT / "docs" / "tutorials" / "predict_your_own_agent.md"
SHORTER = {  # added to a command that begins so
    "kitchenmind train agent": "--set total_timesteps=12_800 num_envs=16 snapshots=4 imitation_updates=60",
    "kitchenmind collect": "--trajectories 1 --timesteps 60",
    "kitchenmind train predictor": "--set updates=20 warm_up=5 check_every=10",
    "kitchenmind evaluate predictor": "--trajectories 1 --timesteps 60",
    "kitchenmind bots": "--database sqlite:///own.sqlite3",
}
BLOCK = re.compile(r"^```(?P<mark>[^\n]*)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)
AGENTS = "SELECT agent_name, agent_1_sha256, predictor_sha256 FROM episodes WHERE kind = 'episode'"


def give(study: Path, text: str) -> None:
    """The file with these blocks in place of those of the same name."""
    kept = study.read_text(encoding="utf-8")
    for key in re.findall(r"^(\w+):", text, re.MULTILINE):
        kept = re.sub(rf"^{key}:.*\n(?:[ #-].*\n|\n)*", "", kept, flags=re.MULTILINE)
    study.write_text(f"{kept.rstrip()}\n{text}", encoding="utf-8")


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_the_guide_leads_to_a_study_that_shows_predictions(tmp_path: Path) -> None:
    checkout = guide_checkout.build(tmp_path)
    said: dict[str, str] = {}
    for found in BLOCK.finditer(GUIDE.read_text(encoding="utf-8")):
        mark, text = found["mark"].strip(), found["text"]
        if mark == "text nook.layout":
            (checkout / "nook.layout").write_text(text, encoding="utf-8")
        elif mark == "yaml":
            give(checkout / "nook.yaml", f"{text}game: {{horizon: 30}}\n")
        for line in text.splitlines() if not mark else ():
            if not line.startswith("kitchenmind serve"):
                said[line] = guide_checkout.done(line, checkout, SHORTER, within_s=600)
    (evaluated,) = [text for line, text in said.items() if "evaluate predictor" in line]
    assert re.search(r"nook +mine +stream", evaluated)
    assert "warning" not in next(text for line, text in said.items() if "study check" in line)
    with closing(sqlite3.connect(database=checkout / "own.sqlite3")) as database:
        rows = database.execute(AGENTS).fetchall()
    assert {row[0] for row in rows} == {"mine"}
    assert all(row[1] and row[2] for row in rows)
    assert json.loads((checkout / "mine_predictor" / "config.json").read_text("utf-8"))["agent"] == "mine"
