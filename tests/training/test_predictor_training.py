"""Training a predictor: learning, measuring, resuming, and writing it with its card."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
import torch

import kitchenmind
from models.agents.catalogue import load_agent
from models.inference.predictor_numpy import load_trained_predictor
from models.networks.checkpoint import load_checkpoint
from models.networks.config import NetworkConfig, PredictorConfig
from models.networks.policy import build_network, save_agent
from models.networks.predictor import PredictorNetwork, predictor_network
from models.protocols import Mode
from overcooked.layout import load_layout
from training import compute
from training import train_predictor as training
from training.collect import TEST, CollectionPlan, Partner, Target, collect, read_manifest
from training.dataset import load_episodes
from training.evaluate_predictor import STUCK_AFTER, calibration_error, evaluate, fitted_temperature, logits
from training.predictor_config import NetworkSettings, TrainingConfig, changed
from training.publish_predictor import HowTrained, partners_met, write_predictor
from training.runlog import RunFolder
from training.settings import ConfigError, parsed_changes
from training.train_predictor import prepared, train_predictor

RING = load_layout("coordination_ring")
TINY = {"hidden": 32, "layers": 2, "heads": 2, "feed_forward": 64, "state_width": 48, "action_width": 8, "dropout": 0.0}
QUICK = TrainingConfig(updates=120, warm_up=10, stretches=8, stretch=40, windows=64, check_every=40)


def target():
    agent = load_agent("planner", RING)
    return Target("planner", agent.policy, agent.mode, "0" * 64)


@pytest.fixture(scope="module")
def games(tmp_path_factory):
    """The planner's games with five others, one of them for validation and one for the test."""
    folder = tmp_path_factory.mktemp("games")
    others = [Partner(f"sp_{k}_100", f"sp_{k}", "sp", *load_agent("planner", RING)) for k in range(4)]
    others.append(Partner("sp_9_100", "sp_9", "sp", load_agent("random", RING).policy))
    collect(folder, RING, target(), others, CollectionPlan(trajectories=1, timesteps=200))
    return folder


@pytest.fixture(scope="module", autouse=True)
def one_number_format():
    """Each run measures which format is the fastest: two runs have the same weights only with the same one."""
    before = compute.requested()
    compute.request(precision="float32")
    yield
    compute.request(before.device, before.precision)


@pytest.fixture(autouse=True)
def one_thread():
    torch.set_num_threads(1)


def trained(form, games, folder, config=QUICK):
    trainer = prepared(RING, PredictorConfig(form=form, **TINY), config, games)
    return train_predictor(trainer, RunFolder(folder, {"form": form})), trainer


@pytest.fixture(scope="module")
def stream(games, tmp_path_factory):
    """A whole training of the stream form: the network, its trainer, the folder of the run."""
    torch.set_num_threads(1)
    folder = tmp_path_factory.mktemp("stream")
    return *trained("stream", games, folder), folder


def learned(network, trainer):
    result = evaluate(network, trainer.validation)
    assert result.accuracy.mean > max(result.repeat.mean, result.frequent.mean)
    assert result.loss < 3 * np.log(6)


def test_the_stream_form_learns_to_predict_better_than_the_baselines(stream):
    learned(*stream[:2])


@pytest.mark.slow
def test_the_window_form_learns_to_predict_better_than_the_baselines(games, tmp_path):
    learned(*trained("window", games, tmp_path))


def test_an_interrupted_run_continues_to_the_same_weights(stream, games, tmp_path):
    whole = stream[0]
    with pytest.raises(TimeoutError, match="the same command continues"):
        trained("stream", games, tmp_path / "parts", QUICK.model_copy(update={"minutes": 0.0}))
    for _ in range(5):
        try:
            parts, trainer = trained("stream", games, tmp_path / "parts", QUICK.model_copy(update={"minutes": 0.0}))
            break
        except TimeoutError:
            continue
    assert trainer.update == QUICK.updates
    for (name, one), (_, other) in zip(whole.named_parameters(), parts.named_parameters(), strict=True):
        assert torch.equal(one, other), name


def test_training_stops_when_validation_gets_no_better(games, tmp_path):
    settings = QUICK.model_copy(update={"learning_rate": 0.0, "patience": 2, "check_every": 5})
    _, trainer = trained("stream", games, tmp_path, settings)
    assert trainer.update == 15


def test_the_stored_weights_are_a_moving_average_whose_decay_grows(games):
    trainer = prepared(RING, PredictorConfig(form="stream", **TINY), QUICK, games)
    name, expected = next(iter(trainer.average.items()))
    expected = expected.clone()
    for update in (1, 2, 3):
        trainer.step()
        now = dict(trainer.network.named_parameters())[name].detach()
        expected += (1 - update / (update + 10)) * (now - expected)
    assert torch.allclose(trainer.average[name], expected, atol=1e-6)
    assert not torch.allclose(trainer.average[name], now, atol=1e-6)


def test_training_ends_after_as_many_validations_without_improvement_as_its_patience(games, monkeypatch):
    trainer = prepared(RING, PredictorConfig(form="stream", **TINY), QUICK.changed({"patience": 2}, "test"), games)
    ends = []
    for accuracy in (0.2, 0.1, 0.3, 0.2, 0.25):
        found = SimpleNamespace(accuracy=SimpleNamespace(mean=accuracy))
        monkeypatch.setattr(training, "evaluate", lambda *_, found=found: found)
        trainer.validate()
        ends.append(trainer.finished())
    assert ends == [False, False, False, False, True]
    assert trainer.best_accuracy == 0.3


def test_metrics_are_written_during_training(stream):
    lines = [json.loads(line) for line in (stream[2] / "metrics.jsonl").read_text().splitlines()]
    assert [line["timesteps"] for line in lines] == [40, 80, 120]
    assert {"loss", "validation_loss", "accuracy", "step1", "step2", "step3"} <= set(lines[0])


def test_accuracy_of_a_network_is_what_counting_gives(games):
    torch.manual_seed(0)
    network = PredictorNetwork(RING, PredictorConfig(form="stream", **TINY)).eval()
    episodes = load_episodes(games, TEST, RING, network.encoder)
    said = logits(network, episodes).argmax(-1).numpy()
    right = counted = 0
    for episode in range(len(episodes)):
        for t in range(200 - 2):
            right += int(said[episode, t, 2] == episodes.own[episode, t + 2])
            counted += 1
    result = evaluate(network, episodes)
    assert result.accuracy.steps[2] == pytest.approx(right / counted)
    assert result.windows == len(episodes) * 200


def test_baselines_are_as_documented(games):
    network = PredictorNetwork(RING, PredictorConfig(form="stream", **TINY))
    episodes = load_episodes(games, TEST, RING, network.encoder)
    result = evaluate(network, episodes, frequent_action=4)
    assert result.frequent.steps[0] == pytest.approx((episodes.own == 4).mean())
    repeated = np.concatenate([episodes.own[:, :1] == 0, episodes.own[:, 1:] == episodes.own[:, :-1]], 1)
    assert result.repeat.steps[0] == pytest.approx(repeated.mean())
    assert result.ceiling == pytest.approx(episodes.certainty.mean())
    free = (episodes.stuck < STUCK_AFTER).all(-1)  # neither chef is stuck
    assert 0 < free.mean() < (episodes.stuck < STUCK_AFTER).any(-1).mean()
    assert result.free_frequent.steps[0] == pytest.approx((episodes.own == 4)[free].mean())


def test_calibration_error_of_an_overconfident_predictor():
    confidence = np.full(1000, 0.9)
    right = np.arange(1000) < 600
    assert calibration_error(confidence, right) == pytest.approx(0.3)
    assert calibration_error(np.full(1000, 0.6), right) == pytest.approx(0.0, abs=1e-9)


def test_temperature_scaling_calibrates_confidence():
    draws = torch.Generator().manual_seed(0)
    honest = torch.randn(40, 50, 3, 6, generator=draws)
    labels = torch.distributions.Categorical(logits=honest).sample()
    fitted = fitted_temperature(honest * 3, labels)
    assert torch.allclose(fitted, torch.full((3,), 3.0), atol=0.4)


def test_the_card_of_a_bundled_predictor_describes_it(stream, games, tmp_path):
    network = stream[0]
    test = load_episodes(games, TEST, RING, network.encoder)
    result = write_predictor(tmp_path / "p", network, RING, target(), test, HowTrained({"seed": 0}))
    card = (tmp_path / "p" / "card.md").read_text()
    assert f"{100 * result.accuracy.mean:.1f}" in card
    assert "after 3 timesteps without a change" in card
    stored, _ = predictor_network(load_checkpoint(tmp_path / "p"))
    assert evaluate(stored, test).accuracy.mean == pytest.approx(result.accuracy.mean, abs=0.01)
    assert load_trained_predictor(tmp_path / "p", RING)[1] == round(result.accuracy.mean, 4)


def test_a_card_lists_the_training_and_the_held_out_partners_of_a_predictor(games, tmp_path):
    manifest = read_manifest(games)
    extras = ("extra_human_00", "extra_human_01", "itself_noise_30")
    more = {name: {"kind": "extra", "split": "train"} for name in extras}
    met = partners_met({**manifest, "shards": {**manifest["shards"], **more}})
    assert met == {
        "learned with": "sp_0, sp_1, sp_2; 2 behaviour-cloned humans; 1 noisy or scripted",
        "stopped on": "sp_3",
        "measured with": "sp_9",
    }


def test_an_unknown_setting_names_the_known_ones():
    configs = (PredictorConfig(), TrainingConfig())
    assert (
        changed(configs, parsed_changes(["updates=1_000", "attention_window=8", "learning_rate=1"]), "--set")[
            0
        ].look_back
        == 8
    )
    with pytest.raises(ConfigError, match=r"unknown key 'colour'. Known: form, .*updates"):
        changed(configs, {"colour": "red"}, "--set")
    with pytest.raises(ConfigError, match=r"updates is 'many'. Write a whole number"):
        changed(configs, {"updates": "many"}, "--set")
    with pytest.raises(ConfigError, match="key=value"):
        parsed_changes(["updates"])
    with pytest.raises(ConfigError, match=r"--set: hidden is 100\. Write a multiple of 16 \(twice the heads\)\."):
        changed(configs, {"hidden": 100}, "--set")
    with pytest.raises(ConfigError, match=r"encoder is 'ears'. Write 'columns' or 'cnn'"):
        changed(configs, {"eyes": "ears"}, "--set")


def test_the_settings_of_the_network_are_those_that_its_weights_store():
    assert PredictorConfig(**NetworkSettings().stored()) == PredictorConfig()


def test_collecting_training_and_predicting_by_the_command_line(tmp_path, capsys, monkeypatch):
    config = NetworkConfig(hidden=(16,))
    for seed in (1, 2, 3):
        name = f"population_sp_{seed}_100"
        save_agent(
            tmp_path / "population" / name, build_network(config, RING), config, RING, Mode(), "A card.", agent=name
        )
    monkeypatch.chdir(tmp_path)
    common = ["--layout", "coordination_ring", "--agent", "planner"]
    collecting = ["collect", *common, "--population", "population", "--trajectories", "1", "--timesteps", "60"]
    assert kitchenmind.main([*collecting, "--no-extras"]) == 0
    small = [
        word for key, value in {**TINY, "updates": 4, "check_every": 2}.items() for word in ("--set", f"{key}={value}")
    ]
    assert kitchenmind.main(["train", "predictor", *common, "--preset", "tiny", *small, "--out", "made"]) == 0
    told = capsys.readouterr().out
    assert "on partners never seen" in told
    assert "next interaction and station right in" in told
    assert load_checkpoint(tmp_path / "made").config["agent"] == "planner"
    assert kitchenmind.main(["collect", *common, "--population", "nowhere"]) == 2
    assert "no population is there" in capsys.readouterr().err
    assert kitchenmind.main(["train", "predictor", *common, "--set", "colour=red"]) == 2
    assert "unknown key 'colour'" in capsys.readouterr().err
