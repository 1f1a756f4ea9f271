"""How people respond to marked cells next to them, before and after the first wrong mark: wait, avoid, follow."""

from collections.abc import Sequence

import polars as pl

from analysis.person_means import mean_over_people
from analysis.results import Result

PHASES = ("before", "after")
RESPONSES = ("waited", "avoided", "followed")


def rows(reliance: pl.DataFrame, episodes: pl.DataFrame, conditions: Sequence[str]) -> list[Result]:
    """Return the share of each response in the timesteps next to shown cells, as mean over people; `note` is the
    phase."""
    if reliance.is_empty():
        return []
    people = reliance.join(episodes.select("episode", "participant", "condition"), on="episode")
    counts = [pl.col(name).cast(pl.Float64).sum() for name in ("near", *RESPONSES)]
    people = people.group_by("participant", "condition", "phase", maintain_order=True).agg(counts)
    shares = people.with_columns(pl.col(name) / pl.col("near") for name in RESPONSES)
    found = []
    for condition in conditions:
        for phase in PHASES:
            chosen = shares.filter(pl.col("phase") == phase)
            if condition in chosen["condition"]:
                mine = chosen.filter(pl.col("condition") == condition)
                rows_of_phase = {name: Result("reliance", name, condition=condition, note=phase) for name in RESPONSES}
                found += [mean_over_people(mine, name, row) for name, row in rows_of_phase.items()]
    return found
