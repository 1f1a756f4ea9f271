"""Quality proposals for episodes, and the way from participants assigned to episodes analysed."""

from dataclasses import replace

import polars as pl
import pytest

from analysis import data_quality, exclusions, measures
from analysis.results import select
from analysis.tables import Export

CLEAN: dict[str, object] = {
    "episode": "e",
    "participant": "p",
    "condition": "tom",
    "layout": "matrix",
    "agent": "sp",
    "number": 1,
    "status": "done",
    "excluded": "",
    "idle_share": 0.2,
    "longest_idle_s": 3.0,
    "interactions": 40,
    "pushing_share": 0.0,
    "hidden_share": 0.0,
    "lag_ms": 12.0,
    "late_share": 0.0,
    "display_share": 0.0,
}
NO_ANSWERS = pl.DataFrame(
    schema={"participant": pl.String, "episode": pl.String, "question": pl.String, "value": pl.Float64}
)


def proposed(**measured: object) -> tuple[str, str]:
    row = data_quality.proposals(pl.DataFrame([CLEAN | measured]), NO_ANSWERS).row(0, named=True)
    return row["proposal"], row["rules"]


def test_an_ordinary_episode_is_kept() -> None:
    assert proposed() == ("keep", "")


@pytest.mark.parametrize(
    ("measured", "proposal", "rule"),
    [
        ({"status": "aborted"}, "drop", "unfinished"),
        ({"idle_share": 0.6}, "look", "idle"),
        ({"idle_share": 0.95}, "drop", "idle"),
        ({"longest_idle_s": 25.0}, "look", "absent"),
        ({"longest_idle_s": 60.0}, "drop", "absent"),
        ({"interactions": 4}, "look", "no interaction"),
        ({"interactions": 0}, "drop", "no interaction"),
        ({"pushing_share": 0.2}, "look", "stuck"),
        ({"hidden_share": 0.3}, "drop", "hidden"),
        ({"lag_ms": 5000.0}, "look", "lag"),
        ({"late_share": 0.02}, "look", "late"),
        ({"attention_failed": 1}, "look", "inattentive"),
        ({"attention_failed": 2}, "drop", "inattentive"),
        ({"display_share": 0.0025}, "look", "display"),
        ({"display_share": 0.1}, "drop", "display"),
    ],
)
def test_each_rule_proposes_by_its_bounds_and_is_named(measured: dict[str, object], proposal: str, rule: str) -> None:
    assert proposed(**measured) == (proposal, rule)


def test_reasons_to_drop_come_first_and_all_are_named() -> None:
    assert proposed(idle_share=0.7, hidden_share=0.5) == ("drop", "hidden, idle")


def test_missing_measures_do_not_exclude_an_episode() -> None:
    assert proposed(lag_ms=None, idle_share=None, interactions=None) == ("keep", "")


def test_the_same_answer_everywhere_counts_after_three_episodes() -> None:
    def page(person: str, episode: str, values: list[int]) -> list[tuple[str, str, str, float]]:
        return [(person, episode, f"q{index}", float(value)) for index, value in enumerate(values)]

    rows = [answer for number in range(3) for answer in page("a", f"a{number}", [4, 4, 4])]
    rows += page("a", "a3", [4, 5, 4]) + page("b", "b0", [7, 7, 7]) + page("c", "c0", [1])
    answers = pl.DataFrame(rows, schema=NO_ANSWERS.schema, orient="row")
    found = dict(data_quality.straight_lined(answers).rows())
    assert found == {"a0": True, "a1": True, "a2": True, "a3": False, "b0": False, "c0": False}


def test_a_clean_study_is_kept_and_every_episode_has_a_proposal(planted: Export) -> None:
    found = data_quality.proposals(measures.episode_measures(planted), planted.answers)
    assert found.height == planted.episodes.height
    assert "drop" not in found["proposal"]


def test_the_flow_adds_up_from_assignment_to_analysis(planted: Export) -> None:
    people = planted.participants.with_row_index().with_columns(
        status=pl.when(pl.col("index") < 2).then(pl.lit("timed_out")).otherwise(pl.col("status")),
        excluded=pl.when(pl.col("index") == 5).then(pl.lit("helped by a friend")).otherwise(pl.col("excluded")),
    )
    gone = pl.DataFrame({"study": ["simulated"], "condition": ["tom"]})
    export = replace(planted, participants=people, withdrawals=gone)
    episodes = measures.episode_measures(export)
    rows = exclusions.flow(export, episodes, measures.analysed(episodes, people))
    counts = {(row.unit, row.test, row.note): row.n for row in select(rows, condition="all")}
    assert counts[("people", "assigned", "")] == 49
    assert counts[("people", "left", exclusions.WITHDRAWN)] == 1
    assert counts[("people", "left", "not seen for too long")] == 2
    assert counts[("people", "excluded", "helped by a friend")] == 1
    assert counts[("people", "analysed", "")] == 45
    out = sum(row.n for row in select(rows, condition="all", unit="people") if row.test in ("left", "excluded"))
    assert counts[("people", "assigned", "")] - out == counts[("people", "analysed", "")]
    steps = ("unfinished", "removed", "of_incomplete", "of_excluded")
    out = sum(row.n for row in select(rows, condition="all", unit="episodes") if row.test in steps)
    assert counts[("episodes", "played", "")] - out == counts[("episodes", "analysed", "")]
    for condition in (*export.conditions, "all"):
        assert select(rows, test="assigned", condition=condition)[0].n in (16, 17, 49)
