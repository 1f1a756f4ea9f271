"""The mean of a measure over people, each with the mean of their episodes."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import polars as pl

from analysis.compare import mean_row
from analysis.results import Result


def mean_over_people(table: pl.DataFrame, measure: str, row: Result) -> Result:
    """Fill in the figures of `row`. `table`: a row an episode, with participant and the measure; null: not measured."""
    known = table.filter(pl.col(measure).is_not_null())
    of_people = known.group_by("participant", maintain_order=True).agg(pl.col(measure).mean())[measure].to_numpy()
    return replace(mean_row(row, of_people), unit="people")


def means_by_condition(
    table: pl.DataFrame, section: str, measures: Mapping[str, str], conditions: Sequence[str]
) -> list[Result]:
    """Return `mean_over_people` of each measure (name -> meaning) in each condition that the table has."""
    return [
        mean_over_people(
            table.filter(pl.col("condition") == condition),
            measure,
            Result(section, measure, condition=condition, note=meaning),
        )
        for condition in conditions
        if condition in table["condition"]
        for measure, meaning in measures.items()
    ]
