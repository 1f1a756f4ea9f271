"""How often predicted and shown intentions came, computed by hand."""

import polars as pl
import pytest

from analysis import intentions
from analysis.table_files import INTENTIONS

EPISODES = pl.DataFrame({"episode": ["e1", "e2"], "participant": ["p1", "p2"], "condition": ["icon", "off"]})
POT, CRATE, NOTHING, HIDDEN = (4, 2, 0), (1, 0, 1), (0, -1, -1), (8, -1, -1)
UNKNOWN = (None, None, None)


def ticks(episode: str, rows: list[tuple[tuple[int | None, ...], ...]]) -> pl.DataFrame:
    """Rows of what was predicted, shown and done."""
    values = [(episode, t, *predicted, *shown, *done) for t, (predicted, shown, done) in enumerate(rows)]
    return pl.DataFrame(values, schema=["episode", "timestep", *INTENTIONS], orient="row", infer_schema_length=None)


def test_an_intention_is_right_with_its_kind_and_station_where_something_was_done() -> None:
    of_icon = [(POT, CRATE, POT), (POT, POT, POT), (CRATE, HIDDEN, POT), (NOTHING, NOTHING, POT)]
    of_icon += [(POT, POT, NOTHING), (POT, POT, UNKNOWN)]  # nothing was done, or nobody knows
    table = pl.concat([ticks("e1", of_icon), ticks("e2", [(POT, UNKNOWN, POT)])], how="vertical_relaxed")
    predicted, shown, off, off_shown = intentions.rows(table, EPISODES, ["icon", "off"])
    assert (predicted.condition, predicted.n, predicted.estimate) == ("icon", 1, pytest.approx(2 / 4))
    assert shown.estimate == pytest.approx(1 / 3)
    assert (off.condition, off.estimate, off_shown.n) == ("off", 1, 0)


def test_an_older_export_has_no_such_rows() -> None:
    table = ticks("e1", [(POT, POT, POT)]).drop("interaction_kind")
    assert intentions.rows(table, EPISODES, ["icon"]) == []
