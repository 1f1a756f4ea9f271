"""The declared primary test: its numbers against other programs, its place in the report, and its words."""

import csv
import math
import re
from collections import defaultdict
from dataclasses import replace
from functools import reduce
from operator import add
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy import stats
from statsmodels.stats.weightstats import CompareMeans, DescrStatsW

from analysis import primary, primary_power
from analysis.declared import ANOVA, DIRECTIONS, TESTS, Declaration, DeclaredTest, declaration_of, declared_test
from analysis.primary_text import primary_lines, primary_sentence
from analysis.report import write_report
from analysis.results import select
from analysis.study import Options, analyse
from analysis.tables import ExportError, read_export
from server.study.analysis_plan import PrimaryTest
from tests.support.declaring import declaring

QUICK = Options(power_studies=20, draws=50)
PRIMARY = "primary: {comparison: [tom, none]}\n"
FIRST = np.array([71.0, 65.5, 80.0, 92.5, 77.0, 64.0, 81.0])
SECOND = np.array([60.0, 72.0, 55.5, 64.0, 61.0, 58.0])


def test_the_study_file_and_the_report_know_the_same_declaration() -> None:
    fields = PrimaryTest.model_fields
    assert set(fields) == set(DeclaredTest.__dataclass_fields__)
    for name, known in (("test", (*TESTS, ANOVA)), ("direction", DIRECTIONS)):
        assert set(fields[name].annotation.__args__) == set(known)  # type: ignore[union-attr]
    in_the_file = PrimaryTest(comparison=("tom", "none"))
    assert declared_test({"primary": {"comparison": ["tom", "none"]}}) == DeclaredTest(**in_the_file.model_dump())


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("test", ["welch", "student"])
def test_a_declared_t_test_has_the_numbers_of_statsmodels(test: str, direction: str) -> None:
    declared = DeclaredTest("reward", ("tom", "none"), test, direction, alpha=0.04)
    row = primary.compared(declared, FIRST, SECOND)
    other = CompareMeans(DescrStatsW(FIRST), DescrStatsW(SECOND))
    kind = "pooled" if test == "student" else "unequal"
    sides = {"two_sided": "two-sided", "greater": "larger", "less": "smaller"}[direction]
    t, p, df = other.ttest_ind(alternative=sides, usevar=kind)
    assert (row.statistic, row.p, row.df) == pytest.approx((t, p, df))
    alpha = 0.04 if direction == "two_sided" else 0.08
    assert (row.estimate_low, row.estimate_high) == pytest.approx(other.tconfint_diff(alpha, usevar=kind))
    assert row.ci_level == pytest.approx(1 - alpha)
    assert row.estimate == pytest.approx(FIRST.mean() - SECOND.mean())
    assert row.se == pytest.approx(
        other.std_meandiff_pooledvar if test == "student" else other.std_meandiff_separatevar
    )


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_declared_ranks_are_counted_over_pairs(direction: str) -> None:
    first, second = np.array([4.0, 5, 5, 6, 7, 3, 6, 5, 4]), np.array([3.0, 4, 2, 5, 4, 3, 5, 2])
    row = primary.compared(DeclaredTest("fun", ("a", "b"), "mann_whitney", direction), first, second)
    differences = sorted(a - b for a in first for b in second)
    u = sum(1.0 if each > 0 else 0.5 if each == 0 else 0.0 for each in differences)
    m, n = first.size, second.size
    ties = sum(count**3 - count for count in np.unique([*first, *second], return_counts=True)[1])
    sd = math.sqrt(m * n / 12 * (m + n + 1 - ties / ((m + n) * (m + n - 1))))
    above, below = (stats.norm.sf((shift - 0.5) / sd) for shift in (u - m * n / 2, m * n / 2 - u))
    p = {"two_sided": min(1, 2 * min(above, below)), "greater": above, "less": below}[direction]
    assert (row.statistic, row.p) == pytest.approx((u, p))
    assert row.estimate == np.median(differences)


@pytest.mark.parametrize(
    ("direction", "p"), [("two_sided", 0.00105003355777), ("greater", 0.999637359544), ("less", 0.000525016778887)]
)
def test_ranks_without_ties_have_an_exact_p(direction: str, p: float) -> None:
    """R 4.2.2: wilcox.test(a, b, alternative = ...); from the normal distribution the first would be 0.0022."""
    first = np.array([52.3, 61.2, 48.9, 70.4, 55.5, 66.1, 59.0, 43.7, 62.8, 50.6])
    second = np.array([71.9, 66.6, 80.2, 58.1, 75.3, 69.4, 84.5, 77.7, 64.0, 90.3])
    declared = DeclaredTest("fun", ("a", "b"), "mann_whitney", direction)
    assert primary.compared(declared, first, second).p == pytest.approx(p, rel=1e-6)
    simulated = primary_power.p_values(declared, np.stack([first, second]), np.stack([second, second + 0.01]))
    assert simulated[0] == pytest.approx(p, rel=1e-6)


def test_people_whose_means_differ_by_rounding_alone_are_tied() -> None:
    """0.1 + 0.2 + 0.3 and 0.3 + 0.2 + 0.1 differ in the last digit; so do their means."""
    rewards = {"a": (0.1, 0.2, 0.3), "b": (0.3, 0.2, 0.1)}
    one, other = (reduce(add, some) for some in rewards.values())  # `sum` rounds once from Python 3.12 on
    assert one != other
    rows = [(name, name, "x", "sp", reward) for name, some in rewards.items() for reward in some]
    table = pl.DataFrame(rows, schema=["participant", "condition", "layout", "agent", "reward"], orient="row")
    values = primary.values_of_people(DeclaredTest("reward", ("a", "b"), "mann_whitney"), table, pl.DataFrame())
    assert values["a"][0] == values["b"][0]


def by_hand(folder: Path, layouts: set[str], agents: set[str], question: str = "") -> dict[str, list[float]]:
    """Each person's mean by condition, from the tables as they are exported."""
    answers = {
        row["episode"]: float(row["value"])
        for row in pl.read_parquet(folder / "answers.parquet").to_dicts()
        if row["question"] == question
    }
    found = defaultdict(list)
    for row in pl.read_parquet(folder / "episodes.parquet").to_dicts():
        if row["layout"] in layouts and row["agent_1"] in agents and not row["excluded"]:
            value = answers.get(row["episode"]) if question else row["score"] + row["progress"]
            found[row["condition"], row["participant_0"]].append(value)
    means = defaultdict(list)
    for (condition, _), values in found.items():
        means[condition].append(sum(values) / len(values))
    return means


@pytest.mark.parametrize("question", ["", "efficiency"])
def test_a_person_counts_once_with_the_declared_episodes_only(
    question: str, planted_folder: Path, tmp_path: Path
) -> None:
    measure = f"measure: {question}, " if question else ""
    text = f"primary: {{{measure}comparison: [tom, random], layouts: [matrix, double_rings], agents: [fcp]}}\n"
    export = read_export(declaring(planted_folder, tmp_path / "data", text))
    declared = declaration_of(export).primary
    assert declared is not None
    row = primary.primary_row(declared, export.episodes.filter(pl.col("excluded") == "").with_columns(
        reward=pl.col("score") + pl.col("progress")
    ), export)  # fmt: skip
    means = by_hand(planted_folder, {"matrix", "double_rings"}, {"fcp"}, question)
    t, p = stats.ttest_ind(means["tom"], means["random"], equal_var=False)
    assert (row.statistic, row.p) == pytest.approx((t, p))
    assert row.estimate == pytest.approx(np.mean(means["tom"]) - np.mean(means["random"]))
    assert (row.n, row.unit, row.contrast, row.question) == (32, "people", "tom - random", question)


@pytest.mark.usefixtures("no_pictures")
def test_the_declared_test_comes_first_in_the_report(planted_folder: Path, tmp_path: Path) -> None:
    folder = declaring(planted_folder, tmp_path / "data", PRIMARY, PRIMARY)
    made = write_report(folder, tmp_path / "out", QUICK)
    page = made.page.read_text(encoding="utf-8")
    box = page[page.index('<section class="primary"') : page.index("</section>")]
    assert "Primary test, declared in the study file" in box
    assert "Declared: Welch’s t-test over simulated participants of the reward" in box
    assert re.search(r"was significantly higher with ToM predictions than with no prediction \(difference \+\d", box)
    assert "Every other test in this report is secondary or exploratory." in box
    assert page.index('<section class="primary"') < page.index('<ol class="find">')
    assert "Secondary and exploratory findings" in page
    assert page.index("In the primary test", page.index("Sentences to paste")) < page.index("The analysis is of")
    with made.results.open(encoding="utf-8", newline="") as stream:
        first = next(csv.DictReader(stream))
    assert (first["section"], first["test"]) == ("primary", "welch")


@pytest.mark.usefixtures("no_pictures")
def test_a_study_without_a_primary_test_is_called_exploratory(planted_folder: Path, tmp_path: Path) -> None:
    made = write_report(planted_folder, tmp_path / "out", QUICK)
    page = made.page.read_text(encoding="utf-8")
    assert "The study file declared no primary test before data collection, so every test in this report is" in page
    assert "In the primary test" not in page
    assert select(made.analysis.rows, section="primary") == []


@pytest.mark.parametrize(
    ("before", "words"),
    [("", "which declares no primary test"), ("primary: {comparison: [tom, random]}\n", "declares another primary")],
)
def test_a_declaration_that_came_after_some_data_is_named(
    before: str, words: str, planted_folder: Path, tmp_path: Path
) -> None:
    export = read_export(declaring(planted_folder, tmp_path / "data", before, PRIMARY))
    found = declaration_of(export)
    assert found.primary == DeclaredTest("reward", ("tom", "none"))
    assert words in found.warning
    assert "24 simulated participants took part under version 1" in found.warning
    assert primary_lines(found, ())[0].startswith("<b>24 simulated participants")
    alone = read_export(tmp_path / "data", version=2)
    assert declaration_of(alone) == Declaration(found.primary)


def test_a_version_under_which_nobody_took_part_declares_nothing(planted_folder: Path, tmp_path: Path) -> None:
    """It came after the data: neither its primary test nor its factors are those of the study that was run."""
    later = "primary: {comparison: [random, none]}\nfactors: {prediction: [none, tom, more]}\n"
    folder = declaring(planted_folder, tmp_path / "data", PRIMARY, later)
    people = pl.read_parquet(folder / "participants.parquet").with_columns(study_version=1)
    people.write_parquet(folder / "participants.parquet")
    export = read_export(folder)
    assert declaration_of(export) == Declaration(DeclaredTest("reward", ("tom", "none")))
    assert export.about["factors"] == {}


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("primary: [tom, none]\n", "primary: this is not a block"),
        ("primary: {comparison: [tom]}\n", "primary.comparison: it needs two different conditions"),
        ("primary: {comparison: tom}\n", "primary.comparison: this is not a list"),
        ("primary: {comparison: [tom, none], test: anova}\n", "primary.test: 'anova' is not one of welch"),
        ("primary: {comparison: [tom, none], alpha: none}\n", "primary.alpha: 'none' is not a number"),
        ("primary: {comparison: [tom, none], alpha: 0.7}\n", "primary.alpha: 0.7 is too large"),
    ],
)
def test_a_damaged_declaration_is_refused_with_its_place(
    text: str, reason: str, planted_folder: Path, tmp_path: Path
) -> None:
    export = read_export(declaring(planted_folder, tmp_path / "data", text))
    with pytest.raises(ExportError, match=re.escape(reason)) as raised:
        analyse(export, QUICK)
    assert "simulated_version-1.yaml: primary" in str(raised.value)


@pytest.mark.parametrize(
    ("direction", "sign", "words"),
    [
        ("two_sided", 1, "was significantly higher"),
        ("two_sided", -1, "was significantly lower"),
        ("greater", 1, "was significantly higher"),
        ("greater", -1, "was not significantly higher"),
        ("less", -1, "was significantly lower"),
        ("less", 1, "was not significantly lower"),
        ("two_sided", 0, "did not differ significantly"),
    ],
)
@pytest.mark.parametrize("test", TESTS)
def test_the_sentence_agrees_with_the_test(test: str, direction: str, sign: int, words: str) -> None:
    declared = DeclaredTest("reward", ("tom", "none"), test, direction)
    around = np.array([58.0, 60, 62, 64, 66, 68, 70])
    row = primary.compared(declared, around + 20 * sign, around + 0.5)
    assert words in primary_sentence(Declaration(declared), (row,))
    doubt = replace(declared, alpha=1e-9)
    assert "significantly" in primary_sentence(Declaration(doubt), (row,))
    assert "was significantly" not in primary_sentence(Declaration(doubt), (row,)), "the declared alpha decides"


def test_a_primary_test_without_data_gives_the_reason() -> None:
    declared = DeclaredTest("reward", ("tom", "none"))
    row = primary.compared(declared, np.array([1.0]), np.array([]))
    assert math.isnan(row.p)
    said = primary_sentence(Declaration(declared), (row,))
    assert said == "The primary test could not be computed: fewer than two values in a condition."
