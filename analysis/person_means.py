"""The mean of a measure over people, each with the mean of their episodes."""

from dataclasses import replace

import polars as pl

from analysis import effects
from analysis.results import Result


def mean_over_people(table: pl.DataFrame, measure: str, row: Result) -> Result:
    """Fill in the figures of `row`. `table`: a row an episode, with participant and the measure; null: not measured."""
    known = table.filter(pl.col(measure).is_not_null())
    of_people = known.group_by("participant", maintain_order=True).agg(pl.col(measure).mean())[measure].to_numpy()
    mean = effects.mean_interval(of_people)
    return replace(
        row,
        estimate=mean.value,
        estimate_low=mean.low,
        estimate_high=mean.high,
        se=effects.standard_error(of_people),
        n=of_people.size,
        unit="people",
        ci_level=mean.level,
    )
