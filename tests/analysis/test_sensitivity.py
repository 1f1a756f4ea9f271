"""Sensitivity to exclusions and differential attrition."""

import math
from dataclasses import replace
from itertools import product

import polars as pl
import pytest
from scipy import stats

from analysis import data_quality, exclusions, measures
from analysis.declared import Declaration, DeclaredTest
from analysis.results import Result, select
from analysis.sensitivity import attrition_rows, compared, sensitivity_rows
from analysis.sensitivity_text import sensitivity_sentences
from analysis.tables import Export

DECLARED = DeclaredTest("reward", ("tom", "none"))
BASE = Result("attrition", "left_by_condition", unit="people")


@pytest.fixture(scope="module")
def with_losses(planted: Export) -> Export:
    """Person 0 (none) and 2 (tom) left; 3 (none) was excluded; an episode of 5 (tom) raises a question."""
    people = planted.participants.with_row_index().with_columns(
        status=pl.when(pl.col("index").is_in([0, 2])).then(pl.lit("timed_out")).otherwise(pl.col("status")),
        excluded=pl.when(pl.col("index") == 3).then(pl.lit("helped by a friend")).otherwise(pl.col("excluded")),
    )
    gone = pl.DataFrame({"study": ["simulated"], "condition": ["tom"]})
    return replace(planted, participants=people.drop("index"), withdrawals=gone)


def rows_of(export: Export) -> list[Result]:
    every = measures.episode_measures(export)
    five = pl.col("participant") == "p00005"
    every = every.with_columns(idle_share=pl.when(five).then(pl.lit(0.95)).otherwise(pl.col("idle_share")))
    analysed = measures.analysed(every, export.participants)
    quality = data_quality.proposals(every, export.answers)
    return sensitivity_rows(DECLARED, every, analysed, quality, export)


def welch(export: Export, out: set[str], excluded_too: bool) -> tuple[float, float, int]:
    """The test by hand: everybody's mean of finished episodes, without the people who are out."""
    found: dict[tuple[str, str], list[float]] = {}
    for row in export.episodes.to_dicts():
        if row["participant"] not in out and (excluded_too or not row["excluded"]):
            found.setdefault((row["condition"], row["participant"]), []).append(row["score"] + row["progress"])
    arms = [[sum(all_) / len(all_) for (name, _), all_ in found.items() if name == arm] for arm in ("tom", "none")]
    t, p = stats.ttest_ind(*arms, equal_var=False)
    return float(t), float(p), sum(map(len, arms))


def test_the_main_test_is_repeated_with_other_people(with_losses: Export) -> None:
    rows = {row.test: row for row in rows_of(with_losses)}
    wanted = {
        "analysed": welch(with_losses, {"p00000", "p00002", "p00003"}, excluded_too=False),
        "assigned": welch(with_losses, set(), excluded_too=True),
        "completed": welch(with_losses, {"p00000", "p00002"}, excluded_too=True),
        "no_drop": welch(with_losses, {"p00000", "p00002", "p00003", "p00005"}, excluded_too=False),
    }
    for name, (t, p, n) in wanted.items():
        assert (rows[name].statistic, rows[name].p, rows[name].n) == pytest.approx((t, p, n)), name
    assert rows["no_flag"].n <= rows["no_drop"].n == 28
    assert {row.section for row in rows.values()} == {"sensitivity"}


def test_shares_of_those_lost_add_up(with_losses: Export) -> None:
    every = measures.episode_measures(with_losses)
    rows = attrition_rows(with_losses, measures.analysed(every, with_losses.participants), seed=1)
    lost = {(row.test, row.condition): (round(row.estimate * row.n), row.n) for row in rows if row.condition}
    assert lost == {
        ("left", "none"): (1, 16),
        ("left", "random"): (0, 16),
        ("left", "tom"): (2, 17),  # one left, one withdrew
        ("not_analysed", "none"): (2, 16),
        ("not_analysed", "random"): (0, 16),
        ("not_analysed", "tom"): (2, 17),
    }


def test_people_who_still_take_part_do_not_count_as_attrition(with_losses: Export) -> None:
    people = with_losses.participants.with_columns(status=pl.col("status").replace("timed_out", "active"))
    rows = attrition_rows(replace(with_losses, participants=people), with_losses.episodes, seed=1)
    assert [row.n for row in select(rows, test="left")] == [15, 16, 16]
    assert [row.estimate > 0 for row in select(rows, test="left")] == [False, False, True]


def exact_p(table: list[tuple[int, int]]) -> float:
    """Freeman and Halton's exact test, by listing every table with these margins."""
    sizes, lost = [a + b for a, b in table], sum(a for a, _ in table)

    def ways(column: tuple[int, ...]) -> int:
        return math.prod(math.comb(size, count) for size, count in zip(sizes, column, strict=True))

    columns = [each for each in product(*(range(size + 1) for size in sizes)) if sum(each) == lost]
    seen = ways(tuple(a for a, _ in table))
    return sum(ways(each) for each in columns if ways(each) <= seen) / math.comb(sum(sizes), lost)


def test_few_losses_are_compared_by_fisher() -> None:
    two = [(1, 14), (6, 9)]
    assert compared(BASE, two, 1).p == pytest.approx(exact_p(two))
    three = [(0, 20), (2, 19), (6, 16)]
    row = compared(BASE, three, 1)
    truth = exact_p(three)
    assert row.p == pytest.approx(truth, abs=4 * math.sqrt(truth * (1 - truth) / 9999))
    assert repr(row) == repr(compared(BASE, three, 1))  # what does not apply is NaN, which equals nothing


def test_many_losses_are_compared_by_chi_square() -> None:
    table = [(12, 18), (8, 22), (15, 15)]
    row = compared(BASE, table, 1)
    total, lost = 90, 35
    expected = [((lost * 30 / total), (total - lost) * 30 / total)] * 3
    chi2 = sum(
        (o - e) ** 2 / e for seen, want in zip(table, expected, strict=True) for o, e in zip(seen, want, strict=True)
    )
    assert (row.statistic_name, row.statistic, row.df) == ("chi2", pytest.approx(chi2), 2.0)
    assert row.p == pytest.approx(math.exp(-chi2 / 2))  # chi-square with two degrees of freedom


@pytest.mark.parametrize(("table", "note"), [([(0, 5), (0, 6)], "nobody was lost"), ([(1, 5)], "only one condition")])
def test_without_losses_or_conditions_there_is_no_test(table: list[tuple[int, int]], note: str) -> None:
    row = compared(BASE, table, 1)
    assert math.isnan(row.p)
    assert row.note == note


def test_sentences_say_whether_the_conclusion_holds(with_losses: Export) -> None:
    rows = rows_of(with_losses)
    declaration = Declaration(DECLARED)
    (same,) = sensitivity_sentences(declaration, None, rows)
    assert "between ToM predictions and no prediction does not depend on the exclusions: +" in same
    changed = [replace(row, p=0.3) if row.test == "assigned" else row for row in rows]
    (text,) = sensitivity_sentences(declaration, None, changed)
    assert "depends on the exclusions" in text
    assert "differs with all who were assigned (no significant difference)." in text
    turned = [replace(row, effect=-row.effect) if row.test == "no_drop" else row for row in rows]
    assert "(lower)" in sensitivity_sentences(declaration, None, turned)[0]


def test_the_sentence_about_attrition_counts_people(with_losses: Export) -> None:
    every = measures.episode_measures(with_losses)
    rows = attrition_rows(with_losses, measures.analysed(every, with_losses.participants), seed=1)
    (text,) = sensitivity_sentences(Declaration(), None, rows)
    assert "1 of 16 with no prediction, 0 of 16 with random predictions and 2 of 17 with ToM predictions" in text
    assert "did not differ significantly between the conditions (Fisher" in text


def test_the_sentence_about_attrition_says_who_is_still_taking_part(with_losses: Export) -> None:
    """Table 1 counts them among those assigned, and the shares leave them out."""
    finished = pl.col("status") == "completed"
    left = finished.cum_sum() <= 2
    status = pl.when(finished & left).then(pl.lit("active")).otherwise(pl.col("status").cast(pl.String))
    export = replace(with_losses, participants=with_losses.participants.with_columns(status=status))
    every = measures.episode_measures(export)
    analysed = measures.analysed(every, export.participants)
    rows = [*exclusions.flow(export, every, analysed), *attrition_rows(export, analysed, seed=1)]
    (text,) = sensitivity_sentences(Declaration(), None, rows)
    assert text.startswith("Of those assigned, without the two who are still taking part, these did not finish")


def test_at_an_interim_look_all_populations_are_tested_at_the_same_level(with_losses: Export) -> None:
    """Fewer people after exclusions do not count as an earlier look."""
    every = measures.episode_measures(with_losses)
    analysed = measures.analysed(every, with_losses.participants)
    quality = data_quality.proposals(every, with_losses.answers)
    looks = replace(DECLARED, looks=(29, 60))  # 29 people are analysed, fewer without the flagged
    rows = sensitivity_rows(looks, every, analysed, quality, with_losses)
    assert rows[0].n == 29
    assert len({row.ci_level for row in rows if not math.isnan(row.p)}) == 1
    assert rows[0].ci_level > 0.99
    early = replace(DECLARED, looks=(30, 60))  # all who were assigned are more than 30
    assert sensitivity_rows(early, every, analysed, quality, with_losses) == []
    assert sensitivity_sentences(Declaration(early), None, ()) == []
