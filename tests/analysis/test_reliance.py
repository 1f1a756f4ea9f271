"""Shares of waiting, avoiding and following, computed by hand."""

import polars as pl
import pytest

from analysis import reliance

EPISODES = pl.DataFrame({"episode": ["a", "b", "c"], "participant": ["p1", "p1", "p2"], "condition": ["wrong"] * 3})


def test_shares_of_people_by_phase() -> None:
    table = pl.DataFrame(
        {
            "episode": ["a", "b", "b", "c"],
            "phase": ["before", "before", "after", "after"],
            "near": [10, 30, 20, 10],
            "waited": [5, 5, 15, 1],
            "avoided": [5, 5, 0, 2],
            "followed": [0, 10, 5, 7],
        }
    )
    rows = reliance.rows(table, EPISODES, ["right", "wrong"])
    found = {(row.note, row.test): (row.estimate, row.n) for row in rows}
    assert found["before", "waited"] == (pytest.approx(10 / 40), 1)
    assert found["before", "followed"] == (pytest.approx(10 / 40), 1)
    assert found["after", "waited"] == (pytest.approx((15 / 20 + 1 / 10) / 2), 2)
    assert found["after", "avoided"] == (pytest.approx((0 + 2 / 10) / 2), 2)
    assert len(rows) == 6


def test_a_study_that_does_not_mislead_has_no_rows() -> None:
    assert reliance.rows(pl.DataFrame(), EPISODES, ["wrong"]) == []
