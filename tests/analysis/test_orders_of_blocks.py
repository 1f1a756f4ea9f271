"""Blocks within people: no test where levels and blocks cannot be told apart, and no sentence that compares orders."""

from itertools import product
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from analysis import apa_text, factorial_within
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


def test_a_latin_square_is_tested_only_if_it_is_complete() -> None:
    square = [tuple(LEVELS[place] for place in row) for row in balanced_square(3)]
    assert len(square) == 6
    assert factorial_within.problem_with(cells_of(square)) == ""
    assert factorial_within.problem_with(cells_of(square[:3])) == "", "the rows without their mirrors are balanced too"
    for left_out in range(6):
        problem = factorial_within.problem_with(cells_of(square[:left_out] + square[left_out + 1 :]))
        assert "are not balanced" in problem
    assert "are not balanced" in factorial_within.problem_with(cells_of(square[:2]))


def test_orders_are_balanced_for_each_level_between_people() -> None:
    square = [tuple(LEVELS[place] for place in row) for row in balanced_square(3)]
    both = cells_of(square, ("off", "on"))
    assert factorial_within.problem_with(both) == ""
    lacking = RepeatedCells(both.factors, both.within, both.groups[:-1], both.orders[:-1])
    problem = factorial_within.problem_with(lacking)
    assert problem.startswith("the orders of the blocks with opacity on are not balanced")
