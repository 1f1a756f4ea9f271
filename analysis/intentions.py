"""How often predicted intentions, and those shown to participants, were right.

Timesteps count in which the watched chef used a station within the predictor's horizon. An intention is right if it
names what the chef did and the station.
"""

from collections.abc import Sequence

import polars as pl

from analysis.person_means import means_by_condition
from analysis.results import Result
from analysis.table_files import INTENTIONS

NOTHING_SHOWN = 8
PLACE = ("kind", "x", "y")
MEASURES = {"predicted": "likeliest intention", "shown": "intention that was drawn"}


def by_episode(ticks: pl.DataFrame, episodes: pl.DataFrame) -> pl.DataFrame:
    """Return one row per episode with intentions: episode, participant, condition, predicted, shown (null: none was
    drawn)."""
    if not set(INTENTIONS) <= set(ticks.columns):
        return pl.DataFrame(schema={"condition": pl.String})
    came = ticks.filter(pl.col("interaction_kind") > 0, pl.col("intention_1_kind").is_not_null())
    is_shown = pl.col("displayed_intention_kind") != NOTHING_SHOWN
    shares = came.group_by("episode", maintain_order=True).agg(
        predicted=_is_right("intention_1").mean(),
        shown=_is_right("displayed_intention").filter(is_shown).mean(),
    )
    return shares.join(episodes.select("episode", "participant", "condition"), on="episode")


def _is_right(name: str) -> pl.Expr:
    return pl.all_horizontal(pl.col(f"{name}_{part}") == pl.col(f"interaction_{part}") for part in PLACE)


def rows(ticks: pl.DataFrame, episodes: pl.DataFrame, conditions: Sequence[str]) -> list[Result]:
    """Return the mean of each share over people, each with the mean of their episodes, by condition."""
    table = by_episode(ticks, episodes)
    return means_by_condition(table, "intentions", MEASURES, conditions)
