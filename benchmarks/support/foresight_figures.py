"""The cells of benchmarks/foresight.py, and the figures of a run: paired differences from no predictions."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.effects import mean_interval
from benchmarks.support.foresight_games import NONE, RANDOM, TOM, TRUE, VARIANTS, Cell

LAYOUTS = ("coordination_ring", "double_rings", "double_counters", "matrix", "clear_division")
POOLED = LAYOUTS[:4]
AGENTS = ("sp_strong", "fcp_strong")  # those that were expected to gain, before the first run
SENSITIVITY = tuple(name for name in VARIANTS if name not in ("all", "credulous"))
ACCURACIES = (1.0, 0.89, 0.77, 0.67, 0.57, 0.48, 0.38, 0.29)


def cells() -> Iterator[Cell]:
    """Yield all cells of the first seed, the most important ones first."""
    for kinds in ((NONE, RANDOM, TOM), (TRUE,)):
        yield from (Cell(layout, agent, shown) for layout in LAYOUTS for agent in AGENTS for shown in kinds)
    others = [
        *((TRUE, "all", right) for right in ACCURACIES[1:]),
        *((shown, "credulous", 1.0) for shown in (RANDOM, TOM)),
        *((shown, variant, 1.0) for variant in SENSITIVITY for shown in (NONE, TOM)),
    ]
    for shown, variant, right in others:
        yield from (Cell(layout, agent, shown, variant, right) for layout in POOLED for agent in AGENTS)


def difference(one: NDArray[np.float64], other: NDArray[np.float64]) -> dict[str, float]:
    """Return the mean paired difference with its 95 % interval."""
    mean = mean_interval(one - other)
    return {"mean": mean.value, "low": mean.low, "high": mean.high, "episodes": one.size}


class ForesightSummary:
    """The figures of all cells, and statistics of them."""

    def __init__(self, found: Mapping[str, Mapping[str, Sequence[float]]]) -> None:
        self._found = found

    def of(self, cell: Cell, figure: str = "points") -> NDArray[np.float64]:
        return np.array(self._found[cell.name][figure], np.float64)

    def has(self, shown: str, variant: str = "all", right: float = 1.0, layouts: Sequence[str] = POOLED) -> bool:
        """Return whether these cells were played."""
        names = [Cell(layout, agent, shown, variant, right).name for layout in layouts for agent in AGENTS]
        return all(name in self._found for name in names)

    def pooled(self, shown: str, variant: str = "all", right: float = 1.0, figure: str = "points") -> Any:
        """Return the mean over the first four kitchens and both agents, for each episode number: the same person."""
        every = [self.of(Cell(one, agent, shown, variant, right), figure) for one in POOLED for agent in AGENTS]
        return np.mean(every, 0)

    def pooled_difference(self, one: tuple[Any, ...], other: tuple[Any, ...]) -> dict[str, float]:
        return difference(self.pooled(*one), self.pooled(*other))

    def figures(self) -> dict[str, Any]:
        """Return everything that the document says, as plain data: of all cells that were played."""
        played_here = [name for name in (RANDOM, TOM, TRUE) if self.has(name)] if self.has(NONE) else []
        return {
            "missing": sum(cell.name not in self._found for cell in cells()),
            "main": [self._row(layout, agent) for layout in LAYOUTS for agent in AGENTS],
            "pooled": {shown: self.pooled_difference((shown,), (NONE,)) for shown in played_here},
            "accuracy": [
                {
                    "kept": right,
                    "measured": float(self.pooled(TRUE, "all", right, "accuracy").mean()),
                    "gain": self.pooled_difference((TRUE, "all", right), (NONE,)),
                }
                for right in ACCURACIES
                if self.has(TRUE, "all", right)
            ],
            "credulous": {
                shown: self.pooled_difference((shown, "credulous"), (NONE,))
                for shown in (RANDOM, TOM)
                if self.has(shown, "credulous")
            },
            "sensitivity": {
                variant: self.pooled_difference((TOM, variant), (NONE, variant))
                for variant in SENSITIVITY
                if self.has(TOM, variant) and self.has(NONE, variant)
            },
            "cells": {cell.name: self._means(cell) for cell in cells() if cell.name in self._found},
        }

    def _means(self, cell: Cell) -> dict[str, float]:
        """Return points and collisions of one cell, and accuracy if it has arrows."""
        figures = ("points", "collisions") if cell.shown == NONE else ("points", "collisions", "accuracy")
        return {figure: float(self.of(cell, figure).mean()) for figure in figures}

    def _row(self, layout: str, agent: str) -> dict[str, Any]:
        """Return the row of one kitchen with one agent."""
        row: dict[str, Any] = {"layout": layout, "agent": agent}
        played_here = [
            cell for kind in (NONE, RANDOM, TOM, TRUE) if (cell := Cell(layout, agent, kind)).name in self._found
        ]
        for cell in played_here:
            row[cell.shown] = self._means(cell)
            if cell.shown != NONE:
                row[cell.shown]["difference"] = difference(self.of(cell), self.of(Cell(layout, agent, NONE)))
        return row
