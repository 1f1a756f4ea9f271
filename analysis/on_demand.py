"""How much participants used marks that are shown on demand: the share of time, and uses per minute.

A use begins in a timestep in which the marks are asked for and were not in the timestep before.
"""

from collections.abc import Sequence

import polars as pl

from analysis.intentions import NOTHING_SHOWN
from analysis.person_means import means_by_condition
from analysis.results import Result
from analysis.table_files import ON_DEMAND

NOTHING_DRAWN = 6
INTENTION = "displayed_intention_kind"  # an older export lacks it; empty where the condition draws no intentions
MS_A_MINUTE = 60_000
MEASURES = {"shown_share": "share of time", "uses_per_minute": "uses a minute"}


def by_episode(ticks: pl.DataFrame, episodes: pl.DataFrame) -> pl.DataFrame:
    """Return one row per episode with marks on demand: episode, participant, condition, shown_share,
    uses_per_minute."""
    if not set(ON_DEMAND) <= set(ticks.columns):
        return pl.DataFrame(schema={"condition": pl.String})
    asked = pl.col("asked").cast(pl.Boolean)
    begins = asked & ~asked.shift(1).over("episode").fill_null(False)
    seen = ticks.filter(asked.is_not_null()).sort("episode", "timestep").with_columns(begins=begins)
    found = seen.group_by("episode", maintain_order=True).agg(
        shown_share=_is_shown(ticks.columns).mean(),
        uses=pl.col("begins").sum(),
        timesteps=pl.len(),
    )
    minutes = pl.col("timesteps") * pl.col("tick_ms") / MS_A_MINUTE
    known = episodes.select("episode", "participant", "condition", "tick_ms")
    return found.join(known, on="episode").with_columns(uses_per_minute=pl.col("uses") / minutes)


def _is_shown(columns: Sequence[str]) -> pl.Expr:
    """Return true where an action or an intention is drawn."""
    action = pl.col("displayed_1") != NOTHING_DRAWN
    if INTENTION not in columns:
        return action
    return action.fill_null(False) | (pl.col(INTENTION) != NOTHING_SHOWN).fill_null(False)


def rows(ticks: pl.DataFrame, episodes: pl.DataFrame, conditions: Sequence[str]) -> list[Result]:
    """Return the mean of each measure over people, each with the mean of their episodes, by condition with marks on
    demand."""
    table = by_episode(ticks, episodes)
    return means_by_condition(table, "on demand", MEASURES, conditions)
