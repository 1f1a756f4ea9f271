"""Blocks within people: no test where levels and blocks cannot be told apart, and no sentence that compares orders."""

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl
import pytest
from statsmodels.formula.api import ols

from analysis import apa_text, factorial_text, factorial_within
from analysis.block_orders import WEIGHTED, WHY
from analysis.factorial_within import RepeatedCells
from analysis.report import Report, write_report
from analysis.results import select
from analysis.study import Options
from analysis.synthetic import Truth, write_export
from server.study.latin_square import balanced_square
from tests.support.declaring import declaring

STUDY = """factors:
  prediction: [none, tom]
cells: {within: [prediction]}
primary: {effect: [prediction]}
"""
LEVELS = ("none", "random", "tom")
pytestmark = pytest.mark.usefixtures("no_pictures")


def reported(folder: Path, excluded: str = "") -> Report:
    """A study in which each person meets no marks in one half of the rounds and marks, which help, in the other.
    `excluded`: the order of the blocks whose people the researcher excluded."""
    truth = Truth(participants=8, conditions=("order_1", "order_2"), timesteps=20, seed=3, broken=0)
    write_export(truth, folder / "plain")
    out = declaring(folder / "plain", folder / "data", STUDY)
    table = pl.read_parquet(out / "episodes.parquet")
    first = pl.col("number") <= 5
    level = pl.when(first == (pl.col("condition") == "order_2")).then(pl.lit("tom")).otherwise(pl.lit("none"))
    table = table.with_columns(factor_prediction=level, block=pl.when(first).then(1).otherwise(2))
    helped = 25 * (pl.col("factor_prediction") == "tom").cast(pl.Int32)
    table.with_columns(score=pl.col("score") + helped).write_parquet(out / "episodes.parquet")
    people = pl.read_parquet(out / "participants.parquet")
    reason = pl.when(pl.col("condition") == excluded).then(pl.lit("a wrong version")).otherwise(pl.lit(""))
    people.with_columns(excluded=reason).write_parquet(out / "participants.parquet")
    return write_report(out, folder / "report", Options(power_studies=20, draws=50))


def test_without_one_of_the_orders_levels_are_not_tested(tmp_path: Path) -> None:
    made = reported(tmp_path, excluded="order_2")
    tests = select(made.analysis.rows, section="factorial", test="anova")
    assert {row.question for row in tests} > {""}
    assert all(np.isnan(row.p) and "levels and blocks cannot be told apart" in row.note for row in tests)
    assert not select(made.analysis.rows, section="factorial", test="difference")
    (primary,) = select(made.analysis.rows, section="primary")
    assert np.isnan(primary.p)
    assert "some levels come earlier than others on average" in primary.note
    findings = apa_text.findings(made.analysis)
    assert findings[0].startswith("The effects of prediction on reward could not be tested: the orders of the blocks")
    assert not any("between the conditions" in text for text in findings)
    assert "there was a main effect of prediction" not in made.page.read_text("utf-8")


def test_orders_of_blocks_are_not_compared_in_findings_and_sentences(tmp_path: Path) -> None:
    made = reported(tmp_path)
    page = made.page.read_text("utf-8")
    assert "there was a main effect of prediction" in page
    assert select(made.analysis.rows, section="reward", test="kruskal_wallis_people"), "results.csv has them"
    sentences = page.partition("Sentences to paste</h2>")[2]
    for words in ("Between the two conditions", "cumulative-link mixed models", "t-tests over", "Order 1 and Order 2"):
        assert words not in sentences
    assert "The analysis is of 160 episodes of 16 simulated participants." in sentences


def cells_of(orders: list[tuple[str, ...]], outer: tuple[str, ...] = ()) -> RepeatedCells:
    """Four people in each order, for each level between people."""
    generator = np.random.default_rng(5)
    factors = {"prediction": LEVELS} | ({"opacity": outer} if outer else {})
    between = [(level,) for level in outer] or [()]
    everybody = list(product(between, orders))
    return RepeatedCells(
        factors,
        ("prediction",),
        tuple((levels, generator.normal(60, 9, (4, 3))) for levels, _ in everybody),
        tuple(tuple((level,) for level in order) for _, order in everybody),
    )


def test_a_latin_square_without_one_order_is_tested_with_weights_of_the_others() -> None:
    """Every later block adds 10 points, and each order something of its own, which is neither effect nor error."""
    square = [tuple(LEVELS[place] for place in row) for row in balanced_square(3)]
    assert len(square) == 6
    for orders in (square, square[:3]):  # the rows without their mirrors are balanced too
        cells = cells_of(orders)
        assert factorial_within.problem_with(cells) == ""
        assert cells.weights == pytest.approx(np.full(len(orders), 1 / len(orders)))
        (plain,) = select(factorial_within.of_repeated(cells, ""), test="anova")
        assert WEIGHTED not in plain.note
    for left_out in range(6):
        cells = cells_of(square[:left_out] + square[left_out + 1 :])
        assert cells.weights is not None
        assert cells.weights.min() > 0.1
        drift = [[10.0 * order.index((level,)) for level in LEVELS] for order in cells.orders]
        moved = replace(
            cells,
            groups=tuple(
                (between, values + np.array(later) + 3 * place)
                for place, ((between, values), later) in enumerate(zip(cells.groups, drift, strict=True))
            ),
        )
        for test in ("anova", "simple_effect"):
            before, after = (select(factorial_within.of_repeated(one, ""), test=test) for one in (cells, moved))
            assert [row.p for row in after] == pytest.approx([row.p for row in before])
            assert [row.estimate for row in after] == pytest.approx([row.estimate for row in before], nan_ok=True)
        (row,) = select(factorial_within.of_repeated(cells, ""), test="anova")
        assert row.note.endswith(f", {WEIGHTED}")
        (sentence,) = factorial_text.factorial_sentences([row])
        assert f"with the {WEIGHTED} {WHY}" in sentence
    assert "are not balanced" in factorial_within.problem_with(cells_of(square[:2]))


def test_weighted_orders_give_the_regression_of_statsmodels() -> None:
    """Two levels between people, an order lost in one of them: the difference of two levels within people, by the
    means of the orders of each, with the variance within orders."""
    square = [tuple(LEVELS[place] for place in row) for row in balanced_square(3)]
    both = cells_of(square, ("off", "on"))
    cells = RepeatedCells(both.factors, both.within, both.groups[:-1], both.orders[:-1])
    (row,) = select(
        factorial_within.of_repeated(cells, ""),
        test="simple_effect",
        contrast="prediction: tom - none",
        condition="opacity on",
    )
    scores = [values @ np.array([-1.0, 0.0, 1.0]) for _, values in cells.groups]
    data = pd.DataFrame(
        {"value": value, "group": f"g{number:02d}"} for number, part in enumerate(scores) for value in part
    )
    model = ols("value ~ C(group) - 1", data).fit()
    weights = np.zeros(11)
    assert cells.weights is not None
    weights[6:] = cells.weights[6:]
    assert sorted(weights[6:]) == pytest.approx([1 / 9, 1 / 6, 1 / 6, 5 / 18, 5 / 18])
    test = model.t_test(weights)
    assert row.estimate == pytest.approx(float(test.effect[0]))
    assert (row.statistic, row.p, row.df) == pytest.approx((float(test.tvalue[0, 0]), float(test.pvalue), 33))


def test_orders_that_have_to_be_left_out_are_counted_in_the_note() -> None:
    """Of four rows of a Latin square of four levels, a mirrored pair is balanced alone."""
    levels = ("a", "b", "c", "d")
    square = [tuple(levels[place] for place in row) for row in balanced_square(4)]
    generator = np.random.default_rng(3)
    cells = RepeatedCells(
        {"prediction": levels},
        ("prediction",),
        tuple(((), generator.normal(60, 9, (4, 4))) for _ in range(3)),
        tuple(tuple((level,) for level in order) for order in square[:3]),
    )
    (row,) = select(factorial_within.of_repeated(cells, ""), test="anova")
    assert row.note.endswith(f", {WEIGHTED} (1 of 3 by 0)")


def test_orders_are_balanced_for_each_level_between_people() -> None:
    square = [tuple(LEVELS[place] for place in row) for row in balanced_square(3)]
    both = cells_of(square, ("off", "on"))
    assert factorial_within.problem_with(both) == ""
    lacking = RepeatedCells(both.factors, both.within, both.groups[:8], both.orders[:8])
    problem = factorial_within.problem_with(lacking)
    assert problem.startswith("the orders of the blocks with opacity on are not balanced")
