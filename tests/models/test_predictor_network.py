"""The transformer's two forms: what is served timestep by timestep equals what is trained in one piece."""

import numpy as np
import pytest
import torch

from models.inference.predictor_numpy import load_trained_predictor, numpy_predictor
from models.networks.checkpoint import CheckpointError
from models.networks.config import IntentionConfig, PredictorConfig
from models.networks.predictor import PredictorNetwork, full_attention, one_hot, predictor_network, save_predictor
from models.protocols import HISTORY
from overcooked.interactions import possible_interactions
from overcooked.layout import load_layout
from overcooked.state import Kitchens

RING = load_layout("coordination_ring")
POSSIBLE = possible_interactions(RING)


def network(form, encoder="columns", seed=0, intentions=None):
    torch.manual_seed(seed)
    made = PredictorNetwork(RING, PredictorConfig(form=form, eyes=encoder, look_back=6), intentions)
    with torch.no_grad():
        for parameter in made.parameters():
            parameter += 0.05 * torch.randn_like(parameter)
    return made.eval()


def as_numpy(made):
    tensors = {name: tensor.numpy() for name, tensor in made.state_dict().items()}
    return numpy_predictor(made.config, tensors, RING, made.intentions.config if made.intentions else None)


def played(games, timesteps, seed=0):
    """Observations (games, timesteps + 1, w, h, 26) of the first chef and the joint actions that led to them."""
    draws = np.random.default_rng(seed)
    kitchens, events = Kitchens.start(RING, games), np.zeros((games, 2), np.int32)
    observations, actions = [kitchens.encode()[:, 0]], [np.full((games, 2), -1, np.int8)]
    for _ in range(timesteps):
        actions.append(draws.integers(0, 6, (games, 2)).astype(np.int8))
        kitchens.step(actions[-1], events)
        observations.append(kitchens.encode()[:, 0])
    return np.stack(observations, 1), np.stack(actions, 1)


def step_by_step(predictor, observations, actions):
    slots = np.arange(len(observations))
    predictor.begin(slots)
    answers = [predictor.predict(slots, observations[:, t], actions[:, t]) for t in range(observations.shape[1])]
    return np.stack(answers, 1)


@torch.inference_mode()
def in_one_piece(made, observations, actions):
    """(games, timesteps, 3, 6): the network as training calls it."""
    games, timesteps = observations.shape[:2]
    features = made.encoder(torch.from_numpy(observations.reshape(-1, *observations.shape[2:]))).view(
        games, timesteps, -1
    )
    if made.config.form == "stream":
        return made(features, torch.from_numpy(one_hot(actions))).softmax(-1).numpy()
    answers = []
    for t in range(timesteps):
        first = max(0, t - HISTORY + 1)
        pad = HISTORY - (t - first + 1)
        seen = torch.nn.functional.pad(features[:, first : t + 1], (0, 0, pad, 0))
        none = np.full((games, 1, 2), -1, np.int8)
        joint = np.concatenate([np.repeat(none, pad, 1), actions[:, first + 1 : t + 1], none], 1)
        present = torch.arange(HISTORY).expand(games, -1) >= pad
        answers.append(made(seen, torch.from_numpy(one_hot(joint)), present).softmax(-1))
    return torch.stack(answers, 1).numpy()


@pytest.mark.parametrize("form", ["stream", "window"])
@pytest.mark.parametrize("encoder", ["columns", "cnn"])
def test_timestep_by_timestep_equals_one_piece(form, encoder):
    observations, actions = played(5, 25)
    made = network(form, encoder)
    expected = in_one_piece(made, observations, actions)
    assert np.abs(step_by_step(as_numpy(made), observations, actions) - expected).max() < 1e-4
    assert expected.std(axis=1).max() > 0.01


def test_attention_in_16_bits_is_that_in_32_but_for_rounding():
    torch.manual_seed(0)
    q, k, v = torch.randn(3, 5, 8, HISTORY, 16).unbind(0)
    mask = torch.arange(HISTORY).expand(5, 1, 1, -1) >= torch.tensor([0, 2, 5, 8, 9]).view(5, 1, 1, 1)
    exact = full_attention(q, k, v, mask)
    rounded = full_attention(q.bfloat16(), k.bfloat16(), v.bfloat16(), mask)
    assert rounded.dtype == torch.bfloat16
    assert (rounded.float() - exact).abs().max() < 0.05
    alone = full_attention(q[:, :, -1:].bfloat16(), k.bfloat16(), v.bfloat16(), mask)
    assert torch.equal(alone, rounded[:, :, -1:])


@pytest.mark.parametrize("form", ["stream", "window"])
def test_memory_is_all_that_a_restart_needs(form):
    observations, actions = played(2, 60)
    predictor = as_numpy(network(form))
    whole = step_by_step(predictor, observations, actions)[:, -1]
    newest = slice(observations.shape[1] - predictor.memory, None)
    again = step_by_step(predictor, observations[:, newest], actions[:, newest])[:, -1]
    assert np.abs(whole - again).max() < 1e-4


@pytest.mark.parametrize("form", ["stream", "window"])
def test_a_game_does_not_depend_on_the_other_games_of_its_batch(form):
    observations, actions = played(70, 6)
    predictor = as_numpy(network(form))
    together = step_by_step(predictor, observations, actions)
    alone = step_by_step(predictor, observations[66:67], actions[66:67])
    assert np.abs(together[66] - alone[0]).max() < 1e-4


@pytest.mark.parametrize("form", ["stream", "window"])
def test_a_restarted_slot_has_no_memory_of_the_previous_game(form):
    predictor = as_numpy(network(form))
    first, second = played(3, 20, seed=1), played(3, 20, seed=2)
    fresh = step_by_step(as_numpy(network(form)), *second)
    step_by_step(predictor, *first)
    assert np.array_equal(step_by_step(predictor, *second), fresh)


def test_a_prediction_never_sees_the_action_about_to_be_taken():
    observations, actions = played(2, 30)
    made = network("stream")
    before = in_one_piece(made, observations[:, :20], actions[:, :20])
    changed = actions.copy()
    changed[:, 20:] = 5 - changed[:, 20:]
    after = in_one_piece(made, observations, changed)[:, :20]
    assert np.abs(before - after).max() < 1e-5


def test_saved_predictor_gives_the_same_predictions_and_its_accuracy(tmp_path):
    observations, actions = played(4, 15)
    made = network("stream")
    save_predictor(tmp_path / "p", made, RING, "sp", "A card.", accuracy={"mean": 0.81})
    loaded, accuracy = load_trained_predictor(tmp_path / "p", RING)
    assert accuracy == 0.81
    expected = step_by_step(as_numpy(made), observations, actions)
    assert np.abs(step_by_step(loaded, observations, actions) - expected).max() < 0.02


@torch.inference_mode()
def said_in_one_piece(made, observations, actions):
    """The two likeliest classes, their probabilities and median timesteps of the last state: (games, 2, 3)."""
    games, timesteps = observations.shape[:2]
    features = made.encoder(torch.from_numpy(observations.reshape(-1, *observations.shape[2:]))).view(
        games, timesteps, -1
    )
    if made.config.form == "stream":
        tokens = made.tokens_of_all_layers(features, torch.from_numpy(one_hot(actions)))[:, -1]
    else:
        none = np.full((games, 1, 2), -1, np.int8)
        joint = np.concatenate([actions[:, -HISTORY + 1 :], none], 1)
        present = torch.ones(games, HISTORY, dtype=torch.bool)
        tokens = made.tokens_of_all_layers(features[:, -HISTORY:], torch.from_numpy(one_hot(joint)), present)
    inside = made.intentions.inside(tokens)
    top = made.intentions.class_logits(inside).softmax(-1).topk(2, -1)
    when = made.intentions.when_logits(inside[:, None].expand(-1, 2, -1), top.indices).softmax(-1)
    steps = torch.where(top.indices > 0, 1 + (when.cumsum(-1) < 0.5).sum(-1), 0)
    return torch.stack([top.indices, steps, top.values], -1).numpy()


@pytest.mark.parametrize("form", ["stream", "window"])
def test_numpy_intentions_equal_those_of_the_trained_network(form):
    observations, actions = played(9, 14)
    made = network(form, intentions=IntentionConfig(hidden=48, when_hidden=16))
    with torch.no_grad():
        made.intentions.temperature[:] = torch.tensor([0.7, 1.6])
    expected = said_in_one_piece(made, observations, actions)
    predictor = as_numpy(made)
    step_by_step(predictor, observations, actions)
    said = predictor.intentions(np.arange(9), observations[:, -1], actions[:, -1])
    found = [[POSSIBLE.index(tuple(each)) for each in game] for game in said[["kind", "x", "y"]].tolist()]
    assert found == expected[..., 0].astype(int).tolist()
    assert said["steps"].tolist() == expected[..., 1].astype(int).tolist()
    assert np.abs(said["probability"] - expected[..., 2]).max() < 1e-4
    assert len(np.unique(said["steps"])) > 1


def test_a_predictor_without_a_decoder_says_no_intentions():
    observations, actions = played(3, 2)
    predictor = as_numpy(network("stream"))
    step_by_step(predictor, observations, actions)
    assert not predictor.intentions(np.arange(3), observations[:, -1], actions[:, -1])["probability"].any()


def test_a_predictor_of_another_kitchen_is_refused(tmp_path):
    save_predictor(tmp_path / "p", network("stream"), RING, "sp", "A card.")
    with pytest.raises(CheckpointError, match="another grid"):
        load_trained_predictor(tmp_path / "p", load_layout("matrix"))


def test_an_agent_is_not_a_predictor(tmp_path):
    from models.networks.checkpoint import load_checkpoint, save_checkpoint

    save_checkpoint(tmp_path / "a", {"format": "other"}, {"x": torch.zeros(1)}, "A card.")
    with pytest.raises(CheckpointError, match="not a readable predictor"):
        predictor_network(load_checkpoint(tmp_path / "a"))
