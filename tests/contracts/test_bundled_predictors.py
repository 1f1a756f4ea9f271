"""Every bundled predictor predicts the bundled agent of its kitchen."""

import json
from pathlib import Path

import pytest

from models.agents.catalogue import KINDS, TRAINED, WEIGHTS, agent_sha256
from overcooked.layout import load_layout

FOLDERS = sorted(path.parent for path in WEIGHTS.glob("*/*_predictor_*/config.json"))


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: f"{folder.parent.name}-{folder.name}")
def test_a_bundled_predictor_was_trained_to_predict_the_bundled_agent(folder: Path) -> None:
    config = json.loads((folder / "config.json").read_text(encoding="utf-8"))
    assert config["agent_sha256"] == agent_sha256(config["agent"], load_layout(folder.parent.name))
    assert f"Agent sha256: {config['agent_sha256'][:16]}." in (folder / "card.md").read_text(encoding="utf-8")


def test_every_trained_agent_has_its_predictors() -> None:
    layouts = {folder.parent.name for folder in FOLDERS}
    agents = {(layout, name) for layout in layouts for name in TRAINED if (WEIGHTS / layout / name).is_dir()}
    assert len(agents) == 28
    streams, windows = (
        {(folder.parent.name, folder.name.removesuffix(end)) for folder in FOLDERS if folder.name.endswith(end)}
        for end in ("_predictor_stream", "_predictor_window")
    )
    assert streams == agents
    assert windows == {(layout, name) for layout, name in agents if name in KINDS}
