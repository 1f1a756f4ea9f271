"""Bundled predictors as they are served, timestep by timestep, in games with unseen partners."""

import json

import numpy as np
import pytest

from models.agents.predictors import WEIGHTS, load_predictor, predictor_names
from overcooked.interactions import possible_interactions
from overcooked.layout import load_layout
from overcooked.state import Kitchens
from training.collect import CollectionPlan, games_with
from training.intention_labels import labels_of
from training.population import load_target
from training.publish_predictor import population_folder, unseen_partners

RING = load_layout("coordination_ring")
TIMESTEPS = 200


@pytest.fixture(scope="module")
def games():
    """The SP agent's games with the test partners at their best."""
    partners = [one for one in unseen_partners(RING, population_folder(RING)) if "_100" in one.name]
    target, plan = load_target("sp", RING), CollectionPlan(trajectories=2, timesteps=TIMESTEPS)
    shards = [games_with(RING, target, partner, plan) for partner in partners]
    return {name: np.concatenate([shard[name] for shard in shards]) for name in shards[0]}


def asked(predictor, games):
    """Call the predictor like the live game: the state, and the joint action that led to it. Yields timestep,
    arguments, prediction."""
    number = np.arange(len(games["seat"]))
    predictor.begin(number)
    for t in range(TIMESTEPS):
        clock = games["timestep"][:, t].astype(np.int32)
        kitchens = Kitchens(RING, games["players"][:, t].copy(), games["contents"][:, t].copy(), clock)
        before = games["actions"][:, t - 1] if t else np.full((len(number), 2), -1, np.int8)
        arguments = (number, kitchens.encode()[number, games["seat"]], before)
        yield t, arguments, predictor.predict(*arguments)


def share_of_right_steps(name, games):
    answers = asked(load_predictor(name, RING), games)
    right = [said.argmax(-1) == games["actions"][:, t : t + 3, 0] for t, _, said in answers if t + 2 < TIMESTEPS]
    return float(np.mean(right))


def test_intentions_of_a_bundled_predictor_are_as_accurate_in_play_as_its_card_says(games):
    predictor = load_predictor("sp_predictor_stream", RING)
    said = np.stack([predictor.intentions(*arguments)[:, 0] for _, arguments, _ in asked(predictor, games)], 1)
    labels = labels_of(games, RING)
    came = np.array(possible_interactions(RING), np.int64)[labels.classes]
    right = (np.stack([said["kind"], said["x"], said["y"]], -1) == came).all(-1)
    config = json.loads((WEIGHTS / RING.name / "sp_predictor_stream" / "config.json").read_text())
    share = config["measured_intentions"]["before"]["5"]["kind_and_station"] / 100
    assert right[labels.steps == 5].mean() == pytest.approx(share, abs=0.06)


@pytest.mark.parametrize("name", [name for name in predictor_names(RING) if name.startswith("sp_predictor_")])
def test_a_bundled_predictor_is_as_accurate_in_play_as_on_its_card(name, games):
    card = json.loads((WEIGHTS / RING.name / name / "config.json").read_text())["accuracy"]["mean"]
    assert share_of_right_steps(name, games) == pytest.approx(card, abs=0.06)


@pytest.mark.parametrize("percent", [60, 40])
def test_a_predictor_made_worse_is_right_as_often_as_was_asked_for(percent, games):
    assert share_of_right_steps(f"sp_predictor_stream@{percent}", games) == pytest.approx(percent / 100, abs=0.04)
