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
from analysis.block_orders import ADJUSTED, WHY
from analysis.factorial_within import RepeatedCells
from analysis.report import Report, write_report
from analysis.results import Result, select
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
    assert not made.analysis.powers
    assert "Power of the t-test" not in page
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


@pytest.mark.parametrize("left_out", range(6))
def test_a_latin_square_without_one_order_is_tested_next_to_effects_of_the_blocks(left_out: int) -> None:
    """With equal orders, the estimates are those of least squares with levels, blocks and people."""
    square = [tuple(LEVELS[place] for place in row) for row in balanced_square(3)]
    cells = cells_of(square[:left_out] + square[left_out + 1 :])
    rows = factorial_within.of_repeated(cells, "")
    (test,) = select(rows, test="anova")
    assert test.note.endswith(f", {ADJUSTED}")
    assert np.isfinite(test.p)
    (sentence,) = factorial_text.factorial_sentences([test])
    assert f"with the {ADJUSTED}, {WHY}" in sentence
    data = pd.DataFrame(
        {"value": value, "level": level, "block": order.index((level,)), "person": f"{number}-{person}"}
        for number, ((_, people), order) in enumerate(zip(cells.groups, cells.orders, strict=True))
        for person, values in enumerate(people)
        for level, value in zip(LEVELS, values, strict=True)
    )
    model = ols("value ~ C(level) + C(block) + C(person)", data).fit()
    for row, level in zip(select(rows, test="simple_effect"), ("random", "tom"), strict=False):
        assert row.contrast == f"prediction: {level} - none"
        assert row.estimate == pytest.approx(model.params[f"C(level)[T.{level}]"])
        assert row.df == 15
    means = select(rows, test="marginal_mean")
    assert means[2].estimate - means[0].estimate == pytest.approx(model.params["C(level)[T.tom]"])


@pytest.mark.parametrize("left_out", [0, 4])
def test_nothing_that_blocks_or_orders_add_is_an_effect_of_the_levels(left_out: int) -> None:
    """Learning is fast at first: 20 points in the second block, and 5 in the third."""
    square = [tuple(LEVELS[place] for place in row) for row in balanced_square(3)]
    cells = cells_of(square[:left_out] + square[left_out + 1 :])
    later = [[(0.0, 20.0, 25.0)[order.index((level,))] for level in LEVELS] for order in cells.orders]
    groups = (
        (between, values + np.array(added) + 3 * place)
        for place, ((between, values), added) in enumerate(zip(cells.groups, later, strict=True))
    )
    moved = replace(cells, groups=tuple(groups))
    for test in ("anova", "simple_effect"):
        before, after = (select(factorial_within.of_repeated(one, ""), test=test) for one in (cells, moved))
        assert [row.p for row in after] == pytest.approx([row.p for row in before])
        assert [row.estimate for row in after] == pytest.approx([row.estimate for row in before], nan_ok=True)


@pytest.mark.slow
def test_tests_next_to_effects_of_the_blocks_are_as_often_significant_as_alpha_says() -> None:
    square = [tuple(LEVELS[place] for place in row) for row in balanced_square(3)][1:]
    generator = np.random.default_rng(4)
    found, studies = 0, 1500
    cells = cells_of(square)
    for _ in range(studies):
        values = (generator.normal(60, 9, (5, 1)) + generator.normal(0, 6, (5, 3)) for _ in square)
        one = replace(cells, groups=tuple(((), people) for people in values))
        found += factorial_within.tested(Result("", ""), one, ("prediction",)).p < 0.05
    assert abs(found / studies - 0.05) < 4 * np.sqrt(0.05 * 0.95 / studies)


def test_a_latin_square_that_is_complete_is_not_adjusted() -> None:
    square = [tuple(LEVELS[place] for place in row) for row in balanced_square(3)]
    for orders in (square, square[:3]):  # the rows without their mirrors are balanced too
        assert factorial_within.problem_with(cells_of(orders)) == ""
        (row,) = select(factorial_within.of_repeated(cells_of(orders), ""), test="anova")
        assert ADJUSTED not in row.note
    ends = [square[0], (square[0][0], square[0][2], square[0][1])]  # one level is always first
    assert "are not balanced" in factorial_within.problem_with(cells_of(ends))


def test_orders_are_balanced_for_each_level_between_people() -> None:
    square = [tuple(LEVELS[place] for place in row) for row in balanced_square(3)]
    both = cells_of(square, ("off", "on"))
    assert factorial_within.problem_with(both) == ""
    (row,) = select(factorial_within.of_repeated(both, ""), test="anova", contrast="prediction")
    assert ADJUSTED not in row.note
    lacking = RepeatedCells(both.factors, both.within, both.groups[:-1], both.orders[:-1])
    noted = {row.contrast: row.note for row in select(factorial_within.of_repeated(lacking, ""), test="anova")}
    assert ADJUSTED in noted["prediction"]
    assert ADJUSTED in noted["prediction x opacity"]
    assert noted["opacity"] == "between people", "each person has all blocks"
    lacking = RepeatedCells(both.factors, both.within, both.groups[:7], both.orders[:7])
    problem = factorial_within.problem_with(lacking)
    assert problem.startswith("the orders of the blocks with opacity on are not balanced")


def test_sentences_about_answers_name_the_method_within_people(tmp_path: Path) -> None:
    """Also where p is corrected over the questions."""
    made = reported(tmp_path)
    about = [
        text for text in factorial_text.factorial_sentences(made.analysis.rows) if "analysis of variance of “" in text
    ]
    assert len(about) > 1
    assert all("(prediction within people, with the orders of the blocks averaged)" in text for text in about)
    tests = select(made.analysis.rows, section="factorial", test="anova")
    assert all(row.note.startswith("within people; Benjamini-Hochberg over") for row in tests if row.question)


def test_captions_name_the_levels_that_the_models_have(tmp_path: Path) -> None:
    page = reported(tmp_path).page.read_text("utf-8")
    wanted = "answer ~ condition + agent + layout + combinations of prediction, in interaction with the condition,"
    assert wanted in page
    assert "Differences in reward, with the effects of the mixed model above. Clusters" in page
