"""What the report says of predictors' accuracy, where conditions have different ones."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import polars as pl
import pytest

from analysis import accuracy, accuracy_text, apa_text
from analysis.report import write_analysed
from analysis.results import Result, select
from analysis.simulated_participants import PEOPLE
from analysis.study import Analysis, Options, analyse
from analysis.tables import Export

QUICK = Options(power_studies=20, draws=200)
Named = Callable[[str, str], str]  # agent, condition -> predictor


def with_predictors(export: Export, named: Named) -> Export:
    """The export with predictors that are right as planted, except where errors were added: those are always wrong."""
    pairs = export.episodes.select("agent", "condition").iter_rows()
    episodes = export.episodes.with_columns(predictor=pl.Series([named(*pair) for pair in pairs]))
    wrong = episodes.filter(pl.col("predictor").str.contains("@")).select("episode", wrong=True)
    ticks = export.ticks.join(wrong, on="episode", how="left").with_columns(
        pl.when(pl.col("wrong").is_not_null())
        .then(pl.lit(7, dtype=pl.Int8))
        .otherwise(pl.col(f"predicted_{step}"))
        .alias(f"predicted_{step}")
        for step in (1, 2, 3)
    )
    return replace(export, episodes=episodes, ticks=ticks)


def degraded_in_random(agent: str, condition: str) -> str:
    return f"{agent}_predictor_stream{'@60' if condition == 'random' else ''}"


@pytest.fixture(scope="module")
def degraded(planted: Export) -> Analysis:
    return analyse(with_predictors(planted, degraded_in_random), QUICK)


def test_errors_on_purpose_do_not_count_against_the_predictor(degraded: Analysis, planted: Export) -> None:
    kept = replace(planted, episodes=planted.episodes.filter(pl.col("condition") != "random"))
    wanted = select(analyse(kept, QUICK).rows, section="accuracy", test="live", layout="all", condition="all", step=0)
    found = select(degraded.rows, section="accuracy", test="live", layout="all", condition="all", step=0)
    trained = [row for row in found if accuracy.degraded_to(row.note) is None]
    assert [row.estimate for row in trained] == pytest.approx([row.estimate for row in wanted])
    assert [(row.agent, row.note, row.estimate) for row in found if row not in trained] == [
        ("sp", "sp_predictor_stream@60", 0),
        ("fcp", "fcp_predictor_stream@60", 0),
    ]


def test_only_the_predictor_as_trained_is_compared_with_the_offline_test(degraded: Analysis) -> None:
    text = apa_text.findings(degraded)[-1]
    first, second = text.split(". ")
    assert "points less than in the offline test" in first
    assert (
        second == "Degraded on purpose to 60 %, the predictor is right 0.0 % of the time with simulated participants."
    )
    offline = select(degraded.rows, section="accuracy", test="offline")
    assert {row.note for row in offline} == {"sp_predictor_stream", "fcp_predictor_stream"}


@pytest.mark.usefixtures("no_pictures")
def test_a_degraded_predictor_has_a_row_of_its_own_with_the_wanted_accuracy(degraded: Analysis, tmp_path: Path) -> None:
    page = write_analysed(degraded, tmp_path, QUICK).page.read_text(encoding="utf-8")
    table = page[page.index("4. Was the predictor right?") :].split("</table>")[0]
    assert table.count(", degraded to 60 %</td>") == 2
    assert table.count("Difference</td>") == 2
    assert "errors were added on purpose" in table


def test_forms_of_a_predictor_are_named_and_compared_with_their_own_offline_test() -> None:
    base = Result("accuracy", "live", "all", "sp", condition="all")
    rows = [
        replace(base, note="sp_predictor_window", estimate=0.7),
        replace(base, note="sp_predictor_stream", estimate=0.8),
        replace(base, test="offline", condition="", note="sp_predictor_stream", estimate=0.85),
    ]
    assert accuracy_text.accuracy_finding(rows, PEOPLE) == (
        "With people, the predictors are right: sp_predictor_window with the SP agent 70.0 % of the time; "
        "sp_predictor_stream with the SP agent 80.0 % of the time, 5.0 points less than in the offline test."
    )
    assert accuracy_text.accuracy_sentence(rows, PEOPLE) == (
        "In the games with people the predictor correctly predicted 70.0 % of the SP agent’s actions (predictor: "
        "sp_predictor_window) and 80.0 % of the SP agent’s actions (predictor: sp_predictor_stream), mean of the three "
        "steps."
    )
    assert [line[0] for line in accuracy_text.accuracy_lines(rows, "sp", PEOPLE)] == [
        "With people, sp_predictor_window",
        "Offline test, sp_predictor_stream",
        "With people, sp_predictor_stream",
        "Difference",
    ]


def test_predictions_about_people_and_about_agents_are_not_one_number() -> None:
    base = Result("accuracy", "live", "all", "sp", condition="all", note="sp_predictor")
    rows = [
        replace(base, estimate=0.9),
        replace(base, agent="fcp", note="fcp_predictor", estimate=0.8),
        replace(base, agent="teammate", note="fcp_predictor", estimate=0.5),
        replace(base, test="offline", condition="", estimate=0.92),
        replace(base, test="offline", condition="", agent="fcp", note="fcp_predictor", estimate=0.88),
    ]
    assert accuracy_text.accuracy_finding(rows, PEOPLE, {"teammate"}) == (
        "In games with people, the predictor is right 85.0 % of the time about AI agents, 5.0 points less than in the "
        "offline test, and 50.0 % of the time about other people."
    )
    assert accuracy_text.accuracy_finding(rows[2:], PEOPLE, {"teammate"}) == (
        "The predictor is right 50.0 % of the time with people."
    )
    degraded = [replace(row, note=f"{row.note}@60") for row in rows[:3]]
    assert accuracy_text.accuracy_finding(degraded, PEOPLE, {"teammate"}) == (
        "Degraded on purpose to 60 %, the predictor is right 85.0 % of the time about AI agents and 50.0 % of the time "
        "about other people, in games with people."
    )
