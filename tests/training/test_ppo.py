"""PPO: its parts against second implementations, and that it learns, resumes and refuses."""

from pathlib import Path

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from models.networks.config import NetworkConfig
from models.networks.policy import build_network
from overcooked.layout import load_layout
from overcooked.state import Kitchens
from training.agent_config import AgentConfig, agent_config
from training.compute import Compute
from training.fast_networks import fast_path
from training.fused_ppo_loss import FusedLoss
from training.partners import PartnerPool
from training.ppo import PpoTrainer, SeatRows, advantage_estimates, run_settings, train
from training.ppo_loss import ppo_loss
from training.runlog import RunError, RunFolder
from training.train_agent import PEOPLE, card, snapshot_network, train_agent

RING = load_layout("coordination_ring")
SHORT = agent_config(None, ["total_timesteps=6400", "num_envs=8", "num_steps=100", "minibatch_size=400", "snapshots=4"])


def _advantages_by_definition(
    rewards: NDArray[np.float32], values: NDArray[np.float32], dones: NDArray[np.bool_], gamma: float, gae_lambda: float
) -> NDArray[np.float64]:
    """The discounted sum over all later TD errors, cut at the end of the episode."""
    steps, rows = rewards.shape
    advantages = np.zeros((steps, rows))
    for row in range(rows):
        for t in range(steps):
            weight = 1.0
            for later in range(t, steps):
                following = 0.0 if dones[later, row] else values[later + 1, row]
                advantages[t, row] += weight * (rewards[later, row] + gamma * following - values[later, row])
                if dones[later, row]:
                    break
                weight *= gamma * gae_lambda
    return advantages


def test_advantages_equal_their_definition() -> None:
    random = np.random.default_rng(3)
    rewards = random.normal(size=(40, 7)).astype(np.float32)
    values = random.normal(size=(41, 7)).astype(np.float32)
    dones = random.random((40, 7)) < 0.1
    ours = advantage_estimates(rewards, values, dones, 0.97, 0.9)
    np.testing.assert_allclose(ours, _advantages_by_definition(rewards, values, dones, 0.97, 0.9), atol=1e-4)


def test_an_untouched_policy_has_ratio_one_and_the_gradient_raises_good_actions() -> None:
    logits = torch.zeros(4, 6, requires_grad=True)
    values = torch.zeros(4)
    actions = torch.tensor([0, 1, 2, 3])
    old = logits.detach().log_softmax(-1).gather(1, actions[:, None]).squeeze(1)
    good = torch.tensor([1.0, -1.0, 1.0, -1.0])
    loss, parts = ppo_loss(logits, values, actions, old, good, torch.ones(4), AgentConfig(), 0.0)
    torch.autograd.backward(loss)
    assert logits.grad is not None
    taken = logits.grad.gather(1, actions[:, None]).squeeze(1)
    assert (taken.sign() == -good).all()
    assert float(parts[1]) == pytest.approx(1.0)  # value loss
    assert float(parts[2]) == pytest.approx(np.log(6))  # entropy
    assert float(parts[3]) == 0.0  # nothing clipped


FORMS = [
    ("mlp", "sparse"),
    ("mlp", "dense"),
    *(("cnn", form) for form in ("direct", "lanes", "sparse", "sparse_dense", "dense")),
]


@pytest.mark.parametrize("precision", ["float32", "bfloat16"])
@pytest.mark.parametrize(("kind", "form"), FORMS)
@pytest.mark.parametrize("name", ["coordination_ring", "double_rings"])
def test_every_form_computes_the_same_network(kind: str, form: str, precision: str, name: str) -> None:
    layout = load_layout(name)
    torch.manual_seed(1)
    network = build_network(NetworkConfig(kind, hidden=(64, 64, 64)), layout)
    torch.nn.init.normal_(network.head.policy.weight)
    games = Kitchens.start(layout, 32)
    random = np.random.default_rng(0)
    events = np.zeros((32, 2), np.int32)
    for _ in range(60):
        games.step(random.integers(6, size=(32, 2)), events)
    seen = games.encode()[:, 1].copy()
    fast = fast_path(network, layout, Compute("cpu", precision, form))
    exact = precision == "float32"
    logits, values = network(torch.from_numpy(seen))
    entries = torch.from_numpy(seen.reshape(32, -1)[:, fast.columns])
    for function in (fast, fast.frozen()):
        fast_logits, fast_values = function(entries)
        assert (logits - fast_logits).abs().max() < (1e-4 if exact else 0.02) * logits.abs().max()
        assert (values - fast_values).abs().max() < (1e-4 if exact else 0.05)

    gradients = []
    for answer in (logits, fast(entries)[0]):
        network.zero_grad()
        torch.autograd.backward(answer.square().mean())
        gradients.append(torch.cat([p.grad.flatten() for p in network.parameters() if p.grad is not None]))
    assert torch.nn.functional.cosine_similarity(gradients[0], gradients[1], dim=0) > (0.99999 if exact else 0.99)


@pytest.mark.parametrize("kind", ["mlp", "cnn"])
def test_partners_sit_in_both_seats_and_answer_as_they_do_alone(kind: str) -> None:
    torch.manual_seed(0)
    networks = [build_network(NetworkConfig(kind), RING) for _ in range(3)]
    for network in networks:
        torch.nn.init.normal_(network.head.policy.weight)
    pool = PartnerPool(networks, RING, games=4)
    config = agent_config(None, ["self_play_games=2"])
    seats = SeatRows(config, pool)
    assert seats.games == 2 + 3 * 4
    assert sorted([*seats.ego, *seats.partner]) == list(range(2 * seats.games))
    assert sorted((seats.partner % 2).tolist()) == [0] * 6 + [1] * 6
    seen = Kitchens.start(RING, 12).encode()[:, 0].copy()
    entries = seen.reshape(12, -1)[:, pool.columns]
    together = pool.logits(entries)
    for k, network in enumerate(networks):
        alone = network(torch.from_numpy(seen[:4]))[0].detach().numpy() / np.array([[1], [1], [0.2], [0.2]])
        np.testing.assert_allclose(together[4 * k : 4 * k + 4], alone, atol=1e-3)


@pytest.mark.parametrize("save_every_s", [0, 60])  # after each iteration, or not before the interruption
def test_an_interrupted_run_ends_exactly_as_an_uninterrupted_one(tmp_path: Path, save_every_s: float) -> None:
    settings = run_settings(SHORT, RING, 5, [])
    whole, parts = RunFolder(tmp_path / "whole", settings), RunFolder(tmp_path / "parts", settings)
    train(PpoTrainer(SHORT, RING, 5), whole)

    class Interrupted(Exception):
        pass

    def interrupt(timesteps: int, _: dict[str, float]) -> None:
        if timesteps == 3200:
            raise Interrupted

    with pytest.raises(Interrupted):
        train(PpoTrainer(SHORT, RING, 5), parts, interrupt, save_every_s)
    train(PpoTrainer(SHORT, RING, 5), RunFolder(tmp_path / "parts", settings))
    assert [line["timesteps"] for line in parts.metrics()] == [line["timesteps"] for line in whole.metrics()]
    assert [reward for _, reward, _ in parts.snapshots()] == [reward for _, reward, _ in whole.snapshots()]
    ours, theirs = whole.snapshots()[-1][2], parts.snapshots()[-1][2]
    networks = [snapshot_network(path, SHORT, RING)[0].state_dict() for path in (ours, theirs)]
    for name, tensor in networks[0].items():
        assert torch.equal(tensor, networks[1][name]), name


def test_a_run_that_is_interrupted_before_an_episode_has_ended_measures_the_same_reward(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    iteration = PpoTrainer.iteration

    def later(trainer: PpoTrainer) -> dict[str, float]:
        metrics = iteration(trainer)
        return {key: value for key, value in metrics.items() if key != "reward"} | (
            {"reward": 100.0} if trainer.timesteps > 3200 else {}
        )

    def interrupt(timesteps: int, _: dict[str, float]) -> None:
        if timesteps == 3200:
            raise KeyboardInterrupt

    monkeypatch.setattr(PpoTrainer, "iteration", later)
    folder = RunFolder(tmp_path / "run", run_settings(SHORT, RING, 5, []))
    with pytest.raises(KeyboardInterrupt):
        train(PpoTrainer(SHORT, RING, 5), folder, interrupt, 0)
    train(PpoTrainer(SHORT, RING, 5), folder)
    assert next(line["mean_reward"] for line in folder.metrics() if "reward" in line) == 100


def test_a_run_keeps_its_snapshots_evenly_and_its_learning_rate_falls_linearly(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path / "run", run_settings(SHORT, RING, 5, []))
    train(PpoTrainer(SHORT, RING, 5), folder)  # 8 iterations of 800 timesteps
    assert [timesteps for timesteps, _, _ in folder.snapshots()] == [1600, 3200, 4800, 6400]
    rates = [line["learning_rate"] for line in folder.metrics()]
    np.testing.assert_allclose(rates, 0.001 * (1 - 0.9 * np.arange(8) / 8), atol=1e-6)


def test_the_shaped_reward_of_a_useful_dish_is_the_one_in_the_settings() -> None:
    rewards = {}
    for dish in (3.0, 1.0):
        config = SHORT.changed({"dish_shaping": dish, "random_starts": 1.0, "reward_scale": 1.0}, "test")
        trainer = PpoTrainer(config, RING, 5)
        trainer.iteration()
        rewards[dish] = trainer.rewards
    fewer = rewards[3.0] - rewards[1.0]  # the same seed: the same first rollout
    assert set(np.unique(fewer)) == {0.0, 2.0}


def test_training_that_diverges_stops_with_a_remedy(tmp_path: Path) -> None:
    config = SHORT.changed({"learning_rate": 1e30}, "test")
    with pytest.raises(RunError, match=r"training diverged at .* use a smaller learning_rate"):
        train(PpoTrainer(config, RING, 5), RunFolder(tmp_path / "run", run_settings(config, RING, 5, [])))


def test_a_last_minibatch_of_one_sample_does_not_make_the_network_nan() -> None:
    config = SHORT.changed({"num_envs": 1, "num_steps": 2, "minibatch_size": 3}, "test")  # 4 samples
    trainer = PpoTrainer(config, RING, 5)
    assert np.isfinite(trainer.iteration()["value_loss"])
    assert all(tensor.isfinite().all() for tensor in trainer.network.state_dict().values())


@pytest.mark.parametrize(
    ("computed", "row"), [("cpu", "| training time, one core | 0 s |"), ("cuda", "| training time | 0 s |")]
)
def test_the_card_calls_the_time_of_a_gpu_not_that_of_one_core(tmp_path: Path, computed: str, row: str) -> None:
    folder = RunFolder(tmp_path / "run", run_settings(SHORT, RING, 5, []))
    for device in ("cpu", computed):  # it was continued on another device
        folder.note_compute(f"{device}, float32, dense", {})
    assert row in card(folder, "mine", 100, PEOPLE, {}).splitlines()


def test_a_run_folder_refuses_another_run(tmp_path: Path) -> None:
    RunFolder(tmp_path / "run", run_settings(SHORT, RING, 1, []))
    with pytest.raises(RunError, match="other settings"):
        RunFolder(tmp_path / "run", run_settings(SHORT, RING, 2, []))


def test_self_play_learns_to_fill_pots_within_a_few_seconds(tmp_path: Path) -> None:
    config = agent_config(None, ["total_timesteps=200_000"])
    folder = train_agent(config, RING, 1, tmp_path / "run")
    shaped = [line["shaped"] for line in folder.metrics() if "shaped" in line]
    assert np.mean(shaped[-5:]) > 2 * np.mean(shaped[:5])
    assert folder.done()
    assert train_agent(config, RING, 1, tmp_path / "run").metrics() == folder.metrics()


@pytest.mark.parametrize("entropy_weight", [0.0, 0.05])
def test_the_fused_loss_and_its_gradient_equal_those_of_the_formula(entropy_weight: float) -> None:
    torch.manual_seed(2)
    logits, values = torch.randn(500, 6, requires_grad=True), torch.randn(500, requires_grad=True)
    actions, advantages, targets = torch.randint(6, (500,)), torch.randn(500), torch.randn(500)
    moved = logits.detach() + 0.3 * torch.randn(500, 6)  # some ratios lie beyond the clip on either side
    old = moved.log_softmax(-1).gather(1, actions[:, None]).squeeze(1)
    arguments = (logits, values, actions, old, advantages, targets, AgentConfig(), entropy_weight)
    answers = []
    for function in (ppo_loss, FusedLoss.apply):
        logits.grad = values.grad = None
        loss, parts = function(*arguments)
        torch.autograd.backward(loss)
        assert logits.grad is not None
        assert values.grad is not None
        answers.append((loss.detach(), parts, logits.grad, values.grad))
    assert 0.1 < float(answers[0][1][3]) < 0.9  # share clipped
    for exact, fused in zip(*answers, strict=True):
        torch.testing.assert_close(fused, exact, rtol=1e-4, atol=1e-7)
