"""A study uses kitchens of the dashboard by name, and keeps them as they were."""

from argparse import Namespace
from collections.abc import Mapping
from pathlib import Path

import pytest
import yaml

from overcooked.layout import load_layout, parse_layout
from server.commands import bots
from server.commands import study as study_command
from server.participation.episode_specs import layout_of
from server.participation.own_kitchens import load_with_kitchens, trained_models, with_own_kitchens
from server.required_models import required_models
from server.store import kitchens
from server.store.database import Database
from server.study.loader import load_study, parse_study
from server.study.written_grids import with_grids
from server.study_check import stage_problems
from tests.support.databases import with_tables
from tests.support.page_site import SMALL_STUDY

GRID = "XXPXX\nO1 2O\nX   X\nXDXSX"
MATRIX = "  - {name: matrix, title: {en: Matrix, zh: 矩阵}}\n"
NAMED = SMALL_STUDY.replace(MATRIX, "  - {name: nook, title: Nook}\n")
BLOCK = SMALL_STUDY.replace(MATRIX, "  - name: nook # the new one\n    title: Nook\n")
LATER = SMALL_STUDY.replace(MATRIX, "  - title: Nook\n    name: 'nook'\n")
TWICE = NAMED + "tutorial: {layout: {title: Nook, name: nook}, agent: {name: stay, predictor: random}}\n"


@pytest.mark.parametrize("text", [NAMED, BLOCK, LATER, TWICE])
def test_the_grid_is_written_into_the_text_and_nothing_else_changes(text: str) -> None:
    made = with_own_kitchens(parse_study(text, "small.yaml"), lambda: {"nook": GRID, "other": "X"})
    assert made.study.layout("nook").grid == GRID
    assert layout_of(made.study.layout("nook")).text == GRID
    assert required_models([made]).grids == {"nook": GRID}
    stored = parse_study(made.text)  # what the database, a bundle and another process read
    assert (stored.study, stored.sha256) == (made.study, made.sha256)
    before, after = yaml.safe_load(text), yaml.safe_load(made.text)
    for block in (*after["layouts"], *([after["tutorial"]["layout"]] if "tutorial" in after else [])):
        assert block["name"] != "nook" or block.pop("grid") == GRID
    assert after == before


def test_a_kitchen_that_is_drawn_or_bundled_stays_as_it_is_and_the_database_is_not_asked() -> None:
    def nobody() -> Mapping[str, str]:
        raise AssertionError("asked the database")

    drawn = parse_study(NAMED.replace("title: Nook", f'title: Nook, grid: "{GRID}"'.replace("\n", "\\n")))
    assert with_own_kitchens(drawn, nobody) is drawn
    bundled = parse_study(SMALL_STUDY)
    assert with_own_kitchens(bundled, nobody) is bundled


def test_an_alias_gets_its_grid_once() -> None:
    text = NAMED.replace("- {name: nook,", "- &kitchen {name: nook,") + (
        "tutorial: {layout: *kitchen, agent: {name: stay, predictor: random}}\n"
    )
    assert parse_study(with_grids(text, {"nook": GRID})).study.tutorial.layout.grid == GRID


def test_an_unknown_kitchen_is_reported_at_its_line(tmp_path: Path) -> None:
    path = tmp_path / "small.yaml"
    path.write_text(BLOCK, encoding="utf-8")
    file = load_with_kitchens(path, dict)
    (problem,) = stage_problems(file)
    line = 1 + BLOCK[: BLOCK.index("name: nook")].count("\n")
    assert file.describe(problem).startswith(f"{path}:{line}: ")
    assert "save this kitchen in the dashboard" in problem.remedy
    other = load_with_kitchens(path, lambda: {"nook": GRID.replace("O1", "X1").replace("2O", "2X")})
    (problem,) = stage_problems(other)
    assert "there is no onion dispenser" in other.describe(problem)


def test_commands_find_the_kitchens_of_the_dashboard_in_the_database(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    url, path = with_tables(tmp_path / "site.db"), tmp_path / "small.yaml"
    path.write_text(NAMED, encoding="utf-8")
    monkeypatch.setenv("KITCHENMIND_DATABASE", url)
    assert study_command.run(Namespace(study_verb="check", file=path, data=None, database=None)) == 2
    assert "there is no layout 'nook'" in capsys.readouterr().err
    with Database(url) as database:
        database.write_now(kitchens.save, "nook", GRID, "mara", 0)
    assert study_command.run(Namespace(study_verb="check", file=path, data=None, database=None)) == 0
    (tmp_path / "own").mkdir()
    copy, environment = bots._with_kitchens(path, tmp_path / "own", None)
    assert load_study(copy).study.layout("nook").grid == GRID
    assert environment == {"KITCHENMIND_MODELS_FOLDER": str(tmp_path)}
    path.write_text(SMALL_STUDY, encoding="utf-8")
    assert bots._with_kitchens(path, tmp_path / "own", None) == (path, {})


def test_models_are_found_by_the_grid_and_named_as_in_their_folder() -> None:
    ring = load_layout("coordination_ring")
    found = trained_models(ring)
    assert found.layout == "coordination_ring"
    assert {"sp", "fcp"} <= set(found.agents)
    assert "sp_predictor_stream" in found.predictors
    assert trained_models(parse_layout(ring.text, "mine")).layout == "coordination_ring"
    nothing = trained_models(load_layout("practice"))
    assert (nothing.layout, nothing.agents, nothing.predictors) == ("practice", (), ())
