"""Equivalence within the smallest effect of interest: numbers compared with statsmodels, and sentences that claim no
more than shown.
"""

import math
import re
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from statsmodels.stats.weightstats import ttost_ind

from analysis.declared import DeclaredEffect, declaration_of, declared_effect
from analysis.equivalence import claim_rows, equivalence_rows
from analysis.equivalence_text import equivalence_sentences, outcome
from analysis.report import write_report
from analysis.results import Result, select
from analysis.study import Options
from analysis.synthetic import Truth, write_export
from analysis.tables import read_export
from server.study.analysis_plan import SmallestEffect
from tests.support.declaring import declaring

QUICK = Options(power_studies=20, draws=50)
SMALLEST = "smallest_effect: {reward: 12, answers: 1.5}\n"
BASE = Result("equivalence", "equivalence", layout="all", agent="all", unit="people")
PAIR = ("random", "none")


def test_the_study_file_and_the_report_know_the_same_smallest_effect() -> None:
    assert set(SmallestEffect.model_fields) == set(DeclaredEffect.__dataclass_fields__)
    texts = {"smallest_effect": {"reward": "5", "answers": "0.5", "layouts": ["matrix"]}}
    assert declared_effect(texts) == DeclaredEffect(5.0, 0.5, ("matrix",))
    with pytest.raises(ValueError, match=r"smallest_effect.reward: 'much' is not a number above 0"):
        declared_effect({"smallest_effect": {"reward": "much"}})


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.5, 30), st.floats(-10, 10))
def test_two_one_sided_tests_are_statsmodels(seed: int, bound: float, shift: float) -> None:
    generator = np.random.default_rng(seed)
    first, second = generator.normal(shift, 9, 14), generator.normal(0, 4, 22)
    row, difference = claim_rows(BASE, PAIR, first, second, bound)
    p, above, below = ttost_ind(first, second, -bound, bound, usevar="unequal")
    assert row.p == pytest.approx(p)
    assert row.statistic == pytest.approx(above[0] if above[1] >= below[1] else below[0])
    assert row.df == pytest.approx(above[2])
    assert difference.p == pytest.approx(stats.ttest_ind(first, second, equal_var=False).pvalue)
    inside = -bound < row.estimate_low and row.estimate_high < bound
    assert inside == (row.p < 0.05), "the 90 % interval decides as the test does"


def people(centre: float, spread: float) -> np.ndarray:
    """Thirty values around a centre."""
    return centre + spread * stats.norm.ppf((np.arange(30) + 0.5) / 30)


@pytest.mark.parametrize(
    ("shift", "spread", "found", "words"),
    [
        (0.2, 3.0, "equivalent", "random predictions and no prediction were equivalent within ±5.0 points"),
        (2.5, 2.0, "trivial", "random predictions and no prediction differed, but by less than 5.0 points"),
        (9.0, 3.0, "different", "differed, and were not shown to be equivalent within ±5.0 points"),
        (3.0, 25.0, "not shown", "neither a difference between random predictions and no prediction nor equivalence"),
    ],
)
def test_the_sentence_agrees_with_the_finding(shift: float, spread: float, found: str, words: str) -> None:
    pair = claim_rows(BASE, PAIR, people(60 + shift, spread), people(60, spread), 5.0)
    assert outcome(*pair) == found
    (sentence,) = equivalence_sentences(pair)
    assert sentence.startswith("In reward over all layouts, ")
    assert words in sentence
    assert "were equivalent" not in sentence or found == "equivalent"


def test_without_variance_or_people_nothing_is_claimed() -> None:
    for first in (np.full(5, 3.0), np.array([1.0])):
        pair = claim_rows(BASE, PAIR, first, np.full(5, 3.0), 1.0)
        assert outcome(*pair) == ""
        assert (
            "equivalence of random predictions and no prediction could not be tested: "
            in (equivalence_sentences(pair)[0])
        )


@pytest.mark.slow
def test_equivalence_is_wrongly_claimed_no_more_often_than_alpha() -> None:
    """The true difference lies on the bound, where a claim is wrong and as likely as it can be."""
    generator = np.random.default_rng(1)
    claims = sum(
        claim_rows(BASE, PAIR, generator.normal(3, 4, 40), generator.normal(0, 4, 40), 3.0)[0].p < 0.05
        for _ in range(1500)
    )
    assert stats.binom.ppf(0.0005, 1500, 0.05) <= claims <= stats.binom.ppf(0.9995, 1500, 0.05)


@pytest.mark.usefixtures("no_pictures")
def test_the_report_has_the_three_claims_over_people(planted_folder: Path, tmp_path: Path) -> None:
    folder = declaring(planted_folder, tmp_path / "data", SMALLEST)
    made = write_report(folder, tmp_path / "out", QUICK)
    rows = select(made.analysis.rows, section="equivalence", test="equivalence")
    assert [(row.question, row.layout, row.contrast) for row in rows] == [
        ("", "clear_division", "tom - none"),
        ("", "all", "random - none"),
        ("partner_satisfaction", "chosen", "tom - none"),
        ("partner_satisfaction", "chosen", "tom - random"),
        ("partner_satisfaction", "chosen", "random - none"),
    ]
    assert {row.n for row in rows} == {32}
    blind = rows[1]
    means = made.analysis.episodes.group_by("participant", "condition").agg(pl.col("reward").mean())
    first, second = (means.filter(pl.col("condition") == name)["reward"].to_numpy() for name in PAIR)
    assert blind.p == pytest.approx(ttost_ind(first, second, -12, 12, usevar="unequal")[0])
    page = made.page.read_text(encoding="utf-8")
    assert "In reward on Clear Division, ToM predictions and no prediction differed" in page
    assert re.search(r"In the answers to “Satisfied with partner”, [^.]*no prediction", page)
    assert "sets no smallest effect" not in page


@pytest.mark.usefixtures("no_pictures")
def test_without_a_smallest_effect_nothing_is_called_equivalent(planted_folder: Path, tmp_path: Path) -> None:
    made = write_report(planted_folder, tmp_path / "out", QUICK)
    page = made.page.read_text(encoding="utf-8")
    assert "The study file sets no smallest effect of interest" in page
    assert "were equivalent" not in page
    assert select(made.analysis.rows, section="equivalence") == []


def test_only_what_is_set_is_tested(planted_folder: Path, tmp_path: Path) -> None:
    text = "smallest_effect: {reward: 9, layouts: [matrix]}\n"
    export = read_export(declaring(planted_folder, tmp_path / "data", text))
    smallest = declaration_of(export).smallest
    assert smallest == DeclaredEffect(9.0, None, ("matrix",))
    episodes = export.episodes.with_columns(reward=pl.col("score") + pl.col("progress"))
    answers = export.answers.clear().with_columns(condition=pl.lit(""))
    rows = equivalence_rows(smallest, episodes, answers, ("none", "tom"), ("tom", "none"))
    assert [(row.test, row.layout) for row in rows] == [("equivalence", "matrix"), ("difference", "matrix")]
    assert not math.isnan(rows[0].p)


def test_a_smallest_effect_that_came_after_some_data_is_named(planted_folder: Path, tmp_path: Path) -> None:
    texts = ("smallest_effect: {reward: 2}\n", "smallest_effect: {reward: 9}\n")
    found = declaration_of(read_export(declaring(planted_folder, tmp_path / "data", *texts)))
    assert found.smallest == DeclaredEffect(9.0)
    assert "24 simulated participants took part under version 1" in found.warning
    assert "another smallest effect" in found.warning
    assert "primary test" not in found.warning


@pytest.mark.usefixtures("no_pictures")
def test_the_report_does_not_say_that_an_effect_is_not_set_where_the_data_have_nothing_to_test_with_it(
    tmp_path: Path,
) -> None:
    truth = Truth(participants=4, conditions=("none", "tom"), layouts=("matrix",), timesteps=20, broken=0)
    write_export(truth, tmp_path / "plain")
    folder = declaring(tmp_path / "plain", tmp_path / "data", "smallest_effect: {reward: 5}\n")
    made = write_report(folder, tmp_path / "report", QUICK)
    page = made.page.read_text("utf-8")
    assert select(made.analysis.rows, section="equivalence") == [], "clear_division was not played"
    assert "sets no smallest effect of interest" not in page
    assert "nothing to test with it: two conditions on a layout where predictions should make no difference" in page
