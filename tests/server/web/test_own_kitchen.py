"""A kitchen that a study draws itself is played like a shipped one: its agents and predictors answer in it."""

import numpy as np
import pytest
from page_site import SMALL_STUDY

from models.protocols import History, Question
from models.runner import ModelServer
from overcooked.state import Kitchens
from server.cast import cast_of
from server.study.loader import StudyError, parse_study
from server.web.episodes import layout_of

OWN = SMALL_STUDY.replace(
    "{name: matrix, title: {en: Matrix, zh: 矩阵}}", '{name: own, title: Own, grid: "XXPXX\\nO1 2O\\nX   X\\nXDXSX"}'
)


async def test_agent_and_predictor_answer_in_a_kitchen_that_the_study_draws() -> None:
    file = parse_study(OWN)
    cast = cast_of([file])
    assert set(cast.grids) == {"own"}
    layout = layout_of(file.study.layout("own"))
    observations = Kitchens.start(layout).encode(horizon=400)[:, 1]

    def history(_: int) -> History:
        return History(observations, np.full((1, 2), -1, np.int8))

    server = ModelServer(cast.agents, cast.predictors, grids=cast.grids)
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
    with pytest.raises(StudyError, match=r"other.yaml: 'own' is another kitchen"):
        cast_of([parse_study(OWN), other])
