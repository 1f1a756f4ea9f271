"""The power of main effects and interactions of a factorial design, exact, from the noncentral F distribution."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

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


@dataclass(frozen=True)
class EffectPower:
    """One effect of a factorial design. `one_sided`: it is one difference, expected to go one way."""

    design: PowerDesign
    levels: Levels
    term: Sequence[str]
    one_sided: bool = False

    def exact(self, effect: float, participants: int) -> float:
        """Return the power of the test of the effect with this many participants in each condition."""
        between = math.prod(self.levels[name] - 1 for name in self.term)
        within = math.prod(self.levels.values()) * (participants - 1)
        if within < 1:
            return 0.0
        squares = float((smallest_pattern(self.levels, self.term) ** 2).sum()) * effect**2
        shift = participants * squares / self.design.mean_sd**2
        if self.one_sided:
            missed = float(special.nctdtr(within, math.sqrt(shift), stats.t.ppf(1 - self.design.alpha, within)))
        else:
            bound = float(stats.f.ppf(1 - self.design.alpha, between, within))
            missed = float(special.ncfdtr(between, within, shift, bound))
        return 1.0 - (missed if math.isfinite(missed) else 0.0)

    def needed(self, effect: float) -> str:
        """Return how many participants the wanted power takes, in words."""
        needed = smallest_size(lambda participants: self.exact(effect, participants), WANTED)
        if needed is None:
            return f"{100 * WANTED:.0f} % are not reached with {MOST:,} participants in each condition"
        return f"{100 * WANTED:.0f} % are reached with {needed} participants in each condition"


def sentences(design: PowerDesign, levels: Levels, effect: float, participants: int) -> Iterator[str]:
    """Yield what a methods section says about each effect."""
    cells = math.prod(levels.values())
    for term in terms(dict.fromkeys(levels, ())):
        power = EffectPower(design, levels, term)
        kind = f"main effect of {term[0]}" if len(term) == 1 else f"interaction of {listed(list(term))}"
        size = "difference" + " of differences" * (len(term) - 1)
        how = f"exact, F test over participants' means, alpha = {design.alpha:g}"
        share = 100 * power.exact(effect, participants)
        yield (
            f"Factorial analysis of variance, {kind}: with {participants} participants in each of {cells} conditions, "
            f"a true {size} of {effect:g} points is found with a probability of {share:.0f} % ({how}); "
            f"{power.needed(effect)}."
        )
