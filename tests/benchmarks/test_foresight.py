"""The benchmark of foresight: arrows called true come true, the same random numbers give the same episodes, and the
document shows the stored figures."""

import importlib.util
import json
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from scipy import stats

from benchmarks.support import foresight_games
from benchmarks.support.foresight_figures import ForesightSummary, cells, difference
from benchmarks.support.foresight_games import FIRST_SEED, FRESH_SEED, Cell, played
from benchmarks.support.foresight_tables import rendered
from overcooked.layout import load_layout

ROOT = Path(__file__).parent.parent.parent
REMEDY = "Run: python benchmarks/foresight.py --write"


@pytest.fixture(scope="module")
def foresight() -> ModuleType:
    specification = importlib.util.spec_from_file_location("foresight_benchmark", ROOT / "benchmarks" / "foresight.py")
    assert specification is not None
    assert specification.loader is not None
    module, paths = importlib.util.module_from_spec(specification), list(sys.path)
    try:
        specification.loader.exec_module(module)
    finally:
        sys.path[:] = paths
    return module


def test_true_arrows_come_true_and_mixed_ones_as_often_as_wanted() -> None:
    for right, low, high in ((1.0, 0.97, 1.0), (0.48, 0.38, 0.58)):
        found = played(Cell("coordination_ring", "sp_strong", "true", "all", right), 4, 60)
        assert low <= np.mean(found["accuracy"]) <= high


def test_the_same_cell_gives_the_same_episodes() -> None:
    cell = Cell("double_rings", "fcp_strong", "random")
    one, two = (played(cell, 3, 40) for _ in range(2))
    assert one == two


def test_conditions_share_people_seats_and_chance_and_seeds_share_none() -> None:
    layout = load_layout("matrix")
    none, tom, fresh = (
        foresight_games._begun(layout, Cell("matrix", "sp_strong", shown, seed=seed), range(5, 8), 1)
        for shown, seed in (("none", FIRST_SEED), ("tom", FIRST_SEED), ("none", FRESH_SEED))
    )
    assert (none.participants.minds == tom.participants.minds).all()
    assert (none.uniforms == tom.uniforms).all()
    assert len({mind["seed"] for one in (none, fresh) for mind in one.participants.minds}) == 6
    assert not (none.uniforms == fresh.uniforms).any()


def test_the_interval_is_that_of_a_paired_t_test() -> None:
    draws = np.random.default_rng(0)
    one, other = draws.normal(3, 1, 50), draws.normal(2, 1, 50)
    expected = stats.ttest_rel(one, other).confidence_interval(0.95)
    found = difference(one, other)
    assert (found["low"], found["high"]) == pytest.approx((expected.low, expected.high))


def test_tables_say_what_is_not_yet_played() -> None:
    cell = Cell("matrix", "sp_strong", "none")
    run = ForesightSummary({cell.name: {"points": [20, 40], "collisions": [1, 3], "accuracy": [np.nan] * 2}}).figures()
    figures = {"processor": "x", "version": 2, "episodes": 2, "horizon": 400, "runs": [{"seed": FRESH_SEED} | run]}
    text = rendered(figures, {"fitted games": {}, "held-out games": {}})
    assert "| Matrix | SP | 30 | not yet played |" in text
    assert "191 of 192 cells are not yet played" in text


def test_the_document_and_the_simulated_effect_show_the_stored_figures(foresight: ModuleType) -> None:
    figures, effect, fit = (
        json.loads(path.read_text(encoding="utf-8"))
        for path in (foresight.FIGURES, foresight.EFFECT, foresight.FITTED_FIGURES)
    )
    assert rendered(figures, fit) in foresight.DOCUMENT.read_text(encoding="utf-8"), REMEDY
    assert effect == json.loads(json.dumps(foresight.simulated_effect(figures["runs"]))), REMEDY


def test_both_seeds_are_published_with_every_cell(foresight: ModuleType) -> None:
    figures = json.loads(foresight.FIGURES.read_text(encoding="utf-8"))
    assert {run["seed"] for run in figures["runs"]} == {FIRST_SEED, FRESH_SEED}
    for run in figures["runs"]:
        assert set(run["cells"]) == {cell.name for cell in cells()}
        assert [row["gain"]["episodes"] for row in run["accuracy"]] == [figures["episodes"]] * 8
    assert figures["episodes"] >= 200
