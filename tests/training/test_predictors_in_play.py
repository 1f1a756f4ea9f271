"""Bundled predictors as they are served, timestep by timestep, against games with partners that they never met."""

import json

import numpy as np
import pytest

from models.agents.predictors import WEIGHTS, load_predictor, predictor_names
from overcooked.layout import load_layout
from overcooked.state import Kitchens
from training.collect import CollectionPlan, games_with
from training.population import load_population, load_target
from training.publish_predictor import population_folder
from training.publish_predictor import test_partners as unseen_partners

RING = load_layout("coordination_ring")
TIMESTEPS = 200


@pytest.fixture(scope="module")
def games():
    """The SP agent's games with the test partners at their best."""
    partners = [one for one in unseen_partners(load_population(population_folder(RING), RING)) if "_100" in one.name]
    target, plan = load_target("sp", RING), CollectionPlan(trajectories=2, timesteps=TIMESTEPS)
    shards = [games_with(RING, target, partner, plan) for partner in partners]
    return {name: np.concatenate([shard[name] for shard in shards]) for name in shards[0]}


def share_of_right_steps(name, games):
    """Ask as the live game does: the state, and the joint action that led to it."""
    predictor, number = load_predictor(name, RING), np.arange(len(games["seat"]))
    predictor.begin(number)
    right = []
    for t in range(TIMESTEPS):
        clock = games["timestep"][:, t].astype(np.int32)
        kitchens = Kitchens(RING, games["players"][:, t].copy(), games["contents"][:, t].copy(), clock)
        before = games["actions"][:, t - 1] if t else np.full((len(number), 2), -1, np.int8)
        said = predictor.predict(number, kitchens.encode()[number, games["seat"]], before).argmax(-1)
        if t + 2 < TIMESTEPS:
            right.append(said == games["actions"][:, t : t + 3, 0])
    return float(np.mean(right))


@pytest.mark.parametrize("name", [name for name in predictor_names(RING) if name.startswith("sp_")])
def test_a_bundled_predictor_is_as_good_in_play_as_its_card_says(name, games):
    card = json.loads((WEIGHTS / RING.name / name / "config.json").read_text())["accuracy"]["mean"]
    assert share_of_right_steps(name, games) == pytest.approx(card, abs=0.06)


@pytest.mark.parametrize("percent", [60, 40])
def test_a_predictor_made_worse_is_right_as_often_as_was_asked_for(percent, games):
    assert share_of_right_steps(f"sp_predictor_stream@{percent}", games) == pytest.approx(percent / 100, abs=0.04)
