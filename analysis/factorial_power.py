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
    """One effect of a factorial design. `one_sided`: it is one difference, expected to go one way. `within`: factors of
    which each person meets all levels, in blocks; their effects come from differences within people, in which only the
    residual varies (independently, with the same variance in all blocks)."""

    design: PowerDesign
    levels: Levels
    term: Sequence[str]
    one_sided: bool = False
    within: Sequence[str] = ()

    @property
    def conditions(self) -> int:
        """The conditions of the study: combinations between people, times the orders of the blocks."""
        blocks = math.prod(self.levels[name] for name in self.within)
        orders = 1 if blocks == 1 else blocks if blocks % 2 == 0 else 2 * blocks  # of a balanced Latin square
        return math.prod(count for name, count in self.levels.items() if name not in self.within) * orders

    def _variance(self, blocks: int) -> float:
        """Return the variance of what the effect is tested on (a person's differences or mean), as the variance of one
        combination."""
        if any(name in self.within for name in self.term):
            return self.design.residual_sd**2 * blocks / self.design.episodes
        return self.design.mean_sd**2 * blocks

    def exact(self, effect: float, participants: int) -> float:
        """Return the power of the test of the effect with this many participants in each condition."""
        between = math.prod(self.levels[name] - 1 for name in self.term)
        own = math.prod(self.levels[name] - 1 for name in self.term if name in self.within)
        within = own * self.conditions * (participants - 1)
        if within < 1:
            return 0.0
        blocks = math.prod(self.levels[name] for name in self.within)
        squares = float((smallest_pattern(self.levels, self.term) ** 2).sum()) * effect**2
        people = participants * self.conditions / (math.prod(self.levels.values()) / blocks)  # with the same levels
        shift = people * squares / self._variance(blocks)
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


def sentences(
    design: PowerDesign, levels: Levels, within: Sequence[str], effect: float, participants: int
) -> Iterator[str]:
    """Yield what a methods section says about each effect."""
    for term in terms(dict.fromkeys(levels, ())):
        power = EffectPower(design, levels, term, within=within)
        kind = f"main effect of {term[0]}" if len(term) == 1 else f"interaction of {listed(list(term))}"
        size = "difference" + " of differences" * (len(term) - 1)
        of = "differences within participants" if any(name in within for name in term) else "participants' means"
        how = f"exact, F test over {of}, alpha = {design.alpha:g}"
        share = 100 * power.exact(effect, participants)
        yield (
            f"Factorial analysis of variance, {kind}: with {participants} participants in each of "
            f"{power.conditions} conditions, "
            f"a true {size} of {effect:g} points is found with a probability of {share:.0f} % ({how}); "
            f"{power.needed(effect)}."
        )
