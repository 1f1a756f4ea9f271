"""The power of the declared primary test: simulated with the report's own test, and exact where that is a t-test."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats

from analysis import factorial_power
from analysis.alpha_spending import nominal_levels
from analysis.declared import DeclaredTest
from analysis.power import MOST, WANTED, PowerDesign, smallest_size
from analysis.primary import ALTERNATIVES, mann_whitney
from analysis.primary_text import TITLES

Values = NDArray[np.float64]
BATCH = 2_000_000  # values in memory at a time


@dataclass(frozen=True)
class PrimaryDesign:
    """The declared test, and how the means of people vary (in points of the measure)."""

    declared: DeclaredTest
    person_sd: float
    residual_sd: float
    episodes: int  # of a participant that the test uses
    levels: factorial_power.Levels = field(default_factory=dict)  # of each factor, where the test is about an effect
    within: tuple[str, ...] = ()  # factors of which each person meets all levels

    @property
    def mean_sd(self) -> float:
        """Standard deviation between the means of people."""
        return math.sqrt(self.person_sd**2 + self.residual_sd**2 / self.episodes)


def p_values(declared: DeclaredTest, first: Values, second: Values) -> Values:
    """Return p of the declared test along the last axis: (studies, participants) -> (studies,)."""
    if declared.test == "mann_whitney":
        return mann_whitney(first, second, declared)[1]
    alternative, pooled = ALTERNATIVES[declared.direction], declared.test == "student"
    return np.asarray(stats.ttest_ind(first, second, axis=-1, equal_var=pooled, alternative=alternative).pvalue)


def simulated_with_looks(design: PrimaryDesign, effect: float, studies: int, seed: int) -> tuple[float, float]:
    """Return the share of simulated studies that cross a boundary at a declared look, and how many people they have in
    both conditions on average. Half of the people of each look are in each condition."""
    declared = design.declared
    generator = np.random.default_rng([seed, declared.looks[-1], abs(round(effect * 1000)), int(effect < 0)])
    shift = directed(declared, effect)
    looks = [2 * (people // 2) for people in declared.looks]
    two_sided = declared.direction == "two_sided"
    bounds = nominal_levels(looks, looks[-1], declared.alpha, declared.spending, two_sided)
    crossed, people = 0, 0
    step = max(1, BATCH // looks[-1])
    for start in range(0, studies, step):
        means = generator.normal(0, design.mean_sd, (2, min(step, studies - start), looks[-1] // 2))
        going = np.ones(means.shape[1], dtype=np.bool_)
        for look in bounds:
            people += int(going.sum()) * (look.people if look.number == 1 else look.people - looks[look.number - 2])
            half = look.people // 2
            p = p_values(declared, means[0, :, :half] + shift, means[1, :, :half])
            crossed += int((going & (p < look.nominal_alpha)).sum())
            going &= p >= look.nominal_alpha
    return crossed / studies, people / studies


def directed(declared: DeclaredTest, effect: float) -> float:
    """Return the effect as it is in a two-sided test, in the declared direction in a one-sided one."""
    return effect if declared.direction == "two_sided" else math.copysign(effect, _sign(declared))


def simulated(design: PrimaryDesign, effect: float, participants: int, studies: int, seed: int) -> float:
    """Return the share of simulated studies that find the effect, which goes the declared way in a one-sided test."""
    generator = np.random.default_rng([seed, participants, abs(round(effect * 1000)), int(effect < 0)])
    shift = directed(design.declared, effect)
    found = 0
    step = max(1, BATCH // (2 * participants))
    for start in range(0, studies, step):
        means = generator.normal(0, design.mean_sd, (2, min(step, studies - start), participants))
        found += int((p_values(design.declared, means[0] + shift, means[1]) < design.declared.alpha).sum())
    return found / studies


def _sign(declared: DeclaredTest) -> float:
    return -1.0 if declared.direction == "less" else 1.0


def exact(design: PrimaryDesign, effect: float, participants: int) -> float:
    """Return the power of the t-test with equal variances, from the noncentral t distribution."""
    sides = 2 if design.declared.direction == "two_sided" else 1
    df = 2 * participants - 2
    shift = abs(effect) / (design.mean_sd * math.sqrt(2 / participants))
    bound = float(stats.t.ppf(1 - design.declared.alpha / sides, df))
    below, missed = np.nan_to_num([special.nctdtr(df, shift, -bound), special.nctdtr(df, shift, bound)])
    return float(1 - missed + (below if sides == 2 else 0))


def participants_needed(design: PrimaryDesign, effect: float) -> int | None:
    """Return the smallest number of participants in each condition with the wanted power; None beyond MOST."""
    return smallest_size(lambda participants: exact(design, effect, participants), WANTED)


def sentence(design: PrimaryDesign, effect: float, participants: int, studies: int, seed: int) -> str:
    """Return what a methods section says about the declared test."""
    declared = design.declared
    if declared.effect:
        return _sentence_of_effect(design, effect, participants)
    if declared.looks:
        share, people = simulated_with_looks(design, effect, studies, seed)
        looks = ", ".join(str(look) for look in declared.looks)
        size = f"looks at {looks} people, {declared.spending} spending, {people:.0f} people on average"
        rest = ""
    else:
        share = simulated(design, effect, participants, studies, seed)
        size, rest = f"{participants} participants in each condition", _needed(design, effect)
    return (
        f"{_head(design)}: with {size}, a true difference of {directed(declared, effect):g} is found with a "
        f"probability of {100 * share:.0f} % ({studies} simulated studies){rest}."
    )


def _head(design: PrimaryDesign) -> str:
    declared = design.declared
    return (
        f"Primary test of the study file ({TITLES[declared.test]} of {declared.measure}, {declared.contrast}, "
        f"{declared.direction.replace('_', '-')}, alpha = {declared.alpha:g}; {design.episodes} episodes a "
        f"participant, standard deviation {design.person_sd:.2g} between and {design.residual_sd:.2g} within "
        f"participants)"
    )


def _sentence_of_effect(design: PrimaryDesign, effect: float, participants: int) -> str:
    """Return the power of an effect of factors: exact, as of a factorial analysis of variance."""
    declared = design.declared
    spread = PowerDesign(design.person_sd, design.residual_sd, design.episodes, declared.alpha)
    one_sided = declared.direction != "two_sided"
    found = factorial_power.EffectPower(spread, design.levels, declared.effect, one_sided, design.within)
    size = "difference" + " of differences" * (len(declared.effect) - 1)
    return (
        f"{_head(design)}: with {participants} participants in each of {found.conditions} conditions, "
        f"a true {size} of {directed(declared, effect):g} is found with a probability of "
        f"{100 * found.exact(effect, participants):.0f} % (exact); {found.needed(effect)}."
    )


def _needed(design: PrimaryDesign, effect: float) -> str:
    if design.declared.test == "mann_whitney":
        return ""  # there is no closed form
    needed = participants_needed(design, effect)
    if needed is None:
        return f"; {100 * WANTED:.0f} % are not reached with {MOST:,} participants in each condition"
    return f"; {100 * WANTED:.0f} % are reached with {needed} participants in each condition"
