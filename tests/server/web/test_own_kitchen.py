"""A kitchen that a study draws itself is played like a bundled one: its agents and predictors answer in it."""

import shutil
from pathlib import Path

import pytest

from models.inference.runner import ModelServer
from models.protocols import History, Question
from overcooked.state import Kitchens
from server.participation.episode_specs import layout_of
from server.required_models import WEIGHTS, fingerprint, required_models
from server.settings import ROOT
from server.study.loader import StudyError, parse_study
from server.study_check import stage_problems
from tests.support.page_site import SMALL_STUDY

OWN = SMALL_STUDY.replace(
    "{name: matrix, title: {en: Matrix, zh: 矩阵}}", '{name: own, title: Own, grid: "XXPXX\\nO1 2O\\nX   X\\nXDXSX"}'
)


async def test_agent_and_predictor_answer_in_a_kitchen_that_the_study_draws() -> None:
    file = parse_study(OWN)
    required = required_models([file])
    assert set(required.grids) == {"own"}
    layout = layout_of(file.study.layout("own"))
    kitchens = Kitchens.start(layout)

    def history(_: int) -> History:
        return History(kitchens.players.tobytes(), kitchens.contents.tobytes(), b"\xff\xff")

    server = ModelServer(required.agents, required.predictors, grids=required.grids)
    await server.start()
    try:
        question = Question("game", "own", 1, 0, "planner", "random", 0.5, 0, history)
        (decision,) = await server.ask([question], 5000)
    finally:
        await server.close()
    assert decision is not None
    assert 0 <= decision.action <= 5
    assert len(decision.prediction) == 3


def test_two_studies_cannot_draw_one_name_differently() -> None:
    other = parse_study(OWN.replace("X   X", "X X X"), "other.yaml")
    with pytest.raises(StudyError, match=r"other.yaml:25: layouts.1.name: 'own' is another kitchen"):
        required_models([parse_study(OWN), other])


def test_an_agent_that_was_trained_here_is_named_by_its_folder(tmp_path: Path) -> None:
    """And a folder of another kitchen is refused before anybody plays."""
    shutil.copytree(WEIGHTS / "coordination_ring" / "sp", tmp_path / "mine")
    ring = (ROOT / "overcooked" / "layouts" / "coordination_ring.layout").read_text("utf-8")
    grid = "".join(f"      {row}\n" for row in ring.splitlines())
    own = f"  - name: nook\n    title: Nook\n    grid: |\n{grid}"
    text = SMALL_STUDY.replace("{name: planner, predictor", f"{{name: mine, model: {tmp_path}/mine, predictor")
    text = text.replace("  - {name: coordination_ring, title: {en: Ring, zh: 环}}\n", own)
    problems = list(stage_problems(parse_study(text)))
    assert [problem.reason for problem in problems] == [f"'{tmp_path}/mine' was trained on another grid named matrix"]
    file = parse_study(
        text.replace("  - {name: matrix, title: {en: Matrix, zh: 矩阵}}\n", "").replace("after: [2]", "after: [1]")
    )
    assert list(stage_problems(file)) == []
    assert fingerprint("nook", f"{tmp_path}/mine") == fingerprint("coordination_ring", "sp") is not None
