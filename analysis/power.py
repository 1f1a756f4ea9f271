"""Power by simulation on the study's design: every participant has a random effect and plays every episode.

Two questions: does the test over people find the difference, and how many of the tests per layout and agent do after
Benjamini-Hochberg? Reward levels of layouts and agents cancel in both and are left out.
"""

import csv
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats

from analysis.simulated_participants import LABEL

Values = NDArray[np.float64]
STUDIES = 2000
SIZES = (5, 10, 15, 20, 25, 29, 35, 40, 50, 60)
DRAWN = 300  # participants in each condition up to which a curve is drawn to reach its goal
MOST = 100_000  # the largest number of participants in each condition that is suggested
WANTED = 0.8
IN_MEMORY = 10_000_000  # rewards at a time


@dataclass(frozen=True)
class PowerDesign:
    """Two conditions that are compared, and the variance of reward (standard deviations in points)."""

    person_sd: float
    residual_sd: float
    episodes: int = 10  # of a participant: layouts times agents
    alpha: float = 0.05

    @property
    def mean_sd(self) -> float:
        """Standard deviation between the means of people."""
        return math.sqrt(self.person_sd**2 + self.residual_sd**2 / self.episodes)


@dataclass(frozen=True)
class Power:
    """Shares of simulated studies, 0 to 1."""

    effect: float  # true difference in points
    participants: int  # in each condition
    people: float  # the t-test over participants' means finds it
    comparison: float  # one of the tests per layout and agent finds it after Benjamini-Hochberg, on average
    some: float  # at least one of them does
    studies: int

    @property
    def error(self) -> float:
        """Standard error of `people` that comes from simulating."""
        return float(np.sqrt(self.people * (1 - self.people) / self.studies))


def simulate(
    design: PowerDesign, effect: float, participants: int, studies: int, generator: np.random.Generator
) -> Values:
    """Return simulated rewards around their expectation: (studies, 2 conditions, participants, episodes), the second
    with the effect."""
    shape = (studies, 2, participants)
    rewards = generator.normal(0, design.residual_sd, (*shape, design.episodes))
    rewards += generator.normal(0, design.person_sd, shape)[..., None]
    rewards[:, 1] += effect
    return rewards


def t_test_p(first: Values, second: Values) -> Values:
    """Return two-sided p of Student's test along axis 1: (studies, participants, ...) -> (studies, ...)."""
    size = first.shape[1]
    spread = first.var(axis=1, ddof=1) + second.var(axis=1, ddof=1)
    t = (first.mean(axis=1) - second.mean(axis=1)) / np.sqrt(spread / size)
    return np.asarray(2 * stats.t.sf(np.abs(t), 2 * size - 2))


def found_after_correction(p: Values, alpha: float) -> NDArray[np.bool_]:
    """Return which hypotheses Benjamini-Hochberg rejects along the last axis."""
    tests = p.shape[-1]
    ordered = np.sort(p, axis=-1)
    below = ordered <= alpha * np.arange(1, tests + 1) / tests
    last = tests - 1 - np.argmax(below[..., ::-1], axis=-1)
    bound = np.where(below.any(axis=-1), np.take_along_axis(ordered, last[..., None], axis=-1)[..., 0], -1.0)
    return np.asarray(p <= bound[..., None])


def power(design: PowerDesign, effect: float, participants: int, studies: int = STUDIES, seed: int = 1) -> Power:
    """Return how often `studies` simulated studies find the effect; the same numbers for the same seed."""
    sign = [1] if effect < 0 else []
    generator = np.random.default_rng([seed, participants, abs(round(effect * 1000)), *sign])
    people, some, comparison = [], [], []
    batch = max(1, min(500, IN_MEMORY // (2 * participants * design.episodes)))
    for start in range(0, studies, batch):
        rewards = simulate(design, effect, participants, min(batch, studies - start), generator)
        means = rewards.mean(axis=-1)
        people.append(t_test_p(means[:, 1], means[:, 0]) < design.alpha)
        found = found_after_correction(t_test_p(rewards[:, 1], rewards[:, 0]), design.alpha)
        comparison.append(found.mean(axis=-1))
        some.append(found.any(axis=-1))
    overall, each, any_ = (float(np.concatenate(part).mean()) for part in (people, comparison, some))
    return Power(effect, participants, overall, each, any_, studies)


def curve(
    design: PowerDesign, effects: Sequence[float], sizes: Sequence[int] = SIZES, studies: int = STUDIES, seed: int = 1
) -> list[Power]:
    """Return the power of every effect at every number of participants in a condition."""
    return [power(design, effect, size, studies, seed) for effect in effects for size in sizes]


def write_points(points: Sequence[Power], path: Path, simulated: bool = False) -> None:
    """Write the curve as CSV, one row per point. `simulated`: its `note` says that a number comes from simulated
    participants."""
    names = ("effect", "participants", "people", "comparison", "some", "studies")
    note = LABEL if simulated else ""
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow((*names, "note"))
        writer.writerows([[*(getattr(point, name) for name in names), note] for point in points])


def exact(design: PowerDesign, effect: float, participants: int) -> float:
    """Return the power of the two-sided t-test over participants' means, from the noncentral t distribution."""
    shift = abs(effect) / (design.mean_sd * math.sqrt(2 / participants))
    df = 2 * participants - 2
    bound = float(stats.t.ppf(1 - design.alpha / 2, df))
    below, missed = np.nan_to_num([special.nctdtr(df, shift, -bound), special.nctdtr(df, shift, bound)])
    return float(below + 1 - missed)  # both are nan only where they are 0 to all digits: far from the bound


def participants_needed(design: PowerDesign, effect: float, wanted: float = WANTED) -> int | None:
    """Return the smallest number of participants in each condition at which the t-test over people has the wanted
    power; none where that takes more than MOST."""
    return smallest_size(lambda participants: exact(design, effect, participants), wanted)


def smallest_size(power: Callable[[int], float], wanted: float) -> int | None:
    """Return the smallest number of participants in each condition with the wanted power; None beyond MOST. `power`
    grows."""
    if power(MOST) < wanted:
        return None
    low, high = 1, MOST  # too few, enough
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if power(middle) >= wanted else (middle, high)
    return high


def sizes_for(design: PowerDesign, effects: Sequence[float], participants: int) -> list[int]:
    """Return the sizes at which to simulate: the usual ones, the study's own, and those at which the wanted power is
    reached."""
    needed = [participants_needed(design, effect) for effect in effects]
    return sorted({*SIZES, participants, *(size for size in needed if size is not None and 2 <= size <= DRAWN)})


def sentence(design: PowerDesign, points: Sequence[Power], effect: float, participants: int) -> str:
    """Return what a methods section says about it."""
    point = next(point for point in points if point.effect == effect and point.participants == participants)
    needed = participants_needed(design, effect)
    enough = (
        f"{100 * WANTED:.0f} % are reached with {needed} participants in each condition."
        if needed is not None
        else f"{100 * WANTED:.0f} % are not reached with {MOST:,} participants in each condition."
    )
    episodes = f"{design.episodes} episode{'' if design.episodes == 1 else 's'} a participant"
    return (
        f"Power was simulated on the nested design ({point.studies} studies; {episodes}, "
        f"standard deviation {design.person_sd:.1f} points between and {design.residual_sd:.1f} within participants): "
        f"with {participants} participants in each condition, a true difference of {effect:g} points is found with a "
        f"probability of {100 * point.people:.0f} % (t-test over participants, two-sided, alpha = {design.alpha:g}); "
        f"{enough}"
    )
