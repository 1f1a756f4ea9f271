"""Wrong input of the commands that train, collect and measure: problem, place and remedy, and nothing is lost."""

import errno
from pathlib import Path
from typing import NoReturn

import pytest

import kitchenmind
from training import collect
from training.commands.intentions import _measured_in_words

TINY = ["--set", "total_timesteps=400", "num_envs=2", "num_steps=100", "minibatch_size=100"]
RING = ["--layout", "coordination_ring"]


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """Return what a command says that refuses its input."""
    assert kitchenmind.main(list(words)) == 2
    return capsys.readouterr().err


def test_a_folder_with_other_content_is_refused_before_training(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "partners" / "anna").mkdir(parents=True)
    runs = ["--runs", str(tmp_path / "runs"), "--out", str(tmp_path / "partners")]
    said = refused(capsys, "train", "agent", *RING, *TINY, *runs)
    assert f"{tmp_path / 'partners'}: holds anna, which a checkpoint written there would delete." in said
    said = refused(capsys, "train", "predictor", *RING, "--agent", "sp", *runs)
    assert "holds anna" in said
    assert [path.name for path in tmp_path.rglob("*")] == ["partners", "anna"]


@pytest.mark.parametrize("option", ["--runs", "--out"])
def test_a_path_that_cannot_be_written_is_named_with_a_remedy(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], option: str
) -> None:
    (tmp_path / "file").touch()
    words = ["train", "agent", *RING, *TINY, "--runs", str(tmp_path / "runs"), option, str(tmp_path / "file" / "x")]
    said = refused(capsys, *words)
    assert f"{tmp_path / 'file'}" in said
    assert "Not a directory. Check this path and the free space of its disk, then run the same command" in said


def test_a_full_disk_ends_collecting_with_a_remedy_and_the_same_command_continues(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ["collect", *RING, "--agent", "random", "--no-extras", "--trajectories", "1", "--timesteps", "10"]
    words += ["--out", str(tmp_path / "games")]

    def full(_path: Path, _content: bytes) -> NoReturn:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(collect.Path, "write_bytes", full)
    assert "No space left on device. Check this path and the free space" in refused(capsys, *words)
    monkeypatch.undo()
    assert kitchenmind.main(words) == 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["train", "agent", *RING, "--seed", "-1"], "--seed -1: must be at least 0."),
        (["collect", *RING, "--agent", "sp", "--seed", "-1"], "--seed -1: must be at least 0."),
        (["collect", *RING, "--agent", "sp", "--timesteps", "9"], "--timesteps 9: must be at least 10."),
        (["train", "study", "--plan", "--workers", "0"], "--workers 0: must be at least 1."),
        (["train", "study", "--plan", "--only", "target_x"], "--only target_x: no task begins with this. There are: "),
        (["evaluate", "agents", "--timesteps", "0"], "--timesteps 0: must be at least 1."),
        (["evaluate", "agents", "--episodes", "0"], "--episodes 0: must be at least 1."),
        (["evaluate", "predictor", *RING, "--trajectories", "0"], "--trajectories 0: must be at least 1."),
    ],
)
def test_a_number_or_name_that_cannot_be_meant_is_refused(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert said in refused(capsys, *words)


def test_intentions_that_never_happened_are_not_measured_as_none() -> None:
    never, often = {"states": 0, "kind_and_station": None}, {"states": 8, "kind_and_station": 75.0}
    assert "used no station" in _measured_in_words({"before": {"5": never, "10": never}})
    assert _measured_in_words({"before": {"5": often, "10": never}}).endswith("right in 75.0 % 1 s before")
