"""A predictor's inputs and labels from collected games."""

import numpy as np
import pytest
import torch

from models.networks.config import PredictorConfig
from models.networks.predictor import Encoder
from overcooked.state import Kitchens
from tests.support.small_collection import RING, SMALL, planner, uniform
from training.collect import (
    collect,
    games_with,
)
from training.dataset import NONE, episodes_of, load_episodes, stream_batch, window_batch


@pytest.fixture(scope="module")
def games():
    return games_with(RING, planner(), uniform("sp_1_100"), SMALL)


def test_features_are_what_the_encoder_makes_of_the_observation(games):
    encoder = Encoder(RING, PredictorConfig())
    episodes = episodes_of(games, RING, encoder)
    for game, t in ((0, 0), (1, 30), (3, 59)):
        state = [games[name][game : game + 1, t].copy() for name in ("players", "contents")]
        seen = Kitchens(RING, *state, games["timestep"][game : game + 1, t].astype(np.int32)).encode()
        expected = encoder(torch.from_numpy(seen[:, games["seat"][game]]))[0]
        assert torch.allclose(episodes.features[game, t].float(), expected, atol=1e-3)


def test_labels_are_the_next_three_actions_and_nothing_beyond_the_end(games):
    episodes = episodes_of(games, RING, Encoder(RING, PredictorConfig()))
    own, labels = games["actions"][..., 0], episodes.labels()
    assert labels[2, 10].tolist() == own[2, 10:13].tolist()
    assert labels[2, 58].tolist() == [own[2, 58], own[2, 59], NONE]
    assert labels[2, 59].tolist() == [own[2, 59], NONE, NONE]


def test_a_stretch_shows_the_joint_action_before_each_state(games):
    episodes = episodes_of(games, RING, Encoder(RING, PredictorConfig()))
    _, actions, labels = stream_batch(episodes, episodes.labels(), np.array([1]), np.array([20]), 5)
    for k in range(5):
        first, second = games["actions"][1, 19 + k]
        assert actions[0, k].nonzero().flatten().tolist() == [first, 6 + second]
        assert labels[0, k, 0] == games["actions"][1, 20 + k, 0]
    start = stream_batch(episodes, episodes.labels(), np.array([1]), np.array([0]), 1)[1]
    assert not start.any()


def test_a_window_shows_ten_actions_with_the_current_one_hidden(games):
    episodes = episodes_of(games, RING, Encoder(RING, PredictorConfig()))
    features, actions, present, labels = window_batch(episodes, episodes.labels(), np.array([2, 2]), np.array([25, 3]))
    assert present.sum(1).tolist() == [10, 4]
    assert not actions[:, -1].any()
    for place, t in enumerate(range(16, 25)):
        first, second = games["actions"][2, t]
        assert actions[0, place].nonzero().flatten().tolist() == [first, 6 + second]
    assert not actions[1, :6].any()
    assert not features[1, :6].any()
    assert torch.equal(features[1, 6:], episodes.features[2, :4].float())
    assert labels[:, 0].tolist() == [games["actions"][2, 25, 0], games["actions"][2, 3, 0]]


def test_a_split_without_partners_is_reported(tmp_path):
    collect(tmp_path, RING, planner(), [uniform(f"sp_{k}") for k in range(3)], SMALL)
    encoder = Encoder(RING, PredictorConfig())
    assert len(load_episodes(tmp_path, "test", RING, encoder)) == 4
    with pytest.raises(ValueError, match="kept for nobody"):
        load_episodes(tmp_path, "nobody", RING, encoder)


def test_what_a_partner_does_next_is_known_up_to_the_last_timestep():
    shard = games_with(RING, planner(), uniform("random"), SMALL)
    episodes = episodes_of(shard, RING, Encoder(RING, PredictorConfig()))
    labels = episodes.partner_labels()
    did = shard["actions"][0, :, 1]
    for step in range(3):
        known = len(did) - 1 - step
        assert labels[0, :known, step].tolist() == did[step : step + known].tolist()
        assert (labels[0, known:, step] == NONE).all()
