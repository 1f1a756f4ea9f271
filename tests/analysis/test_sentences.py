"""Headlines and sentences: the tests they use, the direction they report, and their wording without findings."""

import re
from dataclasses import replace
from pathlib import Path

import polars as pl
import pytest

from analysis import apa_text, formatting
from analysis.phrases import significant
from analysis.report import write_report
from analysis.results import Result, select
from analysis.study import Options
from analysis.synthetic import Truth, write_export
from tests.support.simulation import AGENTS, LAYOUTS, ReportText, World, episodes_of, report_text, report_text_of

LOW = World(effect=(-30.0,) * 5, answers=-1.5, person_sd=8.0)


@pytest.fixture(scope="module")
def low() -> ReportText:
    """ToM predictions harm: 30 points, and 1.5 points of the scale."""
    return report_text(LOW, 1)


@pytest.fixture(scope="module")
def nothing() -> ReportText:
    return report_text(World(person_sd=30.0), 4)


def one(said: ReportText, part: str) -> str:
    found = [text for text in said.sentences if part in text]
    assert len(found) == 1, found
    return found[0]


def test_a_fall_is_called_a_fall_with_its_layouts(low: ReportText) -> None:
    text = one(low, "After Benjamini")
    assert "ToM predictions lowered the reward with SP on Coordination Ring, " in text
    assert "compared with no prediction" in text
    assert "raise" not in text
    assert "teams earn less in 5 of 5 layouts with SP and 5 of 5 with FCP than with no prediction" in low.findings[1]
    assert "more" not in low.findings[1]
    assert re.search(r"was \d+\.\d points lower with ToM predictions than with no prediction", one(low, "mixed model"))


def test_a_difference_that_may_be_chance_has_no_direction(nothing: ReportText) -> None:
    text = one(nothing, "mixed model")
    row = select(nothing.rows, test="fixed_effect", contrast="tom - none")[0]
    assert row.p > 0.05
    estimate = f"(estimate {formatting.number(row.estimate, 1)} points"
    assert f"did not differ significantly between ToM predictions and no prediction {estimate}" in text
    assert "higher" not in text
    assert "lower" not in text
    text = one(nothing, "After Benjamini")
    assert "the reward did not differ significantly between ToM predictions and no prediction on any layout" in text
    assert re.search(r"\(estimates from −?\d+\.\d to −?\d+\.\d points\)", text)
    assert nothing.findings[1].startswith("Reward does not differ significantly between")


def test_headlines_use_tests_over_people_also_where_the_published_test_has_a_false_alarm() -> None:
    """Of studies without any difference, one in which the published test finds one and the permutation does not."""
    for seed in range(100):
        said = report_text(World(person_sd=30.0), 500 + seed)
        published = select(said.rows, section="reward", test="kruskal_wallis")
        people = select(said.rows, section="reward", test="kruskal_wallis_people")
        if any(row.p < 0.05 for row in published) and not any(row.p_adjusted < 0.05 for row in people):
            break
    else:
        pytest.fail("no such study in a hundred: the simulation is not what it says")
    assert said.findings[0].startswith("No difference in reward between the conditions was found")
    text = one(said, "Between the three conditions")
    assert text.startswith("Between the three conditions rewards did not differ significantly with the SP agent")
    assert "The published test, which treats the episodes of a person as independent, gives:" in text
    assert f"{published[0].n} episodes of 87 people" in text
    assert "episodes of 87 people" in said.findings[0]


def test_a_difference_that_turns_with_the_layout_is_said_to_depend_on_it() -> None:
    said = report_text(World(effect=(40.0, 40.0, 0.0, -40.0, -40.0)), 3)
    assert "The difference depends on the layout." in said.findings[1]
    assert "The difference depended on the layout (<i>p</i> = " in one(said, "mixed model")
    text = one(said, "After Benjamini")
    assert re.search(
        r"raised the reward with SP on Coordination Ring.* and lowered it with SP on .*Clear Division", text
    )
    assert "teams earn more in" in said.findings[1]
    assert "and less in" in said.findings[1]


def test_a_difference_that_turns_with_the_agent_is_said_to_depend_on_it() -> None:
    episodes, answers = episodes_of(World(), 5)
    turned = pl.when(pl.col("agent") == "sp").then(25.0).otherwise(-25.0)
    tom = pl.when(pl.col("condition") == "tom").then(turned).otherwise(0.0)
    said = report_text_of(episodes.with_columns(reward=pl.col("reward") + tom), answers)
    assert "and depended on the agent (<i>p</i> = .0" in one(said, "mixed model")
    assert "did not differ significantly between ToM" in one(said, "mixed model")


def test_effects_that_a_mixed_model_does_not_have_are_not_named(nothing: ReportText, tmp_path: Path) -> None:
    assert "as random effect and agent and layout as fixed effects, the" in one(nothing, "mixed model")
    truth = Truth(participants=4, agents=("sp",), layouts=("matrix", "double_rings"), timesteps=20, broken=0)
    write_export(truth, tmp_path / "data")
    said = apa_text.sentences(write_report(tmp_path / "data", tmp_path / "out", Options(power_studies=20)).analysis)
    (text,) = (text for text in said if "mixed model" in text)
    assert "as random effect and layout as fixed effect, the reward" in text


def test_layouts_whose_answers_are_not_compared_are_named(nothing: ReportText) -> None:
    text = one(nothing, "Answers about")
    assert text.startswith(
        "Answers about Coordination Ring, Double Rings, Double Counters and Matrix, "
        "and not those about Clear Division, were averaged"
    )


def test_every_question_and_comparison_has_a_sentence_also_without_a_finding(nothing: ReportText) -> None:
    tests = select(nothing.rows, section="questionnaire", test="t_test_people")
    assert len(tests) == 3 * 3 * len(AGENTS)
    assert all("corrected <i>p</i>" in text for text in nothing.sentences if text.startswith("“"))
    assert sum(text.startswith("“") for text in nothing.sentences) == 9
    assert "18 t-tests over people, with Benjamini-Hochberg correction over all of them; none of 18" in one(
        nothing, "Answers about"
    )


def test_the_questionnaire_is_one_corrected_family_over_people(low: ReportText) -> None:
    tests = select(low.rows, section="questionnaire", test="t_test_people")
    ordered = sorted(row.p for row in tests)
    by_hand = [min(p * 18 / rank for rank, p in enumerate(ordered, start=1) if p >= row.p) for row in tests]
    assert [row.p_adjusted for row in tests] == pytest.approx(by_hand)
    assert {row.n for row in tests} == {58}
    text = next(text for text in low.sentences if text.startswith("“Satisfied with partner” was rated lower with SP"))
    assert "under ToM predictions than under" in text
    means = select(low.rows, section="questionnaire", test="mean")
    assert {(row.n, row.unit) for row in means} == {(29, "people")}


def test_an_agent_that_went_the_other_way_is_not_called_higher() -> None:
    episodes, answers = episodes_of(World(), 6)
    tom = (pl.col("condition") == "tom") & (pl.col("question") == "efficiency")
    shift = pl.when(tom & (pl.col("agent") == "sp")).then(1.5).when(tom).then(-0.3).otherwise(0.0)
    said = report_text_of(episodes, answers.with_columns(value=pl.col("value") + shift))
    text = next(
        text
        for text in said.sentences
        if text.startswith("“Efficiency of cooperation”") and "ToM predictions than under no prediction" in text
    )
    row = select(said.rows, test="t_test_people", question="efficiency", contrast="tom - none", agent="fcp")[0]
    assert row.estimate < 0
    assert not significant(row)
    assert "was rated higher with SP (" in text
    assert f"; the difference was not significant with FCP (estimate {formatting.number(row.estimate)}, " in text


@pytest.mark.usefixtures("no_pictures")
def test_those_who_left_are_not_called_removed(tmp_path: Path) -> None:
    write_export(Truth(participants=4, layouts=LAYOUTS[:2], timesteps=20, broken=0), tmp_path / "data")
    people = pl.read_parquet(tmp_path / "data" / "participants.parquet")
    index = pl.int_range(pl.len())
    status = pl.when(index < 3).then(pl.lit("timed_out")).otherwise(pl.lit("completed"))
    excluded = pl.when(index == 4).then(pl.lit("asked a friend to play")).otherwise(pl.lit(""))
    people.with_columns(status=status, excluded=excluded).write_parquet(tmp_path / "data" / "participants.parquet")
    episodes = pl.read_parquet(tmp_path / "data" / "episodes.parquet")
    first = (pl.col("participant_0") == "p00000") & (pl.col("number") == 4)
    removed = (pl.col("participant_0") == "p00006") & (pl.col("number") == 1)
    episodes.with_columns(
        status=pl.when(first).then(pl.lit("aborted")).otherwise(pl.lit("done")),
        excluded=pl.when(removed).then(pl.lit("technical fault")).otherwise(pl.lit("")),
    ).write_parquet(tmp_path / "data" / "episodes.parquet")
    made = write_report(tmp_path / "data", tmp_path / "out", Options(power_studies=20))
    text = apa_text.sentences(made.analysis)[0]
    assert text == (
        "The analysis is of 31 episodes of 8 simulated participants. Of 48 episodes begun, 17 were left out: 11 of "
        "simulated participants who did not finish the study (22.9 %), one not played to the end (2.1 %), one removed "
        "by the researcher (2.1 %) and four of simulated participants whom the researcher excluded (8.3 %)."
    )


def test_significance_is_that_of_the_corrected_value_where_there_is_one() -> None:
    row = Result("reward", "t_test_people", p=0.01, p_adjusted=0.06)
    assert not significant(row)
    assert significant(replace(row, p_adjusted=0.04))
    assert significant(Result("reward", "fixed_effect", p=0.04))
