"""The mean of a measure over people, each with the mean of their episodes."""

import polars as pl

from analysis import effects
from analysis.results import Result


def mean_over_people(section: str, table: pl.DataFrame, condition: str, measure: str, note: str) -> Result:
    """The row of one condition. `table`: a row an episode, with participant, condition and the measure."""
    chosen = table.filter((pl.col("condition") == condition) & pl.col(measure).is_not_null())
    of_people = chosen.group_by("participant", maintain_order=True).agg(pl.col(measure).mean())[measure].to_numpy()
    mean = effects.mean_interval(of_people)
    return Result(
        section,
        measure,
        condition=condition,
        estimate=mean.value,
        estimate_low=mean.low,
        estimate_high=mean.high,
        se=effects.standard_error(of_people),
        n=of_people.size,
        unit="people",
        ci_level=mean.level,
        note=note,
    )
