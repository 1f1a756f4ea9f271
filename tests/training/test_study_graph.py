"""The graph of a study's tasks: keys, order, resuming."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

import kitchenmind
from models.networks.checkpoint import load_checkpoint
from training.pipeline.agent_tasks import STUDY_LAYOUTS, agent_tasks, prediction_tasks, study_tasks
from training.pipeline.presets import ROLES, load_preset
from training.pipeline.study_tasks import Graph, Task, Work
from training.runlog import open_run
from training.settings import ConfigError


def _chain(runs: Path, done: list[str], **changed: Any) -> Graph:
    """A small graph: a -> b -> c, and d on its own."""

    def action(work: Work) -> None:
        if work.task.settings.get("fails"):
            raise RuntimeError("as asked")
        done.append(work.task.name)
        work.report(0.5)
        texts = [(folder / "made").read_text() for folder in work.inputs.values()]
        (work.folder / "made").write_text(work.task.name + "".join(texts))

    inputs = {"a": (), "b": ("a",), "c": ("b",), "d": ()}
    return Graph([Task("x", name, action, changed.get(name, {}), wants) for name, wants in inputs.items()], runs)


def _finish(graph: Graph) -> None:
    while ready := [label for label in graph.tasks if graph.ready(label)]:
        graph.run(ready[0])


def test_inputs_come_first_and_nothing_is_done_twice(tmp_path: Path) -> None:
    done: list[str] = []
    _finish(_chain(tmp_path, done))
    assert done == ["a", "b", "c", "d"]
    graph = _chain(tmp_path, done)
    assert not any(graph.ready(label) for label in graph.tasks)
    assert (graph.folder("x/c") / "made").read_text() == "cba"


def test_a_changed_setting_redoes_only_what_depends_on_it(tmp_path: Path) -> None:
    done: list[str] = []
    _finish(_chain(tmp_path, done))
    done.clear()
    _finish(_chain(tmp_path, done, b={"more": 1}))
    assert done == ["b", "c"]
    done.clear()
    _finish(_chain(tmp_path, done))  # and back: what was made before is still there
    assert done == []


def test_a_task_that_failed_is_done_again_with_what_depends_on_it(tmp_path: Path) -> None:
    done: list[str] = []
    broken = _chain(tmp_path, done, b={"fails": True})
    broken.run("x/a")
    with pytest.raises(RuntimeError, match="as asked"):
        broken.run("x/b")
    assert broken.ready("x/b")
    assert not broken.ready("x/c")


def test_limiting_the_tasks_keeps_their_inputs(tmp_path: Path) -> None:
    assert list(_chain(tmp_path, []).limited(["b"]).tasks) == ["x/a", "x/b"]


@pytest.mark.parametrize("name", ["cpu", "published"])
def test_every_preset_trains_all_agents_and_predictors_of_every_kitchen(name: str, tmp_path: Path) -> None:
    preset = load_preset(name)
    for layout in STUDY_LAYOUTS:
        graph = Graph(study_tasks(layout, preset), tmp_path)
        names = [task.name for task in graph.tasks.values()]
        assert names[-1] == ("weights" if preset.publish else "choose_fcp")
        assert sum(task.startswith("population") for task in names) == 2 * preset.population
        last = f"population_sp_{preset.population}"
        for task in graph.tasks.values():
            assert all(f"{layout}/{needed}" in graph.tasks for needed in task.inputs)
            if task.name.startswith("target_fcp"):
                assert last not in task.inputs  # they are measured with it later


def test_auxiliary_partners_are_only_trained_on_and_never_meet_the_population(tmp_path: Path) -> None:
    preset = load_preset("cpu")
    agents, predicting = (make("coordination_ring", preset) for make in (study_tasks, prediction_tasks))
    graph = Graph([*agents, *predicting], tmp_path)
    crowd = [task for task in predicting if task.name.startswith("crowd")]
    assert len(crowd) == preset.auxiliary_partners("coordination_ring") * 3 // 2 > 0
    assert all(needed.startswith("crowd_sp") for task in crowd for needed in task.inputs)
    games = graph.tasks["coordination_ring/games_sp"].inputs
    assert {task.name for task in crowd} < set(games)
    assert "clones" in games
    assert not any(needed.startswith("crowd") or needed == "clones" for task in agents for needed in task.inputs)
    assert not any(task.name.startswith(("crowd", "clones")) for task in prediction_tasks("matrix", preset))


def test_finished_tasks_travel_in_a_folder_and_only_with_the_same_settings(tmp_path: Path) -> None:
    done: list[str] = []
    here = _chain(tmp_path / "here", done)
    for label in ("x/a", "x/b"):
        here.run(label)
        here.keep(label, tmp_path / "kept")
    assert sorted(p.name for p in (tmp_path / "kept" / "x" / "b").iterdir()) == ["key", "made"]
    there = _chain(tmp_path / "there", done, b={"more": 1})
    assert there.take_over(tmp_path / "kept") == ["x/a"]
    same = _chain(tmp_path / "same", done)
    assert same.take_over(tmp_path / "kept") == ["x/a", "x/b"]
    done.clear()
    _finish(same)
    assert done == ["c", "d"]
    assert (same.folder("x/c") / "made").read_text() == "cba"


def test_tasks_that_were_finished_before_a_folder_was_given_are_kept_in_it_too(tmp_path: Path) -> None:
    preset = _preset(tmp_path, "population = 1\ntargets = 1\nextras = false\npublish = false\n")
    words = ["train", "study", "--preset", preset, "--layouts", "matrix", "--only", "population_sp"]
    (task,) = (one for one in study_tasks("matrix", load_preset(preset)) if one.name == "population_sp_1")
    graph = Graph([task], tmp_path / "runs" / "study")
    (graph.log("matrix/population_sp_1").parent / "task_done").touch()
    for _ in range(2):
        assert kitchenmind.main([*words, "--runs", str(tmp_path / "runs"), "--keep", str(tmp_path / "kept")]) == 0
        assert list(graph.kept_in(tmp_path / "kept")) == ["matrix/population_sp_1"]


def _preset(folder: Path, text: str) -> str:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "population = 1\ntargets = 1\nleast_rewards = 1.0",
            "unknown key 'least_rewards'. Did you mean 'least_reward'?",
        ),
        ("population = 1\ntargets = 1\nextras = 0", "extras is 0. Write true or false."),
        ("population = 1", "targets is missing. Add a line: targets = ..."),
        ("population = = 1", "mine.toml: Invalid value"),
        (
            "population = 1\ntargets = 1\n[populaton_sp]\ngamma = 0.9",
            "unknown table [populaton_sp]. Did you mean [population_sp]? Known: population_sp, ",
        ),
        (
            "population = 1\ntargets = 1\n[layout.matrix.targetsp]\ngamma = 0.9",
            "unknown table [layout.matrix.targetsp]. Did you mean [layout.matrix.target_sp]?",
        ),
        (
            "population = 1\ntargets = 1\n[layout.matrix]\nauxiliary_partners = -4",
            "[layout.matrix] auxiliary_partners is -4. Write a whole number of at least 0.",
        ),
        (
            "population = 1\ntargets = 1\n[layout.matrix]\nstream_extras = 1",
            "[layout.matrix] stream_extras is 1. Write true or false.",
        ),
        (
            "population = 1\ntargets = 1\n[layout.random0]\nauxiliary_partners = 1",
            "[layout.random0]: random0 is called forced_coordination here. Write [layout.forced_coordination].",
        ),
        (
            "population = 1\ntargets = 1\n[layout.ring]\nlike = 'rign'",
            "[layout.ring] like is 'rign'. Write a kitchen that has its own tables.",
        ),
        (
            "population = 1\ntargets = 1\n[layout.a]\ncrowd = 1\n[layout.b]\nlike = 'a'\n[layout.c]\nlike = 'b'",
            "[layout.c] like is 'b'. Write one of a.",
        ),
    ],
)
def test_a_wrong_setting_of_a_preset_is_named(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(words)):
        load_preset(_preset(tmp_path, text))


@pytest.mark.parametrize("name", ["published", "cpu"])
def test_a_task_of_a_preset_keeps_its_folder(name: str, tmp_path: Path) -> None:
    """Trainings of days continue in folders named by the hash of their settings: renaming a setting in the code must
    not change it. Replace the data only if a preset's training is meant to start again."""
    preset = load_preset(name)
    tasks = [
        task for make in (study_tasks, prediction_tasks) for layout in STUDY_LAYOUTS for task in make(layout, preset)
    ]
    keys = {label: key[:8] for label, key in Graph(tasks, tmp_path).keys.items()}
    assert keys == json.loads(Path("tests/data/study_task_keys.json").read_text(encoding="utf-8"))[name]


def test_the_former_names_of_settings_give_the_same_tasks(tmp_path: Path) -> None:
    former = (
        "population = 1\ntargets = 1\nship = false\n"
        "[target_sp]\ntimesteps = 9\nclip = 0.1\ntrace = 0.9\n[predictor.window]\neyes = 'cnn'\naveraging = 0.9\n"
        "[layout.matrix]\ncrowd = 2\n"
    )
    current = (
        "population = 1\ntargets = 1\npublish = false\n"
        "[target_sp]\ntotal_timesteps = 9\nclip_coef = 0.1\ngae_lambda = 0.9\n"
        "[predictor.window]\nencoder = 'cnn'\nema_decay = 0.9\n[layout.matrix]\nauxiliary_partners = 2\n"
    )
    keys = []
    for text in (former, current):
        preset = load_preset(_preset(tmp_path, text))
        tasks = [*study_tasks("matrix", preset), *prediction_tasks("matrix", preset)]
        keys.append(Graph(tasks, tmp_path).keys)
    assert keys[0] == keys[1]
    assert "matrix/crowd_sp_102" in keys[0]
    assert "matrix/weights" not in keys[0]


def test_a_kitchen_like_another_has_its_settings_and_its_own_on_top(tmp_path: Path) -> None:
    text = (
        "population = 1\ntargets = 1\n[target_sp]\ngamma = 0.5\n[layout.b]\nlike = 'a'\nauxiliary_partners = 0\n"
        "[layout.b.target_sp]\ntotal_timesteps = 9\n[layout.b.predictor]\nupdates = 3\n"
        "[layout.a]\ncrowd = 4\n[layout.a.target_sp]\ntimesteps = 8\nclip = 0.1\n"
        "[layout.a.predictor]\nupdates = 2\npatience = 5\n"
    )
    preset = load_preset(_preset(tmp_path, text))
    own, other, third = (preset.config(layout, "target_sp") for layout in "bac")
    assert (own.gamma, own.clip_coef, own.total_timesteps) == (0.5, 0.1, 9)
    assert (other.gamma, other.clip_coef, other.total_timesteps) == (0.5, 0.1, 8)
    assert third.clip_coef != 0.1
    assert preset.predictor_settings("b") == {"updates": 3, "patience": 5}
    assert [preset.auxiliary_partners(layout) for layout in "abc"] == [4, 0, 0]


def test_the_other_classic_kitchens_are_learned_as_coordination_ring_without_auxiliary_partners() -> None:
    preset = load_preset("cpu")
    for layout in ("cramped_room", "asymmetric_advantages", "forced_coordination", "counter_circuit"):
        assert preset.auxiliary_partners(layout) == 0
        for role in ROLES:
            assert preset.config(layout, role) == preset.config("coordination_ring", role)


def test_a_study_is_trained_under_the_name_that_the_layout_has_in_the_data(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--layouts", "random0", "random3", "--only", "population_sp_1", "--plan", "--runs", str(tmp_path)]
    assert kitchenmind.main(["train", "study", *words]) == 0
    said = capsys.readouterr().out
    assert "forced_coordination/" in said
    assert "counter_circuit/" in said
    assert "random" not in said


def test_a_run_that_learned_nothing_is_trained_again_with_another_seed(tmp_path: Path) -> None:
    run = "total_timesteps = 1600\nnum_envs = 8\nsnapshots = 2"
    text = f"population = 1\ntargets = 1\nleast_reward = 1e6\n[population_sp]\n{run}"
    (task, *_) = agent_tasks("coordination_ring", load_preset(_preset(tmp_path, text)))
    graph = Graph([task], tmp_path)
    graph.run(task.label)
    folder = graph.folder(task.label)
    assert [open_run(folder / run).settings["seed"] for run in ("run", "run_2", "run_3")] == [1, 1001, 2001]
    graph.keep(task.label, tmp_path / "kept")
    assert sorted(path.name for path in (tmp_path / "kept" / task.label).iterdir()) == ["100", "35", "70", "key"]


def test_the_best_of_the_runs_that_learned_too_little_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rewards = {"run": 15.0, "run_2": 16.0, "run_3": 0.0}
    monkeypatch.setattr(
        "training.pipeline.agent_tasks.skill_snapshot", lambda run, _: (0, rewards[run.path.name], run.path)
    )
    settings = "total_timesteps = 1600\nnum_envs = 8\nsnapshots = 2"
    text = f"population = 1\ntargets = 1\nleast_reward = 20.0\n[population_sp]\n{settings}"
    (task, *_) = agent_tasks("coordination_ring", load_preset(_preset(tmp_path, text)))
    graph = Graph([task], tmp_path)
    graph.run(task.label)
    assert load_checkpoint(graph.folder(task.label) / "100").config["seed"] == 1001


def test_the_published_recipe_uses_the_31_partners_of_the_paper(tmp_path: Path) -> None:
    for name, wanted in (("published", False), ("cpu", None)):
        tasks = prediction_tasks("double_rings", load_preset(name))
        (games,) = (task for task in tasks if task.name.startswith("games_sp"))
        assert games.settings.get("extras") is wanted


def test_the_stream_form_alone_may_learn_with_other_partners_than_the_papers() -> None:
    tasks = {task.name: task for task in prediction_tasks("coordination_ring", load_preset("published"))}
    papers, more = tasks["games_fcp"], tasks["games_fcp_extras"]
    assert papers.settings.get("extras") is False
    assert "clones" not in papers.inputs
    assert "extras" not in more.settings
    assert "clones" in more.inputs
    assert set(papers.inputs) < set(more.inputs)
    for form, games in (("window", "games_fcp"), ("stream", "games_fcp_extras")):
        assert tasks[f"predictor_fcp_{form}"].inputs[0] == tasks[f"intentions_fcp_{form}"].inputs[0] == games
    assert not any(name.endswith("_extras") for name in _names("coordination_ring", "cpu"))
    assert not any(name.endswith("_extras") for name in _names("matrix", "published"))


def _names(layout: str, preset: str) -> list[str]:
    return [task.name for task in prediction_tasks(layout, load_preset(preset))]
