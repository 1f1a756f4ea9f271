"""The cloned human does what people did in the recordings."""

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
    RECORDINGS,
    CloningConfig,
    clone,
    companions,
    read_human_games,
    save_clone,
)

RING = load_layout("coordination_ring")


@pytest.fixture(scope="module")
def games():
    return read_human_games(RECORDINGS, RING)


def test_every_recorded_action_is_read_for_both_people(games):
    assert len(games.actions) == len(games.observations) == 2 * 9619
    assert np.unique(games.game).tolist() == list(range(8))
    assert (games.actions[:4] == STAY).all()


def test_a_clone_predicts_people_better_than_their_habits_alone(games, tmp_path):
    torch.set_num_threads(1)
    config = CloningConfig(epochs=15)
    network, figures = clone(games, RING, config)
    apart = games.actions[games.game == 7]
    shares = np.bincount(apart) / len(apart)
    assert figures["loss"] < -(shares * np.log(shares)).sum() - 0.1
    save_clone(tmp_path / "human_bc", network, RING, config, figures)
    agent = load_agent(str(tmp_path / "human_bc"), RING)
    assert agent.mode.temperature == 1
    seen = games.observations[:50]
    assert np.allclose(agent.policy.probabilities(seen), NetworkPolicy(network).probabilities(seen), atol=0.01)


def test_predictors_never_learn_with_the_people_they_are_measured_with():
    learnt = {game for config, _ in companions().values() for game in config.games}
    assert learnt.isdisjoint(CloningConfig().games)
    assert learnt | set(CloningConfig().games) == set(range(8))


def test_the_shipped_clone_says_which_games_it_imitates():
    card = (WEIGHTS / "coordination_ring" / NAME / "card.md").read_text()
    assert "the people of games 5, 6, 7, 8 of 8" in card


def test_a_clone_knows_only_the_games_it_is_given(games):
    torch.set_num_threads(1)
    config = CloningConfig(epochs=2)
    others = ~np.isin(games.game, config.games)
    changed = replace(
        games,
        observations=np.where(others[:, None, None, None], games.observations[0], games.observations),
        actions=np.where(others, STAY, games.actions),
    )
    first, again = (clone(each, RING, config)[0].state_dict() for each in (games, changed))
    assert all(torch.equal(first[name], again[name]) for name in first)


def test_a_file_without_actions_is_refused(tmp_path):
    import gzip

    with gzip.open(tmp_path / "empty.jsonl.gz", "wt") as file:
        file.write('{"k": "layout"}\n')
    with pytest.raises(ValueError, match="no recorded actions"):
        read_human_games(tmp_path / "empty.jsonl.gz", RING)
