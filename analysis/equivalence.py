"""Equivalence by two one-sided tests over people (Welch), within the smallest effects that the study file sets.

A difference that is not significant is not evidence of equivalence; this test can be.
"""

from collections.abc import Sequence
from dataclasses import replace

import polars as pl
from scipy import stats

from analysis import compare, effects
from analysis.declared import DeclaredEffect
from analysis.groups import ALL, Groups, PeopleGroups, Values, computed, pairs, person_means
from analysis.phrases import ALPHA
from analysis.results import Result

SECTION = "equivalence"
NO_DIFFERENCE = "clear_division"  # the kitchen in which the published study found none
QUESTION = "partner_satisfaction"


def equivalence_rows(
    smallest: DeclaredEffect,
    episodes: pl.DataFrame,
    answers: pl.DataFrame,
    conditions: Sequence[str],
    contrast: tuple[str, str] | None,
) -> list[Result]:
    """Return two rows for each claim: `equivalence` (p of the two one-sided tests, the interval that decides) and
    `difference` (Welch). Claims: the main contrast where no difference is expected; random against none; the
    satisfaction with the partner. `answers` are those on the questionnaire's layouts. None without a main contrast:
    there is one condition, or the conditions are orders of blocks, which nobody asks to be equivalent."""
    rows: list[Result] = []
    if contrast is None:
        return rows
    base = Result(SECTION, "equivalence", agent=ALL, unit="people")
    if smallest.reward is not None:
        people = PeopleGroups(episodes, "reward")
        for layout, pair in _places(smallest, episodes, conditions, contrast):
            found = people.at(layout, ALL, pair)
            rows += claim_rows(replace(base, layout=layout), pair, found[pair[0]], found[pair[1]], smallest.reward)
    asked = answers.filter(pl.col("question") == QUESTION)
    if smallest.answers is not None and asked.height:
        means = Groups(person_means(asked, "value"), "value")
        for pair in pairs(conditions):
            found = means.at(ALL, ALL, pair)
            named = replace(base, layout="chosen", question=QUESTION)
            rows += claim_rows(named, pair, found[pair[0]], found[pair[1]], smallest.answers)
    return rows


def _places(
    smallest: DeclaredEffect, episodes: pl.DataFrame, conditions: Sequence[str], contrast: tuple[str, str]
) -> list[tuple[str, tuple[str, str]]]:
    """Return the place and the two conditions of each claim."""
    played = set(episodes["layout"].unique())
    layouts = [name for name in smallest.layouts or (NO_DIFFERENCE,) if name in played]
    places = [(layout, contrast) for layout in layouts]
    blind = ("random", "none")
    return places + ([(ALL, blind)] if set(blind) <= set(conditions) else [])


def claim_rows(base: Result, pair: tuple[str, str], first: Values, second: Values, bound: float) -> list[Result]:
    """Return the rows `equivalence` and `difference` of first - second within -bound and bound."""
    base = replace(base, contrast=" - ".join(pair), n=first.size + second.size)
    difference = compare.welch_t_test(replace(base, test="difference"), first, second)
    if problem := effects.can_compare([first, second]):
        return [replace(base, note=problem), difference]
    row = computed(_two_one_sided, base, first, second, bound)
    return [row if row.note else replace(row, note=f"within {bound:g} points"), difference]


def _two_one_sided(base: Result, first: Values, second: Values, bound: float) -> Result:
    """Return the result of both tests: p is the larger of the two; the interval at 90 % lies within the bounds exactly
    where p < .05."""
    above = stats.ttest_ind(first + bound, second, equal_var=False, alternative="greater")
    below = stats.ttest_ind(first - bound, second, equal_var=False, alternative="less")
    test = above if above.pvalue >= below.pvalue else below
    interval = stats.ttest_ind(first, second, equal_var=False).confidence_interval(1 - 2 * ALPHA)
    return replace(
        base,
        estimate=float(first.mean() - second.mean()),
        estimate_low=float(interval.low),
        estimate_high=float(interval.high),
        statistic_name="t",
        statistic=float(test.statistic),
        df=float(test.df),
        p=float(test.pvalue),
        effect_name="smallest effect of interest",
        effect=bound,
        ci_level=1 - 2 * ALPHA,
    )
