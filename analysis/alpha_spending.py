"""Boundaries of declared interim looks: spending functions of Lan and DeMets (1983), by recursive integration.

The sum of the data behaves like Brownian motion at the information of each look (here: people). The density of the
paths that have crossed no boundary is carried from look to look on a grid (Armitage, McPherson and Rowe 1969).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy import optimize, special, stats

from analysis.mixed_model_fit import Array

SPENDING = ("obrien_fleming", "pocock")
NODES = 400  # of the grid
FARTHEST = 8.0  # standard deviations beyond which a boundary is not computed


@dataclass(frozen=True)
class Look:
    """The look of a study among its declared looks."""

    number: int  # from 1
    of: int
    people: int  # analysed in both conditions
    planned: int  # at the last look
    boundary: float  # of z; two-sided: of its absolute value
    nominal_alpha: float  # the same as a level for p


def spent(kind: str, alpha: float, time: float) -> float:
    """Return how much of a one-sided alpha may be used up to a time (share of the planned people, 0 to 1)."""
    if time <= 0:
        return 0.0
    time = min(time, 1.0)
    if kind == "pocock":
        return alpha * math.log(1 + (math.e - 1) * time)
    return float(2 * stats.norm.sf(stats.norm.isf(alpha / 2) / math.sqrt(time)))


def boundaries(information: Sequence[float], spending: Sequence[float], two_sided: bool) -> list[float]:
    """Return the boundary of z at each look. `spending`: what may be spent up to each look, of one side; two-sided
    boundaries are symmetric and each side spends as much."""
    found: list[float] = []
    grid, mass = np.zeros(1), np.ones(1)  # before the first look the sum is 0
    sides, before, last = (2 if two_sided else 1), 0.0, 0.0
    for now, total in zip(information, spending, strict=True):
        step = math.sqrt(now - before)
        cut = _cut(grid, mass, step, sides * (total - last), two_sided, FARTHEST * math.sqrt(now))
        found.append(cut / math.sqrt(now))
        low = -cut if two_sided else -FARTHEST * math.sqrt(now)
        places, weights = _nodes()
        half = (cut - low) / 2
        target = low + half * (places + 1)
        density = (stats.norm.pdf((target[:, None] - grid) / step) / step) @ mass
        grid, mass = target, half * weights * density
        before, last = now, total
    return found


@cache
def _nodes() -> tuple[Array, Array]:
    """Return places and weights of Gauss-Legendre quadrature, which take a second to compute."""
    places, weights = np.polynomial.legendre.leggauss(NODES)
    return np.asarray(places), np.asarray(weights)


def _cut(grid: Array, mass: Array, step: float, target: float, two_sided: bool, farthest: float) -> float:
    """Return the boundary of the sum that is crossed in the next step with the target probability."""

    def excess(cut: float) -> float:
        beyond = special.ndtr((grid - cut) / step)
        if two_sided:
            beyond = beyond + special.ndtr((-grid - cut) / step)
        return float(beyond @ mass) - target

    if excess(farthest) >= 0:
        return farthest
    return float(optimize.brentq(excess, -farthest if not two_sided else 0.0, farthest, xtol=1e-12))


def nominal_levels(looks: Sequence[int], planned: int, alpha: float, kind: str, two_sided: bool) -> list[Look]:
    """Return the boundary of each of the looks (people analysed at each)."""
    side = alpha / 2 if two_sided else alpha
    spending = [spent(kind, side, people / planned) for people in looks]
    bounds = boundaries([float(people) for people in looks], spending, two_sided)
    sides = 2 if two_sided else 1
    return [
        Look(number, len(looks), people, planned, bound, sides * float(stats.norm.sf(bound)))
        for number, (people, bound) in enumerate(zip(looks, bounds, strict=True), start=1)
    ]


def current_look(looks: Sequence[int], people: int, alpha: float, kind: str, two_sided: bool) -> Look | None:
    """Return the look that this many people are: the declared one that is nearest, of two the later. Earlier looks
    count as taken at their declared numbers, this one at its own. None before the first."""
    if not looks or people < looks[0]:
        return None
    # The last number reached would be look 1 of 30 and 60 with 58 people, as after exclusions at the end, and its
    # boundary would ignore the test at 30.
    place = min(range(len(looks)), key=lambda index: (abs(looks[index] - people), -index))
    taken = [*looks[:place], people]
    found = nominal_levels(taken, looks[-1], alpha, kind, two_sided)[-1]
    return replace(found, of=len(looks))
