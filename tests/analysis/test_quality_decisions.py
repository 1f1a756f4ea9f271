"""Which episodes the report calls analysed, and the reasons that it names for the others."""

import re
from dataclasses import replace
from pathlib import Path

import polars as pl
import pytest

from analysis.quality_decisions import with_decisions
from analysis.report import write_analysed
from analysis.results import select
from analysis.study import Options, analyse
from analysis.tables import Export

QUICK = Options(power_studies=20, draws=200)


def test_the_first_reason_that_holds_is_named() -> None:
    quality = pl.DataFrame(
        {
            "episode": ["e1", "e2", "e3", "e4", "e5", "e6"],
            "participant": ["p1", "p1", "p1", "p2", "p3", "p4"],
            "unfinished": [False, True, False, False, False, False],
            "excluded": ["", "", "saw it", "", "", ""],
        }
    )
    participants = pl.DataFrame(
        {
            "participant": ["p1", "p2", "p3", "p4"],
            "status": ["completed", "completed", "timed_out", "elsewhere"],
            "excluded": ["", "asked a friend to play", "", ""],
        }
    )
    found = with_decisions(quality, participants, quality.head(1))
    assert found.columns == [*quality.columns, "decision"]
    assert found["decision"].to_list() == [
        "analysed",
        "out: not played to the end",
        "out: saw it",
        "out: participant excluded, asked a friend to play",
        "out: participant not seen for too long",
        "out: participant elsewhere",
    ]


@pytest.mark.usefixtures("no_pictures")
def test_episodes_of_people_who_left_or_were_excluded_are_not_called_analysed(planted: Export, tmp_path: Path) -> None:
    first, second = planted.participants["participant"].head(2)
    person = pl.col("participant")
    people = planted.participants.with_columns(
        status=pl.when(person == first).then(pl.lit("timed_out")).otherwise("status"),
        excluded=pl.when(person == second).then(pl.lit("asked a friend to play")).otherwise("excluded"),
    )
    analysis = analyse(replace(planted, participants=people), QUICK)
    report = write_analysed(analysis, tmp_path, QUICK)
    quality = pl.read_csv(report.quality)
    (counted,) = select(analysis.rows, section="exclusions", test="analysed", condition="all", unit="episodes")
    assert quality.filter(pl.col("decision") == "analysed").height == counted.n < quality.height
    quiet = quality.filter(pl.col("decision") == "analysed", pl.col("proposal") == "keep").height
    page = report.page.read_text(encoding="utf-8")
    assert f"{quiet} of {quality.height} episodes raise no question and were analysed." in page
    for name, reason in ((first, "not seen for too long"), (second, "excluded, asked a friend to play")):
        mine = quality.filter(pl.col("participant") == name, pl.col("decision") == f"out: participant {reason}")
        assert mine.height >= 8  # all but those that were excluded by themselves
        assert re.search(rf"{mine['episode'][0]}</td>.*out: participant {reason}</td>", page)
