"""Rounds of two people: each counts once, for the person who is not watched, and the answers are not mixed up."""

from pathlib import Path

import polars as pl
import pytest

from analysis import apa_text, exclusions, measures
from analysis.report import Report, write_report
from analysis.results import Result, select
from analysis.sensitivity import ATTRITION
from analysis.study import Options
from analysis.synthetic import Truth, write_export
from analysis.tables import PERSON, read_export

QUICK = Options(power_studies=20, draws=50)
RING, MATRIX = "coordination_ring", "matrix"
pytestmark = pytest.mark.usefixtures("no_pictures")


def pairs_export(folder: Path, layouts: tuple[str, ...], alone: int = 0, named: str | None = None) -> Path:
    """Ten pairs of two conditions. The person who sees the marks (p00000 and so on) answers 7; the watched one, whose
    name has a w in front, answers 1. The first `alone` people have an agent instead. `named`: agent_name of pairs."""
    truth = Truth(participants=5, conditions=("none", "tom"), layouts=layouts, agents=("fcp",), timesteps=20, broken=0)
    write_export(truth, folder)
    tables = {path.stem: pl.read_parquet(path) for path in folder.glob("*.parquet")}
    people = tables["participants"]
    watched = pl.concat_str(pl.lit("w"), pl.col("participant_0"))
    paired = pl.col("participant_0") >= f"p{alone:05d}"
    episodes = tables["episodes"].with_columns(
        participant_1=pl.when(paired).then(watched),
        agent_1=pl.when(~paired).then(pl.col("agent_1")),
        agent_name=pl.when(paired).then(pl.lit(named, pl.String)).otherwise(pl.lit("fcp")),
    )
    partners = people[alone:].with_columns(participant=pl.concat_str(pl.lit("w"), "participant"))
    answers = tables["answers"].with_columns(value=pl.lit("7"))
    theirs = answers.join(episodes.select("episode", "participant_1"), on="episode").drop_nulls("participant_1")
    theirs = theirs.select(participant="participant_1", episode="episode", question="question").with_columns(
        value=pl.lit("1"), value_type=pl.lit("number")
    )
    pl.concat([people, partners]).write_parquet(folder / "participants.parquet")
    episodes.write_parquet(folder / "episodes.parquet")
    pl.concat([theirs, answers], how="diagonal").write_parquet(folder / "answers.parquet")
    return folder


def reported(folder: Path, tmp_path: Path) -> Report:
    return write_report(folder, tmp_path / "report", QUICK)


def people_in(rows: tuple[Result, ...], test: str) -> dict[str, int]:
    return {row.condition: row.n for row in select(rows, section="exclusions", test=test, unit="people")}


@pytest.mark.parametrize("alone", [0, 1])
def test_rounds_of_two_people_are_reported_on_several_layouts(alone: int, tmp_path: Path) -> None:
    made = reported(pairs_export(tmp_path / "data", (RING, MATRIX), alone), tmp_path)
    assert made.analysis.agents == (("fcp", PERSON) if alone else (PERSON,))
    assert made.analysis.episodes.height == 20
    found = [row for row in made.analysis.rows if row.test == "kruskal_wallis" and row.agent == PERSON]
    assert [row.n for row in found] == [20 - 2 * alone]
    page = made.page.read_text("utf-8")
    assert "with the other person" in page
    assert "the person agent" not in page


def test_the_headline_tells_predictions_about_people_from_those_about_agents(tmp_path: Path) -> None:
    analysis = reported(pairs_export(tmp_path / "data", (RING,), alone=2), tmp_path).analysis
    finding = apa_text.findings(analysis)[-1]
    assert "of the time about AI agents" in finding
    assert "of the time about other " in finding


def test_the_reason_for_no_comparison_is_that_of_the_pairs_and_not_of_the_agent_that_stood_in(tmp_path: Path) -> None:
    folder = pairs_export(tmp_path / "data", (RING,), alone=1)
    episodes = pl.read_parquet(folder / "episodes.parquet").with_columns(score=pl.lit(40.0), progress=pl.lit(0.0))
    episodes.write_parquet(folder / "episodes.parquet")
    finding = apa_text.findings(reported(folder, tmp_path).analysis)[0]
    assert finding == "The conditions could not be compared by reward: no variance within the conditions."


def test_a_partner_has_the_name_that_the_study_gives_them(tmp_path: Path) -> None:
    export = read_export(pairs_export(tmp_path / "data", (RING,), named="teammate"))
    assert export.agents == ("teammate",)


def test_watched_people_are_in_the_flow_with_a_reason_and_are_not_lost(tmp_path: Path) -> None:
    made = reported(pairs_export(tmp_path / "data", (RING,), alone=2), tmp_path)
    rows = made.analysis.rows
    assert people_in(rows, "assigned") == {"none": 9, "tom": 9, "all": 18}
    assert people_in(rows, "watched") == {"none": 4, "tom": 4, "all": 8}
    assert people_in(rows, "analysed") == {"none": 5, "tom": 5, "all": 10}
    lost = select(rows, section=ATTRITION, test="not_analysed")
    assert [(row.condition, row.n, row.estimate) for row in lost] == [("none", 9, 0.0), ("tom", 9, 0.0)]
    page = made.page.read_text("utf-8")
    assert exclusions.WATCHED in page
    assert "Each round of two people counts once, for the person who was not watched; eight " in page


def test_the_watched_person_of_somebody_who_left_is_not_analysed_but_has_a_reason(tmp_path: Path) -> None:
    folder = pairs_export(tmp_path / "data", (RING,))
    people = pl.read_parquet(folder / "participants.parquet")
    left = pl.when(pl.col("participant") == "p00000").then(pl.lit("timed_out")).otherwise(pl.col("status"))
    people.with_columns(status=left).write_parquet(folder / "participants.parquet")
    rows = reported(folder, tmp_path).analysis.rows
    out = sum(people_in(rows, step)["all"] for step in ("left", "watched", "analysed"))
    assert out == people_in(rows, "assigned")["all"] == 20
    lost = {row.condition: row.estimate for row in select(rows, section=ATTRITION, test="not_analysed")}
    assert lost == {"none": 0.2, "tom": 0.0}, "the pair, two of ten"


def test_somebody_who_was_watched_and_then_continued_with_an_agent_counts_for_their_own_rounds(tmp_path: Path) -> None:
    folder = pairs_export(tmp_path / "data", (RING, MATRIX))
    episodes = pl.read_parquet(folder / "episodes.parquet")
    last = (pl.col("number") == 2) & (pl.col("participant_0") == "p00000")
    alone = episodes.filter(last).with_columns(
        episode=pl.lit("own"),
        participant_0=pl.col("participant_1"),
        participant_1=pl.lit(None, pl.String),
        agent_1=pl.lit("fcp"),
    )
    pl.concat([episodes, alone]).write_parquet(folder / "episodes.parquet")
    made = reported(folder, tmp_path)
    rows = made.analysis.rows
    assert people_in(rows, "analysed")["all"] == 11
    assert people_in(rows, "watched")["all"] == 9
    assert made.analysis.episodes.filter(participant="wp00000")["episode"].to_list() == ["own"]


def test_an_answer_belongs_to_the_person_who_gave_it(tmp_path: Path) -> None:
    folder = pairs_export(tmp_path / "data", (RING,))
    export = read_export(folder)
    assert set(export.answers["value"]) == {7.0}
    assert set(export.answers["participant"]) == set(export.episodes["participant"])
    means = select(reported(folder, tmp_path).analysis.rows, section="questionnaire", test="mean")
    assert means
    assert {(row.estimate, row.n) for row in means} == {(7.0, 5)}


def test_answers_about_the_study_are_kept_for_both(tmp_path: Path) -> None:
    folder = pairs_export(tmp_path / "data", (RING,))
    answers = pl.read_parquet(folder / "answers.parquet")
    end = answers.unique("participant").with_columns(episode=pl.lit(None, pl.String))
    pl.concat([answers, end]).write_parquet(folder / "answers.parquet")
    export = read_export(folder)
    assert export.all_answers.filter(pl.col("episode").is_null()).height == 20
    assert export.all_answers.filter(pl.col("episode").is_not_null()).height == export.answers.height


def test_an_episode_of_two_people_has_one_row_in_the_quality_table(tmp_path: Path) -> None:
    made = reported(pairs_export(tmp_path / "data", (RING,)), tmp_path)
    assert made.analysis.quality.height == 10
    assert made.analysis.quality["episode"].n_unique() == 10


@pytest.mark.parametrize("kind", ["parquet", "csv"])
def test_only_the_absence_of_the_person_for_whom_a_round_counts_is_hidden_time(kind: str, tmp_path: Path) -> None:
    """The watched person has seat 1. A pause of an earlier version has no seat: it counts, as nobody knows whose it
    was."""
    folder = pairs_export(tmp_path / "data", (RING,))
    first, second, third = pl.read_parquet(folder / "episodes.parquet")["episode"][:3]
    rows = [(first, "hidden", 30_000.0, 1), (second, "blur", 30_000.0, 0), (third, "hidden", 30_000.0, None)]
    pauses = pl.DataFrame(rows, schema=["episode", "reason", "duration_ms", "seat"], orient="row")
    for old in folder.glob("*pauses*"):
        old.unlink()
    getattr(pauses, f"write_{kind}")(folder / f"pauses.{kind}")
    found = measures.episode_measures(read_export(folder))
    shares = dict(found.select("episode", "hidden_share").iter_rows())
    assert shares[first] == 0
    assert shares[second] == shares[third] == pytest.approx(30 / 34)
