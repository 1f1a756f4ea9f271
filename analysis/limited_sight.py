"""How often the partner was in view, where participants see only the cells around their chef."""

from collections.abc import Sequence

import polars as pl

from analysis.person_means import mean_over_people
from analysis.results import Result
from analysis.table_files import IN_SIGHT

MEASURE = "partner_in_view"


def rows(ticks: pl.DataFrame, episodes: pl.DataFrame, conditions: Sequence[str]) -> list[Result]:
    """Return the share of timesteps with the partner in view, as mean over people, by condition with limited sight."""
    if IN_SIGHT not in ticks.columns:
        return []
    in_sight = pl.col(IN_SIGHT).cast(pl.Boolean)
    limited = ticks.filter(in_sight.is_not_null())
    shares = limited.group_by("episode", maintain_order=True).agg(in_sight.mean().alias(MEASURE))
    table = shares.join(episodes.select("episode", "participant", "condition"), on="episode")
    return [
        mean_over_people(
            table.filter(pl.col("condition") == condition),
            MEASURE,
            Result("limited sight", MEASURE, condition=condition, note="share of time"),
        )
        for condition in conditions
        if condition in table["condition"]
    ]
