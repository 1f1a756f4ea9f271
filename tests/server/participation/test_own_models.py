"""A study names agents and predictors that were trained here, and its version keeps them as they were."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from models.agents.model_paths import ModelPaths
from models.agents.own_checkpoints import KEPT, OwnCheckpoints
from models.networks.checkpoint import load_checkpoint
from overcooked.layout import load_layout, parse_layout
from server.participation.kitchen_files import write_kitchens
from server.participation.own_kitchens import drawn_grids, keep_own_models, trained_models, with_own_models
from server.participation.training_commands import is_file_ready, own_names_of, training_commands
from server.playable_studies import playable_studies
from server.prediction_warnings import prediction_warnings
from server.required_models import WEIGHTS, required_models
from server.settings import Settings, own_models_here
from server.study.loader import StudyError, StudyFile, parse_study
from server.study.pinned_checkpoints import with_checkpoints
from server.study_check import stage_problems
from tests.support.page_site import SMALL_STUDY

RING = WEIGHTS / "coordination_ring"
GRID = load_layout("coordination_ring").text
ROWS = "".join(f"      {row}\n" for row in GRID.splitlines())
NOOK = SMALL_STUDY.replace(
    "  - {name: coordination_ring, title: {en: Ring, zh: 环}}\n",
    f"  - name: nook\n    title: Nook\n    grid: |\n{ROWS}",
).replace("  - {name: matrix, title: {en: Matrix, zh: 矩阵}}\n", "")
NOOK = NOOK.replace("after: [2]", "after: [1]")
MINE = NOOK.replace("{name: planner, predictor: random}", "{name: mine}")


@pytest.fixture
def trained(tmp_path: Path) -> Path:
    root = tmp_path / "data" / "models"
    shutil.copytree(RING / "sp", root / "nook" / "mine")
    shutil.copytree(RING / "sp_predictor_stream", root / "nook" / "mine_predictor_stream")
    return root


def reasons(file: StudyFile) -> list[str]:
    return [file.describe(one) for one in stage_problems(file) if not one.warning]


def test_a_trained_agent_and_its_predictor_are_found_by_name(trained: Path) -> None:
    file = with_own_models(parse_study(MINE), trained)
    assert reasons(file) == []
    required = required_models([file])
    assert required.paths.located("nook", "mine@greedy") == f"{trained}/nook/mine@greedy"
    assert required.paths.located("cave", "mine") == "mine"
    assert required.fingerprint("nook", "mine") == load_checkpoint(RING / "sp").sha256
    assert file.study.checkpoints["nook/mine_predictor_stream"] == load_checkpoint(RING / "sp_predictor_stream").sha256
    stored = parse_study(file.text)  # what the database and other processes read
    assert (stored.study, stored.sha256) == (file.study, file.sha256)
    assert with_own_models(parse_study(SMALL_STUDY), trained).text == SMALL_STUDY, "nothing of one's own is named"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda text: text.replace("{name: mine}", "{name: mine2}"),
            "the kitchen nook has no trained agent called 'mine2'. Did",
        ),
        (lambda text: text.replace("XXXPX", "XPXPX"), "'mine' was trained on another grid named nook"),
        (lambda text: text.replace("{name: mine}", "{name: mine, predictor: mine}"), "it is an agent, not a predictor"),
        (
            lambda text: text.replace("{name: mine}", "{name: mine_predictor_stream, predictor: random}"),
            "it is a predictor",
        ),
    ],
)
def test_unusable_settings_are_reported_with_their_place(
    trained: Path, change: Callable[[str], str], said: str
) -> None:
    file = with_own_models(parse_study(change(MINE)), trained)
    found = reasons(file)
    assert any(said in line and line.startswith("study.yaml:") for line in found), found


@pytest.mark.parametrize("agent", ["{name: planner, predictor: random}", "{name: nobody}", "{name: sp}"])
def test_a_grid_with_the_name_of_a_bundled_kitchen_gets_neither_its_agents_nor_its_commands(
    trained: Path, agent: str
) -> None:
    """The commands would train for the bundled grid, and its agents cannot play in this one."""
    text = MINE.replace("name: nook", "name: cramped_room").replace("{name: mine}", agent)
    file = with_own_models(parse_study(text), trained)
    first, *found = [*stage_problems(file), *prediction_warnings(file)]
    assert first.warning
    assert first.reason == "'cramped_room' is a bundled kitchen with another grid"
    assert found
    for problem in found:
        assert "kitchenmind train" not in problem.remedy
        assert "human_bc" not in problem.remedy, "a bundled agent"
        assert "name" in problem.remedy
    (trained / "nook").rename(trained / "cramped_room")  # a folder that somebody put there is still found
    assert reasons(with_own_models(parse_study(MINE.replace("name: nook", "name: cramped_room")), trained)) == []


def test_only_models_of_the_present_grid_are_suggested(trained: Path) -> None:
    shutil.copytree(RING / "fcp", trained / "cramped_room" / "mine")
    both = {"agents": ["mine"], "predictors": ["mine_predictor_stream"]}
    assert own_names_of({"nook": GRID}, trained) == {"nook": both}
    assert own_names_of({"nook": GRID.replace("XXXPX", "XPXPX")}, trained) == {}
    drawn = drawn_grids(parse_study(MINE.replace("name: nook", "name: cramped_room")).study)
    assert own_names_of(drawn, trained) == {"cramped_room": {"agents": ["mine"], "predictors": []}}


def test_the_remedy_is_the_command_whose_result_is_found(trained: Path) -> None:
    shutil.rmtree(trained)
    (first, *_) = reasons(with_own_models(parse_study(MINE), trained))
    command = f"`kitchenmind train agent --layout {trained.parent}/kitchens/nook.layout --out {trained}/nook/mine`"
    assert command in first


def test_a_version_keeps_its_models_when_they_are_trained_again(trained: Path) -> None:
    opened = with_own_models(parse_study(MINE), trained)
    keep_own_models(opened)
    served = required_models([opened])
    shutil.rmtree(trained / "nook" / "mine")
    shutil.copytree(RING / "fcp", trained / "nook" / "mine")
    assert served.fingerprint("nook", "mine") == load_checkpoint(RING / "sp").sha256, "what a server has loaded"
    again = replace(parse_study(opened.text), own_models=trained)
    assert reasons(again) == []
    assert required_models([again]).fingerprint("nook", "mine") == load_checkpoint(RING / "sp").sha256
    newer = with_own_models(parse_study(MINE), trained)
    assert newer.sha256 != opened.sha256, "another version"
    with pytest.raises(StudyError, match=r"'mine' in nook has been trained again .* Train under another name"):
        required_models([opened, newer])


def test_a_server_plays_with_the_kept_models_from_its_start_on(trained: Path) -> None:
    """A process that loads a model again would load another one from the folder that training changes."""
    path = trained.parents[1] / "study.yaml"
    path.write_text(MINE, encoding="utf-8")
    (file,) = playable_studies(Settings(data=trained.parent, studies=(path,)))
    for name in ("mine", "mine_predictor_stream"):
        folder = Path(required_models([file]).paths.located("nook", name))
        assert folder.parent == trained / KEPT
        assert load_checkpoint(folder).sha256 == load_checkpoint(trained / "nook" / name).sha256


def test_a_damaged_copy_is_made_again_and_a_good_one_of_another_process_stays(
    trained: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wanted = load_checkpoint(trained / "nook" / "mine").sha256
    checkpoints, target = OwnCheckpoints(trained), trained / KEPT / wanted
    target.mkdir(parents=True)
    (target / "config.json").write_text("{}")
    checkpoints.keep("nook", "mine", wanted)
    assert load_checkpoint(target).sha256 == wanted
    inode = target.stat().st_ino
    found = checkpoints.find("nook", "mine")
    monkeypatch.setattr(OwnCheckpoints, "find", lambda *_: found)  # it looked before the other process was done
    checkpoints.keep("nook", "mine", wanted)
    assert target.stat().st_ino == inode
    assert [path.name for path in target.parent.iterdir()] == [wanted]


def test_a_version_with_missing_models_names_them(trained: Path) -> None:
    opened = with_own_models(parse_study(MINE), trained)
    shutil.rmtree(trained / "nook" / "mine")
    (line,) = reasons(opened)
    assert load_checkpoint(RING / "sp").sha256[:12] in line
    assert f"it is not in {trained}/nook. Put its folder there" in line
    with pytest.raises(StudyError, match="cannot be kept"):
        keep_own_models(opened)


@pytest.mark.parametrize(
    "text",
    [
        MINE,
        f"# first\n{MINE}",
        "checkpoints:\n  cave/x: " + 64 * "a" + "\n" + MINE,
        "checkpoints: {cave/x: " + 64 * "a" + "}\n" + MINE,
    ],
)
def test_checkpoints_are_written_into_the_text_and_nothing_else_changes(text: str) -> None:
    made = yaml.safe_load(with_checkpoints(text, {"nook/b": 64 * "1", "nook/a": 64 * "0"}))
    before = yaml.safe_load(text)
    assert made.pop("checkpoints") == before.pop("checkpoints", {}) | {"nook/b": 64 * "1", "nook/a": 64 * "0"}
    assert made == before


def test_the_kitchen_s_page_has_commands_that_read_its_file(trained: Path) -> None:
    kitchens = trained.parent / "kitchens"
    write_kitchens(kitchens, {"nook": GRID, "cave": GRID})
    write_kitchens(kitchens, {"cave": None})
    assert is_file_ready("nook", GRID, trained)
    assert not is_file_ready("nook", GRID.replace("X 1", "X1 "), trained)
    assert not is_file_ready("cave", GRID, trained)
    commands = training_commands("nook", trained)
    assert load_layout(commands.file).text == GRID
    assert commands.predictor().endswith(f"--out {trained}/nook/nook_agent_predictor_stream")
    assert (
        training_commands("cramped_room", trained)
        .agent("mine")
        .startswith("kitchenmind train agent --layout cramped_room ")
    )
    found = trained_models(parse_layout(GRID, "nook"), trained)
    assert (found.layout, found.agents, found.predictors) == ("nook", ("mine",), ("mine_predictor_stream",))
    assert (
        trained_models(load_layout("cramped_room"), trained).agents
        == trained_models(load_layout("cramped_room")).agents
    )
    assert trained_models(parse_layout(GRID.replace("XXXPX", "XPXPX"), "nook"), trained).other_grid == (
        "mine",
        "mine_predictor_stream",
    )


def test_commands_find_the_folder_also_where_a_server_could_not_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("KITCHENMIND_DATA", str(tmp_path / "data"))
    assert own_models_here() == tmp_path / "data" / "models"
    monkeypatch.setenv("KITCHENMIND_MODE", "production")  # without a secret
    assert own_models_here() == tmp_path / "data" / "models"


def test_a_name_of_a_bundled_agent_stays_the_bundled_one(trained: Path) -> None:
    shutil.copytree(RING / "fcp", trained / "coordination_ring" / "sp")
    file = with_own_models(parse_study(SMALL_STUDY.replace("{name: planner", "{name: sp")), trained)
    assert file.study.checkpoints == {}
    assert required_models([file]).paths == ModelPaths({}, (str(file.folder),))
