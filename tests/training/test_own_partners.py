"""A predictor for an own agent: any folder of agents, a small preset, a usable result whenever training stops."""

import json
import shutil
import signal
from pathlib import Path

import pytest

import kitchenmind
from models.agents.model_paths import WEIGHTS
from models.agents.predictors import load_predictor
from overcooked.layout import load_layout
from tests.support.ctrl_c import ctrl_c_enabled
from training import train_predictor as training
from training.commands import predictor as command
from training.predictor_config import PRESETS

RING = load_layout("coordination_ring")
SMALL = ["--preset", "tiny", "--set", "updates=20", "warm_up=5", "check_every=10", "stretch=20", "stretches=4"]


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with agents of any names, and the games of one's own agent with them."""
    folder = tmp_path_factory.mktemp("lab")
    ring = WEIGHTS / "coordination_ring"
    shutil.copytree(ring / "sp", folder / "mine")
    for source, name in (("sp", "anna"), ("fcp", "berta"), ("human_bc", "cleo")):
        shutil.copytree(ring / source, folder / "friends" / name)
    shutil.copytree(ring / "sp_predictor_stream", folder / "friends" / "no_agent")
    words = ["collect", "--layout", "coordination_ring", "--agent", str(folder / "mine")]
    words += ["--partners", str(folder / "friends"), "--out", str(folder / "games"), "--no-extras"]
    assert kitchenmind.main([*words, "--trajectories", "1", "--timesteps", "40"]) == 0
    return folder


def train(lab: Path, out: Path, *more: str) -> int:
    words = ["train", "predictor", "--layout", "coordination_ring", "--agent", str(lab / "mine")]
    words += ["--games", str(lab / "games"), "--runs", str(out / "runs"), "--out", str(out / "p"), *SMALL]
    return kitchenmind.main([*words, *more])


def test_partners_are_all_agents_of_a_folder_whatever_they_are_called(lab: Path) -> None:
    shards = json.loads((lab / "games" / "manifest.json").read_text("utf-8"))["shards"]
    assert set(shards) == {"itself", "anna", "berta", "cleo"}
    assert {shards[name]["split"] for name in ("anna", "berta", "cleo")} == {"train", "validation", "test"}


def test_too_few_partners_are_refused_with_what_is_needed(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["collect", "--layout", "coordination_ring", "--agent", "planner", "--partners", str(lab / "mine")]
    assert kitchenmind.main(words) == 2
    said = capsys.readouterr().err
    assert "at least 3 other agents" in said
    assert "--partners partners" in said


def test_a_trained_folder_serves_and_is_evaluated(
    lab: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert train(lab, tmp_path) == 0
    assert "about 1 minute for 20 updates" in capsys.readouterr().out.replace("\n", " ")
    load_predictor(str(tmp_path / "p"), RING)
    words = ["evaluate", "predictor", "--layout", "coordination_ring", "--agent", str(lab / "mine")]
    words += ["--predictor", str(tmp_path / "p"), "--partners", str(lab / "friends"), "--json"]
    assert kitchenmind.main([*words, "--trajectories", "1", "--timesteps", "40"]) == 0
    (entry,) = json.loads(capsys.readouterr().out)
    assert (entry["agent"], entry["form"]) == ("mine", "stream")


def test_an_agent_that_was_met_in_training_never_measures_the_predictor(
    lab: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In a folder that has changed since, another agent may be the one that is kept for the test."""
    assert train(lab, tmp_path, "--no-intentions") == 0
    for source, name in (("cleo", "a"), ("anna", "anna"), ("berta", "berta")):
        shutil.copytree(lab / "friends" / source, tmp_path / "friends" / name)
    words = ["evaluate", "predictor", "--layout", "coordination_ring", "--agent", str(lab / "mine")]
    words += ["--predictor", str(tmp_path / "p"), "--partners", str(tmp_path / "friends")]
    words += ["--trajectories", "1", "--timesteps", "40"]
    assert kitchenmind.main(words) == 2
    assert "the predictor has met berta in training. Give other agents" in capsys.readouterr().err
    compact = ["train", "compact", "--predictor", str(tmp_path / "p"), "--agent", str(lab / "mine"), *words[-4:]]
    assert kitchenmind.main([*compact, "--partners", str(tmp_path / "friends")]) == 2
    assert "the predictor has met berta in training" in capsys.readouterr().err
    assert kitchenmind.main([*compact, "--partners", str(lab / "friends")]) == 0


def test_games_of_another_kitchen_or_agent_are_refused(
    lab: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--layout", "coordination_ring", "--agent", "random", "--runs", str(tmp_path), *SMALL]
    games = tmp_path / "games"
    collect = ["--partners", str(lab / "friends"), "--out", str(games), "--no-extras", "--trajectories", "1"]
    assert kitchenmind.main(["collect", *words[:4], *collect, "--timesteps", "40"]) == 0
    other = ["--layout", "cramped_room", *words[2:], "--games", str(games)]
    assert kitchenmind.main(["train", "predictor", *other]) == 2
    said = capsys.readouterr().err
    assert f"{games}: holds games of another kitchen (coordination_ring) than cramped_room. Give its --layout" in said
    assert kitchenmind.main(["train", "predictor", *words, "--agent", "stay", "--games", str(games)]) == 2
    assert "was collected with another agent than stay" in capsys.readouterr().err


def test_predictors_of_a_bundled_agent_are_not_replaced_by_those_of_another_with_its_name(
    lab: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(WEIGHTS / "coordination_ring" / "fcp", tmp_path / "sp")  # somebody's own agent, also called sp
    words = ["train", "predictor", "--layout", "coordination_ring", "--agent", str(tmp_path / "sp"), "--publish"]
    assert kitchenmind.main([*words, "--games", str(lab / "games"), "--runs", str(tmp_path / "runs"), *SMALL]) == 2
    assert "--publish: coordination_ring has a bundled agent 'sp', whose predictors" in capsys.readouterr().err


def test_a_predictor_is_written_when_the_time_is_up_and_the_same_command_continues(
    lab: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(training, "LOOK_IS_NEAR_S", -1.0)  # a look is never near: it stops between two of them
    assert train(lab, tmp_path, "--set", "minutes=0") == 0
    assert "the same command continues" in capsys.readouterr().out
    load_predictor(str(tmp_path / "p"), RING)
    assert "1 of 20" in (tmp_path / "p" / "card.md").read_text("utf-8")
    monkeypatch.undo()
    assert train(lab, tmp_path) == 0
    assert "| updates | 20 |" in (tmp_path / "p" / "card.md").read_text("utf-8")


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_or_kill_leaves_a_predictor_that_can_be_used(
    lab: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, how: signal.Signals
) -> None:
    step = training.PredictorTrainer.step

    def interrupted(trainer: training.PredictorTrainer) -> float:
        if trainer.update == 7:
            signal.raise_signal(how)
        return step(trainer)

    monkeypatch.setattr(training.PredictorTrainer, "step", interrupted)
    with ctrl_c_enabled():
        assert train(lab, tmp_path) == 1
    load_predictor(str(tmp_path / "p"), RING)
    assert "interrupted after 7 of 20 updates" in capsys.readouterr().out.replace("\n", " ")


def test_settings_are_given_one_by_one_or_together() -> None:
    import argparse

    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    words = ["--layout", "x", "--agent", "y", "--set", "a=1", "b=2", "--set", "c=3"]
    assert parser.parse_args(words).set == ["a=1", "b=2", "c=3"]
    assert parser.parse_args(words).preset in PRESETS
