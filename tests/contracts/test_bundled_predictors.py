"""Every bundled predictor predicts the bundled agent of its kitchen."""

import json
from pathlib import Path

import pytest

from models.agents.catalogue import WEIGHTS, agent_sha256
from overcooked.layout import load_layout

FOLDERS = sorted(path.parent for path in WEIGHTS.glob("*/*_predictor_*/config.json"))


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: f"{folder.parent.name}-{folder.name}")
def test_a_bundled_predictor_was_trained_to_predict_the_bundled_agent(folder: Path) -> None:
    config = json.loads((folder / "config.json").read_text(encoding="utf-8"))
    assert config["agent_sha256"] == agent_sha256(config["agent"], load_layout(folder.parent.name))
    assert f"Agent sha256: {config['agent_sha256'][:16]}." in (folder / "card.md").read_text(encoding="utf-8")


def test_every_kitchen_with_trained_agents_has_their_predictors() -> None:
    agents = {(path.parent.parent.name, path.parent.name) for path in WEIGHTS.glob("*/[sf]*p/config.json")}
    assert len(agents) == 18
    assert agents == {(folder.parent.name, folder.name.partition("_")[0]) for folder in FOLDERS}
