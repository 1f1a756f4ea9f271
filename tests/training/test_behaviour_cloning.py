"""The behaviour-cloned human imitates the people in the recordings."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from models.agents.catalogue import WEIGHTS, load_agent
from models.networks.policy import NetworkPolicy
from overcooked.constants import STAY
from overcooked.layout import load_layout
from training.behaviour_cloning import (
    NAME,
    RECORDED,
    CloningConfig,
    companions,
    make_companions,
    measured_games,
    read_human_games,
    recordings,
    save_human_bc,
    train_human_bc,
)

RING = load_layout("coordination_ring")


@pytest.fixture(scope="module")
def games():
    return read_human_games(recordings(RING), RING)


def test_every_recorded_action_is_read_for_both_people(games):
    assert len(games.actions) == len(games.observations) == 2 * 9619
    assert np.unique(games.game).tolist() == list(range(8))
    assert (games.actions[:4] == STAY).all()


def test_a_behaviour_cloned_human_predicts_people_better_than_their_most_frequent_actions(games, tmp_path):
    torch.set_num_threads(1)
    config = CloningConfig(measured_games(8), epochs=15)
    network, figures = train_human_bc(games, RING, config)
    apart = games.actions[games.game == 7]
    shares = np.bincount(apart) / len(apart)
    assert figures["loss"] < -(shares * np.log(shares)).sum() - 0.1
    save_human_bc(tmp_path / "human_bc", network, RING, config, figures)
    agent = load_agent(str(tmp_path / "human_bc"), RING)
    assert agent.mode.temperature == 1
    seen = games.observations[:50]
    assert np.allclose(agent.policy.probabilities(seen), NetworkPolicy(network).probabilities(seen), atol=0.01)


@pytest.mark.parametrize("name", RECORDED)
def test_predictors_never_learn_with_the_people_they_are_measured_with(name):
    layout = load_layout(name)
    games = read_human_games(recordings(layout), layout)
    assert games.count == RECORDED[name]
    learnt = [config.games for config, _ in companions(games.count).values()]
    measured = set(measured_games(games.count))
    assert measured.isdisjoint(set().union(*learnt))
    assert measured.union(*learnt) == set(range(games.count))
    assert {imitated[-1] for imitated in learnt} == set(range(games.count // 2))  # each is kept apart by some


@pytest.mark.parametrize("name", RECORDED)
def test_the_bundled_behaviour_cloned_human_imitates_none_of_the_games_that_predictors_learn_from(name):
    config = json.loads((WEIGHTS / name / NAME / "config.json").read_text("utf-8"))
    card = (WEIGHTS / name / NAME / "card.md").read_text("utf-8")
    games = measured_games(RECORDED[name])
    assert (config["layout"], config["grid"]) == (name, load_layout(name).text)
    assert f"'games': {games}" in card
    assert "the people of games " + ", ".join(str(game + 1) for game in games) in card


def test_companions_are_made_for_the_kitchen_that_is_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr("training.behaviour_cloning.NETWORKS_OF_A_KIND", 1)
    monkeypatch.setattr("training.behaviour_cloning.train_human_bc", lambda games, layout, config: (layout, {}))
    made = {}
    monkeypatch.setattr("training.behaviour_cloning.save_human_bc", lambda *given: made.update({given[0].name: given}))
    layout = load_layout("forced_coordination")
    folders = make_companions(tmp_path, layout)
    assert [folder.name for folder in folders] == list(made)
    assert len(made) == 3 * 4
    assert all(given[2] is layout and set(given[3].games) == {0, 1, 2} for given in made.values())


def test_a_behaviour_cloned_human_learns_from_the_given_games_only(games):
    torch.set_num_threads(1)
    config = CloningConfig(measured_games(8), epochs=2)
    others = ~np.isin(games.game, config.games)
    changed = replace(
        games,
        observations=np.where(others[:, None, None, None], games.observations[0], games.observations),
        actions=np.where(others, STAY, games.actions),
    )
    first, again = (train_human_bc(each, RING, config)[0].state_dict() for each in (games, changed))
    assert all(torch.equal(first[name], again[name]) for name in first)


def test_a_file_without_actions_is_refused(tmp_path):
    import gzip

    with gzip.open(tmp_path / "empty.jsonl.gz", "wt") as file:
        file.write('{"k": "layout"}\n')
    with pytest.raises(ValueError, match="no recorded actions"):
        read_human_games(tmp_path / "empty.jsonl.gz", RING)
