"""The benchmark of foresight: arrows called true come true, and the same random numbers give the same episodes."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from scipy import stats

from benchmarks.support import foresight_games
from overcooked.layout import load_layout

ROOT = Path(__file__).parent.parent.parent


@pytest.fixture(scope="module")
def foresight() -> ModuleType:
    specification = importlib.util.spec_from_file_location("foresight_benchmark", ROOT / "benchmarks" / "foresight.py")
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    paths, sys.modules[specification.name] = list(sys.path), module  # its dataclasses look their module up
    try:
        specification.loader.exec_module(module)
    finally:
        sys.path[:] = paths
    return module


def test_true_arrows_come_true_and_mixed_ones_as_often_as_wanted(foresight: ModuleType) -> None:
    for right, low, high in ((1.0, 0.97, 1.0), (0.48, 0.38, 0.58)):
        found = foresight.played(foresight.Cell("coordination_ring", "sp", "true", "all", right), 4, 60)
        assert low <= np.mean(found["accuracy"]) <= high


def test_the_same_cell_gives_the_same_episodes_and_more_of_them_change_none(foresight: ModuleType) -> None:
    cell = foresight.Cell("double_rings", "fcp", "random")
    one, two = (foresight.played(cell, 3, 40) for _ in range(2))
    assert one == two


def test_conditions_share_people_seats_and_chance(foresight: ModuleType) -> None:
    layout = load_layout("matrix")
    begun = [
        foresight_games._begun(layout, foresight.Cell("matrix", "sp", shown), range(5, 8), 1)
        for shown in ("none", "tom")
    ]
    assert (begun[0].participants.minds == begun[1].participants.minds).all()
    assert (begun[0].uniforms == begun[1].uniforms).all()
    assert len({mind["seed"] for mind in begun[0].participants.minds}) == 3


def test_the_interval_is_that_of_a_paired_t_test(foresight: ModuleType) -> None:
    draws = np.random.default_rng(0)
    one, other = draws.normal(3, 1, 50), draws.normal(2, 1, 50)
    expected = stats.ttest_rel(one, other).confidence_interval(0.95)
    found = foresight.difference(one, other)
    assert (found["low"], found["high"]) == pytest.approx((expected.low, expected.high))


def test_tables_say_what_is_not_yet_played(foresight: ModuleType) -> None:
    cell = foresight.Cell("matrix", "sp", "none")
    figures = foresight.ForesightSummary(
        {cell.name: {"points": [20, 40], "collisions": [1, 3], "accuracy": [np.nan] * 2}}
    )
    text = foresight.rendered(
        figures.figures() | {"processor": "x", "seed": 1, "version": 2}, {"fitted games": {}, "held-out games": {}}
    )
    assert "| Matrix | SP | 30 | not yet played |" in text
    assert "cells are not yet played" in text
