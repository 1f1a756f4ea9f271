"""From assignment to analysis: everybody is somewhere, and excluded people are in no analysed round."""

from dataclasses import replace
from pathlib import Path

import polars as pl
import pytest

from analysis import exclusions, measures
from analysis.quality_decisions import PARTNER_EXCLUDED
from analysis.report import write_report
from analysis.results import select
from analysis.study import Options
from analysis.tables import Export, read_export
from tests.analysis.test_two_people import pairs_export

QUICK = Options(power_studies=20, draws=50)
pytestmark = pytest.mark.usefixtures("no_pictures")


def counted(export: Export) -> dict[tuple[str, str], int]:
    every = measures.episode_measures(export)
    rows = exclusions.flow(export, every, measures.analysed(every, export.participants))
    return {(row.test, row.unit): row.n for row in rows if row.condition == "all"}


def test_people_who_finished_without_an_analysed_episode_are_in_the_flow(planted_folder: Path, tmp_path: Path) -> None:
    """All rounds of one were removed, one has no round at all."""
    for path in planted_folder.glob("*.parquet"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    episodes = pl.read_parquet(tmp_path / "episodes.parquet")
    removed, gone = episodes["participant_0"].unique(maintain_order=True)[:2]
    reason = pl.when(pl.col("participant_0") == removed).then(pl.lit("a glitch")).otherwise(pl.col("excluded"))
    episodes.filter(pl.col("participant_0") != gone).with_columns(excluded=reason).write_parquet(
        tmp_path / "episodes.parquet"
    )
    found = counted(read_export(tmp_path))
    assert found["no_episode", "people"] == 2
    steps = ("left", "excluded", "watched", "no_episode", "analysed")
    assert sum(found.get((step, "people"), 0) for step in steps) == found["assigned", "people"]
    made = write_report(tmp_path, tmp_path / "report", QUICK)
    assert exclusions.NO_EPISODE in made.page.read_text("utf-8")


def test_a_round_with_an_excluded_person_is_not_analysed_whoever_was_watched(tmp_path: Path) -> None:
    """All data of the watched person of one pair are excluded: the round of the other person is among them."""
    folder = pairs_export(tmp_path / "data", ("coordination_ring",))
    people = pl.read_parquet(folder / "participants.parquet")
    reason = pl.when(pl.col("participant") == "wp00000").then(pl.lit("cheated")).otherwise(pl.lit(""))
    people.with_columns(excluded=reason).write_parquet(folder / "participants.parquet")
    made = write_report(folder, tmp_path / "report", QUICK)
    analysis = made.analysis
    assert "p00000" not in analysis.episodes["participant"].to_list()
    found = counted(analysis.export)
    assert (found["excluded", "people"], found["no_episode", "people"], found["analysed", "people"]) == (1, 1, 9)
    assert (found["played", "episodes"], found["of_excluded", "episodes"], found["analysed", "episodes"]) == (10, 1, 9)
    decided = pl.read_csv(made.quality).filter(participant="p00000")
    assert decided["decision"].to_list() == [f"out: {PARTNER_EXCLUDED}"]
    assert "Of 10 episodes begun, one was left out: of simulated participants whom the researcher excluded" in (
        made.page.read_text("utf-8")
    )
    assert select(analysis.rows, section="sensitivity", test="assigned")[0].n == 10, "exclusions undone"


def test_a_condition_from_which_everybody_withdrew_is_in_the_flow_and_in_the_attrition(
    planted_folder: Path, tmp_path: Path
) -> None:
    for path in planted_folder.glob("*.parquet"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    people = pl.read_parquet(tmp_path / "participants.parquet")
    left = people.filter(pl.col("condition") == "random")
    people.filter(pl.col("condition") != "random").write_parquet(tmp_path / "participants.parquet")
    left.select("study", "condition", simulated=True).write_parquet(tmp_path / "withdrawals.parquet")
    made = write_report(tmp_path, tmp_path / "report", QUICK)
    assert made.analysis.conditions == ("none", "tom")
    rows = select(made.analysis.rows, section="exclusions", test="assigned")
    assert {row.condition: row.n for row in rows} == {"none": 16, "random": 16, "tom": 16, "all": 48}
    lost = select(made.analysis.rows, section="attrition", test="left")
    assert [(row.condition, row.estimate) for row in lost] == [("none", 0.0), ("random", 1.0), ("tom", 0.0)]
    (test,) = select(made.analysis.rows, section="attrition", test="left_by_condition")
    assert test.p < 0.001
    assert "16 of 16 with random predictions" in made.page.read_text("utf-8")


def test_nobody_without_a_partner_is_said_to_have_returned_the_study(planted: Export) -> None:
    """The status is called so, and participants cannot get it by an action of their own."""
    first = pl.int_range(pl.len()) == 0
    status = pl.when(first).then(pl.lit("returned")).otherwise(pl.col("status").cast(pl.String))
    export = replace(planted, participants=planted.participants.with_columns(status=status))
    every = measures.episode_measures(export)
    rows = exclusions.flow(export, every, measures.analysed(every, export.participants))
    (left,) = select(rows, test="left", condition="all")
    assert (left.n, left.note) == (1, "left without a partner, or was released by the researcher")
