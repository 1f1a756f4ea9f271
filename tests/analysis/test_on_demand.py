"""How often marks on demand were looked at, computed by hand."""

import polars as pl
import pytest

from analysis import on_demand

EPISODES = pl.DataFrame(
    {
        "episode": ["e1", "e2", "e3"],
        "participant": ["p1", "p1", "p2"],
        "condition": ["hold", "hold", "always"],
        "tick_ms": [200, 200, 200],
    }
)


def ticks(episode: str, asked: list[bool | None], late: tuple[int, ...] = ()) -> pl.DataFrame:
    drawn = [6 if one is False or t in late else 2 for t, one in enumerate(asked)]
    columns = {"episode": [episode] * len(asked), "timestep": list(range(len(asked))), "displayed_1": drawn}
    return pl.DataFrame(columns).with_columns(asked=pl.Series(asked, dtype=pl.Boolean))


def test_share_of_time_and_uses_a_minute_of_each_condition() -> None:
    first = ticks("e1", [True, True, False, True, False, False, True, True, True, False], late=(1,))
    second = ticks("e2", [False] * 10)
    table = pl.concat([first, second, ticks("e3", [None] * 10)])
    share, uses = on_demand.rows(table, EPISODES, ["hold", "always"])
    assert (share.condition, share.test, share.n) == ("hold", "shown_share", 1)
    assert share.estimate == pytest.approx((5 / 10 + 0) / 2)  # one of six that were asked for was late
    assert uses.estimate == pytest.approx((3 / (10 * 0.2 / 60) + 0) / 2)


@pytest.mark.parametrize(("display", "share"), [("intention", 0.6), ("both", 0.8), ("actions", 0.7)])
def test_an_intention_counts_as_shown_like_an_action(display: str, share: float) -> None:
    """Nothing has to be drawn of what the condition does not draw."""
    intentions = [4, 0, 8, 8, 8, 3, 8, 3, 3, 3]
    actions = [2, 2, 2, 2, 6, 2, 6, 2, 2, 6]
    kinds = pl.Series([None] * 10 if display == "actions" else intentions, dtype=pl.Int16)
    table = ticks("e1", [True] * 10).with_columns(
        pl.Series("displayed_1", [6] * 10 if display == "intention" else actions), displayed_intention_kind=kinds
    )
    shown, _ = on_demand.rows(table, EPISODES, ["hold"])
    assert shown.estimate == pytest.approx(share)


def test_an_older_export_has_no_such_rows() -> None:
    table = ticks("e1", [True]).drop("asked")
    assert on_demand.rows(table, EPISODES, ["hold", "always"]) == []
