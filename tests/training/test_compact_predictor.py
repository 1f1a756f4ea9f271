"""A trained predictor in half the bytes."""

from copy import deepcopy
from dataclasses import fields

import numpy as np
import pytest
import torch

import kitchenmind
from models.agents.catalogue import agent_sha256, load_agent
from models.networks.checkpoint import load_checkpoint
from models.networks.config import IntentionConfig, PredictorConfig
from models.networks.predictor import PredictorNetwork, predictor_network
from overcooked.layout import load_layout
from training.collect import CollectionPlan, Target
from training.compact_predictor import with_baseline
from training.evaluate_intentions import EvaluatedIntentions, intention_entry
from training.evaluate_predictor import evaluate, logits
from training.publish_intentions import write_intentions
from training.publish_predictor import HowTrained, population_folder, unseen_games, write_predictor

RING = load_layout("coordination_ring")
SMALL = PredictorConfig(hidden=64, layers=2, heads=2, feed_forward=128, state_width=64, action_width=8)
PLAN = CollectionPlan(1, 60)


@pytest.fixture(scope="module")
def games():
    planner = load_agent("planner", RING)
    target = Target("planner", planner.policy, planner.mode, agent_sha256("planner", RING))
    return unseen_games(RING, target, PredictorNetwork(RING, SMALL), population_folder(RING), PLAN), target


@pytest.fixture(scope="module")
def folders(games, tmp_path_factory):
    """An untrained predictor with an untrained decoder of intentions, and the same in 8 bits."""
    torch.set_num_threads(1)
    torch.manual_seed(0)
    found, target = games
    folder = tmp_path_factory.mktemp("weights")
    network = PredictorNetwork(RING, SMALL, IntentionConfig(hidden=64))
    write_predictor(folder / "before", network, RING, target, found, HowTrained({"updates": 7}))
    one = intention_entry(EvaluatedIntentions(*(np.zeros(1, np.int64) for _ in fields(EvaluatedIntentions))), RING)
    write_intentions(load_checkpoint(folder / "before"), network.intentions, one, {"states": 1}, folder / "before")
    assert _compact(folder / "before", "--out", str(folder / "after")) == 0
    return folder / "before", folder / "after"


def _compact(folder, *options):
    size = ("--trajectories", "1", "--timesteps", "60")
    return kitchenmind.main(["train", "compact", "--predictor", str(folder), *size, *options])


def test_the_weights_take_little_more_than_half_the_bytes(folders):
    before, after = ((folder / "weights.safetensors").stat().st_size for folder in folders)
    assert after < 0.65 * before
    assert [load_checkpoint(folder).bits for folder in folders] == [16, 8]


def test_it_has_the_same_values_except_for_rounding(folders, games):
    before, after = (logits(predictor_network(load_checkpoint(folder))[0], games[0]).softmax(-1) for folder in folders)
    assert not torch.equal(before, after)
    assert (before - after).abs().max() < 0.05


def test_accuracy_and_intentions_are_measured_with_the_weights_as_stored(folders, games):
    checkpoint = load_checkpoint(folders[1])
    network, _ = predictor_network(checkpoint)
    assert checkpoint.config["measured"] == evaluate(network, games[0]).entry(RING.name, "planner", "stream")
    assert checkpoint.config["measured_intentions"]["states"] > 900


def test_the_card_gets_the_new_figures_and_keeps_how_it_was_trained(folders, games):
    old, new = (load_checkpoint(folder) for folder in folders)
    mean = 100 * evaluate(predictor_network(old)[0], games[0]).accuracy.mean
    assert f"| stored with | 8 bits for each weight of a matrix; mean accuracy before: {mean:.2f} % |" in new.card
    assert [line for line in old.card.splitlines() if line.startswith(("| updates", "| states |", "#"))] == [
        line for line in new.card.splitlines() if line.startswith(("| updates", "| states |", "#"))
    ]
    assert f"{new.config['measured_intentions']['before']['5']['states']:,} |" in new.card
    assert len(new.card.splitlines()) == len(old.card.splitlines()) + 1


def test_the_baseline_of_the_same_states_stays_as_it_was_counted_in_all_games(folders):
    earlier = load_checkpoint(folders[1]).config["measured_intentions"]
    counted = deepcopy(earlier)
    counted["frequent"] = counted["before"]["10"]["frequent"] = -1.0
    with_baseline(counted, earlier)
    assert counted == earlier
    others = {**deepcopy(counted), "states": counted["states"] + 1, "frequent": 12.5}
    with_baseline(others, earlier)
    assert others["frequent"] == 12.5


def test_new_intentions_leave_it_as_it_is(folders, tmp_path):
    compacted = load_checkpoint(folders[1])
    network, _ = predictor_network(compacted)
    write_intentions(compacted, network.intentions, compacted.config["measured_intentions"], {}, tmp_path / "again")
    again = load_checkpoint(tmp_path / "again")
    assert again.bits == 8
    assert {name: tensor.tobytes() for name, tensor in again.tensors.items()} == {
        name: tensor.tobytes() for name, tensor in compacted.tensors.items()
    }


def test_a_second_run_changes_nothing(folders, capsys):
    assert _compact(folders[1]) == 2
    assert "is stored with 8 bits already. There is nothing to do." in capsys.readouterr().err


def test_another_agent_than_the_predicted_one_is_refused(folders, tmp_path, capsys):
    assert _compact(folders[0], "--agent", "random", "--out", str(tmp_path / "none")) == 2
    assert "predicts another agent than random. Say which: --agent." in capsys.readouterr().err
    assert not (tmp_path / "none").exists()
