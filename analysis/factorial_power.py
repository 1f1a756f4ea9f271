"""The power of main effects and interactions of a factorial design, exact, from the noncentral F distribution."""

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats

from analysis.factorial import terms
from analysis.formatting import listed
from analysis.power import MOST, WANTED, PowerDesign, smallest_size

Levels = Mapping[str, int]  # how many levels each factor has


def smallest_pattern(levels: Levels, term: Sequence[str]) -> NDArray[np.float64]:
    """Return the means of the cells, (levels of each factor), for an effect of 1 that is hardest to find: two levels
    (of each factor of the term) differ, those between them lie in the middle, and no other effect exists."""
    pattern = np.ones(1)
    for name, count in levels.items():
        step = np.zeros(count)
        step[0], step[-1] = -0.5, 0.5
        pattern = np.multiply.outer(pattern, step if name in term else np.ones(count))
    return np.asarray(pattern[0])


def exact(design: PowerDesign, levels: Levels, term: Sequence[str], effect: float, participants: int) -> float:
    """Return the power of the F test of a term with this many participants in each condition."""
    cells = math.prod(levels.values())
    between = math.prod(levels[name] - 1 for name in term)
    within = cells * (participants - 1)
    if within < 1:
        return 0.0
    squares = float((smallest_pattern(levels, term) ** 2).sum()) * effect**2
    bound = float(stats.f.ppf(1 - design.alpha, between, within))
    missed = float(special.ncfdtr(between, within, participants * squares / design.mean_sd**2, bound))
    return 1.0 - (missed if math.isfinite(missed) else 0.0)


def sentences(design: PowerDesign, levels: Levels, effect: float, participants: int) -> Iterator[str]:
    """Yield what a methods section says about each effect."""
    cells = math.prod(levels.values())
    for term in terms(dict.fromkeys(levels, ())):
        share = exact(design, levels, term, effect, participants)
        kind = f"main effect of {term[0]}" if len(term) == 1 else f"interaction of {listed(list(term))}"
        size = "difference" + " of differences" * (len(term) - 1)
        how = f"exact, F test over participants' means, alpha = {design.alpha:g}"
        yield (
            f"Factorial analysis of variance, {kind}: with {participants} participants in each of {cells} conditions, "
            f"a true {size} of {effect:g} points is found with a probability of {100 * share:.0f} % ({how}); "
            f"{_needed(design, levels, term, effect)}."
        )


def _needed(design: PowerDesign, levels: Levels, term: Sequence[str], effect: float) -> str:
    needed = smallest_size(lambda participants: exact(design, levels, term, effect, participants), WANTED)
    if needed is None:
        return f"{100 * WANTED:.0f} % are not reached with {MOST:,} participants in each condition"
    return f"{100 * WANTED:.0f} % are reached with {needed} participants in each condition"
