"""Models are found by their names: folders, files and classes, relative to the right folder."""

import shutil
from pathlib import Path

import pytest

import kitchenmind
from models.agents.catalogue import agent_sha256
from models.agents.model_paths import WEIGHTS, located, source_file
from models.agents.predictors import UnknownPredictor, load_predictor
from overcooked.layout import load_layout

RING = load_layout("coordination_ring")
CLASS = """
import numpy as np

class {name}:
    def __init__(self, layout):
        pass

    def probabilities(self, observations):
        return np.full((len(observations), 6), 1 / 6, np.float32)
"""


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("sp", "sp"),
        ("planner", "planner"),
        ("mine.onnx", "FOLDER/mine.onnx"),
        ("mine.onnx@greedy", "FOLDER/mine.onnx@greedy"),
        ("./p@60", "FOLDER/p@60"),
        ("../up/p", "PARENT/up/p"),
        ("neighbour", "FOLDER/neighbour"),
        ("/somewhere/p", "/somewhere/p"),
        ("module:Class", "module:Class"),
        ("http://127.0.0.1:9000/act", "http://127.0.0.1:9000/act"),
    ],
)
def test_a_relative_path_starts_from_the_folder_and_nothing_else_does(name: str, wanted: str, tmp_path: Path) -> None:
    folder = tmp_path / "lab"
    for made in ("neighbour", "sp"):  # a bundled agent is not replaced by a folder that happens to have its name
        (folder / made).mkdir(parents=True)
        (folder / made / "config.json").write_text("{}", encoding="utf-8")
    wanted = wanted.replace("FOLDER", str(folder)).replace("PARENT", str(tmp_path))
    assert located(name, folder) == wanted


@pytest.mark.parametrize("name", ["./p", "p", "{folder}/p", "./p@50"])
def test_a_predictor_is_loaded_from_the_folder_that_training_wrote(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copytree(WEIGHTS / "coordination_ring" / "sp_predictor_stream", tmp_path / "p")
    load_predictor(name.format(folder=tmp_path), RING)
    words = ["agent", "check", name.format(folder=tmp_path), "--predictor", "--layout", "coordination_ring"]
    assert kitchenmind.main([*words, "--deadline-ms", "60000"]) == 0
    assert "it can be used" in capsys.readouterr().out


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UnknownPredictor, match=r"has no predictor '\./p'"):
        load_predictor("./p", RING)


def test_a_class_in_the_current_folder_needs_no_path_and_an_agent_that_never_cooks_is_warned_of(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "kitchen_of_mine.py").write_text(CLASS.format(name="Idle"), encoding="utf-8")
    words = ["agent", "check", "kitchen_of_mine:Idle", "--layout", "coordination_ring", "--deadline-ms", "60000"]
    assert kitchenmind.main(words) == 0
    said = capsys.readouterr()
    assert "it can be used" in said.out
    assert "warning: it delivers no soup in self-play" in said.err


def test_a_class_is_named_in_the_data_by_its_source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "source_of_mine.py"
    file.write_text(CLASS.format(name="First"), encoding="utf-8")
    assert source_file("source_of_mine:First") is not None
    before = agent_sha256("source_of_mine:First", RING)
    file.write_text(CLASS.format(name="First") + "# changed\n", encoding="utf-8")
    assert agent_sha256("source_of_mine:First", RING) != before
