"""The finished training of a study among the bundled weights."""

import contextlib
import io
import json
import shutil
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
import torch

import kitchenmind
from models.agents.catalogue import WEIGHTS, agent_set, agent_sha256, load_agent, our_agent
from models.networks.checkpoint import load_checkpoint
from models.networks.config import IntentionConfig, PredictorConfig
from models.networks.predictor import PredictorNetwork
from overcooked.layout import load_layout
from training.bundle import keep_strong
from training.collect import CollectionPlan, Target
from training.evaluate_intentions import EvaluatedIntentions, intention_entry
from training.pipeline.agent_tasks import prediction_tasks, study_tasks
from training.pipeline.presets import load_preset
from training.pipeline.study_tasks import Graph
from training.publish_intentions import write_intentions
from training.publish_predictor import HowTrained, population_folder, unseen_games, write_predictor

RING = load_layout("coordination_ring")
HERE = WEIGHTS / RING.name
SMALL = PredictorConfig(hidden=32, layers=1, heads=2, feed_forward=64, state_width=32, action_width=8)
OURS = {kind: our_agent(kind, RING.name) for kind in ("sp", "fcp")}
BEFORE = ("sp", "fcp", "sp_predictor_stream")
FILE_OF = {"sp": "sha256", "fcp": "sha256", "sp_predictor_stream": "weights.safetensors"}  # what stays the same
MEMBERS = ("population_sp_1", "population_sp_2", "population_fcp_21", "population_fcp_22")
TARGETS = ("target_sp_11", "target_sp_12", "target_fcp_31", "target_fcp_32")
PRESET = "population = 2\ntargets = 2\nextras = false\npublish = false\n"


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A study's finished tasks: bundled agents under other names, and one untrained predictor for each agent."""
    torch.set_num_threads(1)
    folder = tmp_path_factory.mktemp("kept")
    (folder / "preset.toml").write_text(PRESET)
    ring, population = folder / RING.name, HERE / "population"
    for name in (*MEMBERS, *TARGETS):
        agent = name.removeprefix("population_") if name in MEMBERS else "sp_3"
        for skill in (35, 70, 100):
            shutil.copytree(population / f"{agent}_{skill}", ring / name / str(skill))
    shutil.copytree(HERE / "features", ring / "features_41" / "100")
    for agent, other in (("sp", OURS["fcp"]), ("fcp", OURS["sp"])):
        shutil.copytree(HERE / other, ring / f"choose_{agent}" / "agent")
        (ring / f"choose_{agent}" / "decision.json").write_text(json.dumps({"best": "target_sp_12"}))
        _predictors(ring, agent, other)
    preset = load_preset(str(folder / "preset.toml"))
    graph = Graph([*study_tasks(RING.name, preset), *prediction_tasks(RING.name, preset)], folder)
    for label, key in graph.keys.items():
        if (folder / label).is_dir():
            (folder / label / "key").write_text(f"{key}\n")
    return folder


def _predictors(ring, agent, other):
    """An untrained one, called a predictor in both forms."""
    torch.manual_seed(0)
    network = PredictorNetwork(RING, SMALL, IntentionConfig(hidden=64))
    target = Target(agent, *load_agent(other, RING), agent_sha256(other, RING))
    games = unseen_games(RING, target, network, population_folder(RING), CollectionPlan(1, 30))
    none = intention_entry(EvaluatedIntentions(*(np.zeros(1, np.int64) for _ in fields(EvaluatedIntentions))), RING)
    for form in ("stream", "window"):
        place = ring / f"intentions_{agent}_{form}"
        write_predictor(place / "predictor", network, RING, target, games, HowTrained({"updates": 7}))
        written = load_checkpoint(place / "predictor")
        write_intentions(written, network.intentions, none, {"states": 1}, place / "predictor")


@pytest.fixture
def weights(tmp_path, monkeypatch):
    """Bundled weights of a kitchen that has one set of agents."""
    return _weights(tmp_path, monkeypatch)


def _weights(folder, monkeypatch):
    ring = folder / "weights" / RING.name
    for name in BEFORE:
        kind, *rest = name.split("_", 1)
        shutil.copytree(HERE / "_".join([OURS[kind], *rest]), ring / name)
    shutil.copytree(HERE / "population", ring / "population")
    for module in (
        "models.agents.catalogue",
        "training.choose_agents",
        "training.bundle",
        "training.publish_predictor",
    ):
        monkeypatch.setattr(f"{module}.WEIGHTS", folder / "weights")
    return ring


@pytest.fixture(scope="module")
def bundled(kept, tmp_path_factory):
    """The weights after a bundling, the sums of the files before, and what was said."""
    with pytest.MonkeyPatch.context() as monkeypatch, contextlib.redirect_stdout(io.StringIO()) as said:
        ring = _weights(tmp_path_factory.mktemp("bundled"), monkeypatch)
        before = {name: (ring / name / FILE_OF[name]).read_bytes() for name in BEFORE}
        assert agent_set("sp", RING.name) == {"agent_set": "strong"}
        assert _bundle(kept) == 0
        yield ring, before, said.getvalue()


def _bundle(kept):
    size = ["--trajectories", "1", "--timesteps", "30", "--preset", str(kept / "preset.toml")]
    return kitchenmind.main(["train", "bundle", "--kept", str(kept), "--layouts", RING.name, *size])


def test_the_published_agents_take_the_names_and_the_others_stay_as_strong_ones(bundled, kept):
    ring, before, said = bundled
    assert (ring / "sp" / "sha256").read_bytes() == (kept / RING.name / "choose_sp/agent/sha256").read_bytes()
    assert (ring / "sp_strong" / "sha256").read_bytes() == before["sp"]
    assert (ring / "fcp_strong" / "sha256").read_bytes() == before["fcp"]
    predictor = load_checkpoint(ring / "sp_strong_predictor_stream")
    assert (predictor.folder / "weights.safetensors").read_bytes() == before["sp_predictor_stream"]
    assert predictor.config["agent"] == "sp_strong"
    assert predictor.config["agent_sha256"] == agent_sha256("sp_strong", RING)
    assert predictor.card.startswith("# Predictor of sp_strong on ")
    sets = [agent_set(name, RING.name) for name in ("sp", "sp_strong", "planner")]
    assert sets == [{"agent_set": "published"}, {"agent_set": "strong"}, {}]
    assert said.count("right in 16 bits") == 4


def test_predictors_of_both_agents_are_there_in_both_forms_and_8_bits(bundled):
    ring, _, _ = bundled
    for agent in ("sp", "fcp"):
        for form in ("stream", "window"):
            found = load_checkpoint(ring / f"{agent}_predictor_{form}")
            assert found.bits == 8
            assert found.config["agent_sha256"] == agent_sha256(agent, RING)


def test_population_and_partners_that_no_target_met_are_replaced_by_agents_in_8_bits(bundled):
    ring, _, _ = bundled
    members = {path.name for path in (ring / "population").iterdir()}
    assert members == {f"{name.removeprefix('population_')}_{skill}" for name in MEMBERS for skill in (35, 70, 100)}
    held_out = {path.name for path in (ring / "held_out").iterdir()}
    assert held_out == {f"{name}_{skill}" for name in ("population_sp_2", "target_sp_11") for skill in (35, 70, 100)}
    assert {load_checkpoint(path).bits for path in ring.glob("population/*")} == {8}
    assert load_checkpoint(ring / "sp").bits == 16


def test_doing_it_again_leaves_the_strong_agents(bundled):
    ring, before, _ = bundled
    keep_strong(RING)
    assert (ring / "sp_strong" / "sha256").read_bytes() == before["sp"]
    assert (ring / "sp" / "sha256").read_bytes() != before["sp"]


def test_an_interruption_does_not_lose_the_predictors_of_the_strong_agents(weights, monkeypatch):
    rename, before = Path.rename, (weights / "sp_predictor_stream" / "sha256").read_bytes()

    def interrupted(path, target):
        if len(list(weights.glob("*_strong*"))) == 1:
            raise KeyboardInterrupt
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", interrupted)
    with pytest.raises(KeyboardInterrupt):
        keep_strong(RING)
    monkeypatch.setattr(Path, "rename", rename)
    keep_strong(RING)
    assert (weights / "sp_strong_predictor_stream" / "sha256").read_bytes() == before
    assert {path.name for path in weights.glob("*_strong")} == {"sp_strong", "fcp_strong"}


@pytest.mark.parametrize("name", ["intentions_fcp_window", "population_fcp_22"])
@pytest.mark.parametrize("outdated", [False, True], ids=["missing", "other settings"])
def test_a_task_that_is_missing_or_had_other_settings_is_named_before_anything_is_replaced(
    weights, kept, tmp_path, capsys, name, outdated
):
    part = tmp_path / "part"
    shutil.copytree(kept, part)
    if outdated:
        (part / RING.name / name / "key").write_text("of an earlier preset\n")
    else:
        shutil.rmtree(part / RING.name / name)
    before = (weights / "sp" / "sha256").read_bytes()
    assert _bundle(part) == 2
    said = capsys.readouterr().err
    assert f"{name} not finished with the settings of the preset" in said
    assert f"--keep {part}" in said
    assert (weights / "sp" / "sha256").read_bytes() == before
