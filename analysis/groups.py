"""Values of a measure by condition, layout and agent, over episodes or over people, for the tests to compare."""

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations, product

import numpy as np
import polars as pl
from numpy.typing import NDArray

from analysis.results import Result

Values = NDArray[np.float64]
ALL = "all"  # a layout or agent: any of them
DECIMALS = 9  # of means: values that differ by floating-point rounding alone are tied in rank tests


class Groups:
    """The values of a measure by place (layout, or another column), agent and condition. Build it once for a table:
    filtering is slow."""

    def __init__(self, table: pl.DataFrame, measure: str, place: str = "layout") -> None:
        chosen = table.select(place, "agent", "condition", measure).drop_nulls(measure)
        parts = chosen.partition_by(place, "agent", "condition", as_dict=True, maintain_order=True)
        self._parts = {key: part[measure].to_numpy().astype(np.float64) for key, part in parts.items()}

    def at(self, place: str, agent: str, conditions: Sequence[str]) -> dict[str, Values]:
        """Return the values of each condition at a place with an agent."""
        found: dict[str, list[Values]] = {name: [] for name in conditions}
        for (where, partner, condition), values in self._parts.items():
            if condition in found and place in (where, ALL) and agent in (partner, ALL):
                found[condition].append(values)
        return {name: np.concatenate(parts) if parts else np.empty(0) for name, parts in found.items()}


def person_means(table: pl.DataFrame, measure: str, *apart: str) -> pl.DataFrame:
    """Return one row per person with the mean of the measure, for each value of the columns `apart`; `layout` and
    `agent` say "all" where they are averaged over."""
    keys = ["participant", "condition", *apart]
    means = table.group_by(keys, maintain_order=True).agg(pl.col(measure).mean().round(DECIMALS))
    return means.with_columns(pl.lit(ALL).alias(name) for name in ("layout", "agent") if name not in apart)


class PeopleGroups:
    """As Groups, but with one value a person: the mean of the person's episodes at a place."""

    def __init__(self, episodes: pl.DataFrame, measure: str) -> None:
        self._tables: dict[tuple[str, ...], Groups] = {}
        self._episodes, self._measure = episodes, measure

    def at(self, layout: str, agent: str, conditions: Sequence[str]) -> dict[str, Values]:
        """Return the people's means in each condition at a layout ("all": over them) with an agent ("all": over
        them)."""
        apart = tuple(name for name, value in (("layout", layout), ("agent", agent)) if value != ALL)
        if apart not in self._tables:
            self._tables[apart] = Groups(person_means(self._episodes, self._measure, *apart), self._measure)
        return self._tables[apart].at(layout, agent, conditions)


def cells(layouts: Sequence[str], agents: Sequence[str]) -> list[tuple[str, str]]:
    """Return (layout, agent) pairs in reporting order, agents outermost."""
    return [(layout, agent) for agent, layout in product(agents, layouts)]


def _in_direction(conditions: Sequence[str]) -> list[str]:
    """Return the conditions so that a difference is later minus earlier: `none`, which all are compared with, first,
    `tom`, which is compared with all, last, and the others as the study lists them."""
    return sorted(conditions, key=lambda name: (name != "none", name == "tom"))


def main_contrast(conditions: Sequence[str]) -> tuple[str, str] | None:
    """Return the main contrast: ToM against none, in whatever order the study lists them; in other designs the last
    condition against `none`, or without it against the first; None with a single condition."""
    ordered = _in_direction(conditions)
    return (ordered[-1], ordered[0]) if len(ordered) > 1 else None


def pairs(conditions: Sequence[str]) -> list[tuple[str, str]]:
    """Return the comparisons of conditions: tom - none, tom - random, random - none. The main contrast is one of them,
    in its direction, so that tests and sentences find it in every study."""
    found = [(second, first) for first, second in combinations(_in_direction(conditions), 2)]
    return sorted(found, key=lambda pair: pair[0] != "tom")


def computed(test: Callable[..., Result], base: Result, *values: object) -> Result:
    """Return `test(base, *values)`; where that cannot be computed, `base` with the reason as its note."""
    try:
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the row's note gives the reason
            row = test(base, *values)
    except (ValueError, ArithmeticError, np.linalg.LinAlgError, RuntimeError) as error:
        return replace(base, note=f"could not be computed: {error or type(error).__name__}")
    if row.statistic_name and not (math.isfinite(row.statistic) and math.isfinite(row.p)):
        return replace(base, note="could not be computed: the values hardly vary")
    return row
