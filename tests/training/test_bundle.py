"""A finished study of the preset `published` among the bundled weights."""

import json
import shutil
from dataclasses import fields

import numpy as np
import pytest
import torch

import kitchenmind
from models.agents.catalogue import WEIGHTS, agent_set, agent_sha256, load_agent, strong
from models.networks.checkpoint import load_checkpoint
from models.networks.config import IntentionConfig, PredictorConfig
from models.networks.predictor import PredictorNetwork
from overcooked.layout import load_layout
from training.collect import CollectionPlan, Target
from training.evaluate_intentions import EvaluatedIntentions, intention_entry
from training.publish_intentions import write_intentions
from training.publish_predictor import population_folder, unseen_games, write_predictor

RING = load_layout("coordination_ring")
HERE = WEIGHTS / RING.name
SMALL = PredictorConfig(hidden=64, layers=2, heads=2, feed_forward=128, state_width=64, action_width=8)
OURS = {agent: strong(agent) if (HERE / strong(agent)).is_dir() else agent for agent in ("sp", "fcp")}
MEMBERS = (
    "population_sp_1",
    "population_sp_2",
    "population_fcp_21",
    "population_fcp_22",
    "target_sp_11",
    "target_sp_12",
)


def _finished(folder, source, places=("35", "70", "100")):
    for place in places:
        shutil.copytree(source, folder / place)
    (folder / "key").write_text("a key\n")


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A study's finished tasks: bundled agents under other names, and one untrained predictor for each agent."""
    torch.set_num_threads(1)
    folder = tmp_path_factory.mktemp("kept")
    ring, members = folder / RING.name, sorted((HERE / "population").iterdir())
    for name, source in zip(MEMBERS, members, strict=False):
        _finished(ring / name, source)
    _finished(ring / "features_41", HERE / "features", ["100"])
    for agent, other in (("sp", OURS["fcp"]), ("fcp", OURS["sp"])):
        _finished(ring / f"choose_{agent}", HERE / other, ["agent"])
        (ring / f"choose_{agent}" / "decision.json").write_text(json.dumps({"best": "target_sp_12"}))
        _predictors(ring, agent, other)
    return folder


def _predictors(ring, agent, other):
    """An untrained one, called a predictor in both forms."""
    torch.manual_seed(0)
    network = PredictorNetwork(RING, SMALL, IntentionConfig(hidden=64))
    target = Target(agent, *load_agent(other, RING), agent_sha256(other, RING))
    games = unseen_games(RING, target, network, population_folder(RING), CollectionPlan(1, 60))
    none = intention_entry(EvaluatedIntentions(*(np.zeros(1, np.int64) for _ in fields(EvaluatedIntentions))), RING)
    for form in ("stream", "window"):
        place = ring / f"intentions_{agent}_{form}"
        write_predictor(place / "predictor", network, RING, target, games, {"updates": 7})
        written = load_checkpoint(place / "predictor")
        write_intentions(written, network.intentions, none, {"states": 1}, place / "predictor")
        (place / "key").write_text("a key\n")


@pytest.fixture
def weights(tmp_path, monkeypatch):
    """Bundled weights of a kitchen that has one set of agents."""
    ring = tmp_path / "weights" / RING.name
    for name in ("sp", "fcp", "sp_predictor_stream"):
        kind, *rest = name.split("_", 1)
        shutil.copytree(HERE / "_".join([OURS[kind], *rest]), ring / name)
    shutil.copytree(HERE / "population", ring / "population")
    for module in ("models.agents.catalogue", "training.choose", "training.bundle", "training.publish_predictor"):
        monkeypatch.setattr(f"{module}.WEIGHTS", tmp_path / "weights")
    return ring


def _bundle(kept, *options):
    size = ["--trajectories", "1", "--timesteps", "60"]
    return kitchenmind.main(["train", "bundle", "--kept", str(kept), "--layouts", RING.name, *size, *options])


def test_the_published_agents_take_the_names_and_the_others_stay_as_strong_ones(weights, kept, capsys):
    before = {name: (weights / name / "sha256").read_bytes() for name in ("sp", "fcp", "sp_predictor_stream")}
    assert agent_set("sp", RING.name) == "strong"
    assert _bundle(kept) == 0
    assert (weights / "sp" / "sha256").read_bytes() == (kept / RING.name / "choose_sp/agent/sha256").read_bytes()
    assert (weights / "sp_strong" / "sha256").read_bytes() == before["sp"]
    assert (weights / "fcp_strong" / "sha256").read_bytes() == before["fcp"]
    assert (weights / "sp_strong_predictor_stream" / "sha256").read_bytes() == before["sp_predictor_stream"]
    assert [agent_set(name, RING.name) for name in ("sp", "sp_strong")] == ["published", "strong"]
    for agent in ("sp", "fcp"):
        for form in ("stream", "window"):
            found = load_checkpoint(weights / f"{agent}_predictor_{form}")
            assert found.bits == 8
            assert found.config["agent_sha256"] == agent_sha256(agent, RING)
    assert capsys.readouterr().out.count("right in 16 bits") == 4


def test_population_and_partners_that_no_target_met_are_replaced(weights, kept):
    assert _bundle(kept) == 0
    assert {path.name for path in (weights / "population").iterdir()} >= {"sp_1_35", "fcp_22_100"}
    held_out = {path.name for path in (weights / "held_out").iterdir()}
    assert held_out == {f"{name}_{skill}" for name in ("population_sp_2", "target_sp_11") for skill in (35, 70, 100)}


def test_doing_it_again_leaves_the_strong_agents(weights, kept):
    assert _bundle(kept) == 0
    strong = (weights / "sp_strong" / "sha256").read_bytes()
    assert _bundle(kept) == 0
    assert (weights / "sp_strong" / "sha256").read_bytes() == strong


def test_an_unfinished_study_is_refused_before_anything_is_replaced(weights, kept, tmp_path, capsys):
    part = tmp_path / "part"
    shutil.copytree(kept, part)
    shutil.rmtree(part / RING.name / "intentions_fcp_window")
    before = (weights / "sp" / "sha256").read_bytes()
    assert _bundle(part) == 2
    said = capsys.readouterr().err
    assert "intentions_fcp_window not finished" in said
    assert f"--keep {part}" in said
    assert (weights / "sp" / "sha256").read_bytes() == before
