"""Device, number format and form are chosen by measuring, and nothing assumes that tensors are on the CPU."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from models.networks.config import NetworkConfig, PredictorConfig
from models.networks.policy import build_network
from models.networks.predictor import PredictorNetwork
from overcooked.layout import load_layout
from overcooked.vector_env import Starts, VectorEnv
from training.agent_config import agent_config
from training.compute import Compute, ComputeError, Request, quickest, request, requested
from training.dataset import Episodes
from training.fast_networks import choose_compute, fast_path
from training.ppo import PpoTrainer
from training.predictor_config import TrainingConfig
from training.threaded_env import ThreadedEnv, threaded_env
from training.train_agent import train_agent
from training.train_predictor import PredictorTrainer

RING = load_layout("coordination_ring")
MATRIX = load_layout("matrix")
SHORT = agent_config(None, ["total_timesteps=1600", "num_envs=8", "num_steps=100", "minibatch_size=400", "snapshots=2"])


@pytest.fixture(autouse=True)
def nothing_requested():
    yield
    request()


def test_the_quickest_candidate_wins_and_every_time_is_printed() -> None:
    work = {"small": 10, "large": 2_000_000}
    winner, times = quickest(list(work), lambda name: lambda: sum(range(work[name])))
    assert winner == "small"
    assert set(times) == {"small", "large"}
    assert times["large"] > times["small"]


def test_an_unknown_device_or_precision_is_refused_with_what_there_is() -> None:
    with pytest.raises(ComputeError, match=r"--device gpu: unknown\. Write one of auto, cpu, cuda, mps"):
        request("gpu")
    with pytest.raises(ComputeError, match="--precision float16: unknown"):
        request("cpu", "float16")
    if not torch.cuda.is_available():
        with pytest.raises(ComputeError, match="--device cuda: this machine has"):
            request("cuda")
    assert requested() == Request()


@pytest.mark.parametrize("precision", ["float32", "bfloat16"])
def test_a_requested_precision_is_used(precision: str) -> None:
    request("cpu", precision)
    compute, _ = choose_compute(NetworkConfig("mlp", hidden=(32, 32)), RING)
    assert (compute.device, compute.precision) == ("cpu", precision)


def test_the_choice_is_recorded_with_the_run_but_not_part_of_its_identity(tmp_path: Path) -> None:
    request("cpu", "float32")
    first = train_agent(SHORT, RING, 1, tmp_path / "run")
    line = json.loads((tmp_path / "run" / "compute.jsonl").read_text().splitlines()[0])
    assert line["chosen"].startswith("cpu, float32, ")
    request("cpu", "bfloat16")
    again = train_agent(SHORT, RING, 1, tmp_path / "run")  # the same run: it is done
    assert again.settings == first.settings
    assert "bfloat16" not in json.dumps(first.settings)


@pytest.mark.parametrize("kind", ["mlp", "cnn"])
def test_a_network_in_the_form_for_gpus_creates_nothing_on_the_cpu(kind: str) -> None:
    """On torch's "meta" device every operation with a tensor of another device is an error."""
    network = build_network(NetworkConfig(kind), MATRIX).to("meta")
    form = "dense" if kind == "mlp" else "direct"
    path = fast_path(network, MATRIX, Compute("meta", "float32", form))
    logits, values = path(torch.zeros(10, len(path.columns), dtype=torch.int8, device="meta"))
    assert (logits.shape, values.shape) == ((10, 6), (10,))
    (logits.sum() + values.sum()).backward()


@pytest.mark.parametrize("form", ["stream", "window"])
@pytest.mark.parametrize("encoder", ["columns", "cnn"])
def test_a_predictor_creates_nothing_on_the_cpu(form: str, encoder: str) -> None:
    network = PredictorNetwork(RING, PredictorConfig(form=form, eyes=encoder)).to("meta")
    features = torch.zeros(2, 10, network.encoder.size, device="meta")
    actions = torch.zeros(2, 10, 12, device="meta")
    present = torch.ones(2, 10, dtype=torch.bool, device="meta") if form == "window" else None
    assert network(features, actions, present).shape[-2:] == (3, 6)
    seen = torch.zeros(4, RING.width, RING.height, 26, dtype=torch.int8, device="meta")
    assert network.encoder(seen).shape == (4, network.encoder.size)


@pytest.mark.slow
def test_threads_step_the_same_games_as_environments_of_their_own() -> None:
    starts = Starts(desynchronised=True)
    together = threaded_env(RING, 10, starts, 7, 3)
    assert isinstance(together, ThreadedEnv)
    seeds = np.random.SeedSequence(7).generate_state(3).tolist()
    alone = [VectorEnv(RING, count, starts=starts, seed=seed) for count, seed in zip((3, 3, 4), seeds, strict=True)]
    random = np.random.default_rng(0)
    sparse, shaped = np.zeros((10, 2), np.int32), np.zeros((10, 2), np.int32)
    dones, seen = np.zeros(10, np.bool_), np.zeros((10, *together.observation_shape), np.int8)
    for _ in range(450):
        actions = random.integers(6, size=(10, 2))
        together.step(actions, sparse, shaped, dones, seen)
        first = 0
        for env in alone:
            here = slice(first, first + env.games)
            own = [np.zeros_like(a[here]) for a in (sparse, shaped, dones, seen)]
            env.step(actions[here], *own)
            for ours, theirs in zip((sparse, shaped, dones, seen), own, strict=True):
                np.testing.assert_array_equal(ours[here], theirs)
            first += env.games
    assert len(together.take_finished().sparse) == sum(len(env.take_finished().sparse) for env in alone) > 0


def test_ppo_learns_from_games_that_threads_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("training.ppo.threads_for", lambda device: 3)
    trainer = PpoTrainer(SHORT, RING, 1, compute=Compute("cpu", "float32", "dense"))
    assert isinstance(trainer.env, ThreadedEnv)
    assert np.isfinite(trainer.iteration()["policy_loss"])
    tensors, numbers = trainer.state()
    other = PpoTrainer(SHORT, RING, 1, compute=Compute("cpu", "float32", "dense"))
    other.restore({name: tensor.clone() for name, tensor in tensors.items()}, numbers)
    assert other.iteration()["policy_loss"] == trainer.iteration()["policy_loss"]


@pytest.mark.parametrize(("before", "after"), [(3, 1), (1, 3), (3, 2)])
def test_a_run_continues_with_another_number_of_threads(
    monkeypatch: pytest.MonkeyPatch, before: int, after: int
) -> None:
    monkeypatch.setattr("training.ppo.threads_for", lambda device: before)
    trainer = PpoTrainer(SHORT, RING, 1, compute=Compute("cpu", "float32", "dense"))
    trainer.iteration()
    tensors, numbers = trainer.state()
    monkeypatch.setattr("training.ppo.threads_for", lambda device: after)
    other = PpoTrainer(SHORT, RING, 1, compute=Compute("cpu", "float32", "dense"))
    other.restore({name: tensor.clone() for name, tensor in tensors.items()}, numbers)
    for name, array in trainer.env.state().items():
        np.testing.assert_array_equal(other.env.state()[name], array)
    np.testing.assert_array_equal(other.observations, trainer.observations)
    assert np.isfinite(other.iteration()["policy_loss"])


def test_validation_is_computed_as_the_updates_are(monkeypatch: pytest.MonkeyPatch) -> None:
    formats = []

    def evaluated(*_: object) -> SimpleNamespace:
        formats.append(torch.is_autocast_enabled("cpu"))
        return SimpleNamespace(accuracy=SimpleNamespace(mean=0.5))

    monkeypatch.setattr("training.train_predictor.evaluate", evaluated)
    network = PredictorNetwork(RING, PredictorConfig(hidden=16, layers=1, heads=2, state_width=16))
    features = torch.zeros(1, 20, network.encoder.size, dtype=torch.float16)
    actions = np.zeros((1, 20), np.int8)
    both = np.zeros((1, 20, 2), np.int8)
    games = Episodes(features, both, actions, np.ones((1, 20), np.float32), both.astype(np.int16))
    for precision in ("float32", "bfloat16"):
        trainer = PredictorTrainer(network, TrainingConfig(), games, games, Compute("cpu", precision, "direct"))
        assert trainer.validate().accuracy.mean == 0.5
    assert formats == [False, True]
    assert not torch.is_autocast_enabled("cpu")
