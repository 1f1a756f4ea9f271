"""The primary test that the study file declares, over people: two conditions, or one effect of factors."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import polars as pl
from scipy import stats

from analysis import effects, factorial, factorial_within
from analysis.alpha_spending import Look, current_look
from analysis.declared import REWARD, DeclaredTest
from analysis.groups import ALL, Groups, Values, computed, person_means
from analysis.questionnaires import answers_on
from analysis.results import Result
from analysis.tables import Export

SECTION = "primary"
EXACT_BELOW = 50  # people of a condition
ALTERNATIVES: dict[str, Literal["two-sided", "greater", "less"]] = {  # scipy's names
    "two_sided": "two-sided",
    "greater": "greater",
    "less": "less",
}


def primary_row(declared: DeclaredTest, episodes: pl.DataFrame, export: Export) -> Result:
    """Return the declared test of these episodes; without p and with the reason where it cannot be computed."""
    if declared.effect:
        return _of_effect(declared, episodes, export)
    values = values_of_people(declared, episodes, export.answers)
    return compared(declared, values[declared.comparison[0]], values[declared.comparison[1]])


def _of_effect(declared: DeclaredTest, episodes: pl.DataFrame, export: Export) -> Result:
    """Return the declared effect, tested with all others of the design."""
    table, measure = values_of_episodes(declared, episodes, export.answers)
    table = table.select("episode", "participant", pl.col(measure).alias("value"))
    within = factorial_within.within_of(export)
    factors = factorial_within.repeated_factors(export) if within else factorial.levels_in(export)
    if missing := [name for name in declared.effect if name not in factors]:
        return replace(_base(declared, 0), note=f"the export has no levels of the factor {missing[0]}")
    if within:
        return of_effect(declared, factorial_within.repeated_cells(table, export))
    return of_effect(declared, factorial.cells_of(table, export, factors))


def of_effect(declared: DeclaredTest, cells: factorial.FactorialCells | factorial_within.RepeatedCells) -> Result:
    """Return the declared effect of these cells: F, and where it is one difference, that with its t-test."""
    how: Any = factorial_within if isinstance(cells, factorial_within.RepeatedCells) else factorial
    base = _base(declared, cells.people)
    if problem := how.problem_with(cells):
        return replace(base, note=problem)
    row = computed(how.tested, base, cells, declared.effect)
    if np.isnan(row.p):
        return row
    words = f"{ALTERNATIVES[declared.direction]}, alpha = {declared.alpha:g}"
    words += cells.adjusted_words if isinstance(cells, factorial_within.RepeatedCells) else ""
    if not factorial.has_one_difference(cells.factors, declared.effect):
        return replace(row, note=words)
    which = factorial.difference_words(cells.factors, declared.effect)
    return replace(_directed(declared, how.difference(row, cells, declared.effect)), note=f"{words}, {which}")


def _directed(declared: DeclaredTest, row: Result) -> Result:
    """Return a difference with the p of the declared direction, and the interval that goes with the level."""
    sides = {"two_sided": 2 * stats.t.sf(abs(row.statistic), row.df), "greater": stats.t.sf(row.statistic, row.df)}
    sides["less"] = stats.t.cdf(row.statistic, row.df)
    level = interval_level(declared, row.n)  # of the difference; that of eta squared would be another
    half = float(stats.t.ppf((1 + level) / 2, row.df)) * row.se
    return replace(
        row,
        estimate_low=row.estimate - half,
        estimate_high=row.estimate + half,
        p=float(sides[declared.direction]),
        df_residual=np.nan,
        ci_low=np.nan,
        ci_high=np.nan,
        ci_level=level,
    )


def values_of_people(declared: DeclaredTest, episodes: pl.DataFrame, answers: pl.DataFrame) -> dict[str, Values]:
    """Return each person's mean of the declared measure over the declared episodes, by condition."""
    chosen, measure = values_of_episodes(declared, episodes, answers)
    return Groups(person_means(chosen, measure), measure).at(ALL, ALL, declared.comparison)


def values_of_episodes(
    declared: DeclaredTest, episodes: pl.DataFrame, answers: pl.DataFrame
) -> tuple[pl.DataFrame, str]:
    """Return the declared episodes, or the answers about them, and the column that has the declared measure."""
    chosen = episodes
    for column, names in (("layout", declared.layouts), ("agent", declared.agents)):
        chosen = chosen.filter(pl.col(column).is_in(list(names))) if names else chosen
    if declared.measure == REWARD:
        return chosen, REWARD
    about = answers.filter(pl.col("question") == declared.measure)
    return answers_on(about, chosen, chosen["layout"].unique().to_list()), "value"


def compared(declared: DeclaredTest, first: Values, second: Values) -> Result:
    """Return the declared test of first - second."""
    base = _base(declared, first.size + second.size)
    if problem := effects.can_compare([first, second]):
        return replace(base, note=problem)
    look = look_at(declared, base.n)
    if declared.looks and look is None:
        return replace(base, note=f"before the first declared look, which is at {declared.looks[0]} people")
    row = computed(_ranks if declared.test == "mann_whitney" else _means, base, declared, first, second)
    words = f"{ALTERNATIVES[declared.direction]}, alpha = {declared.alpha:g}"
    words += f", look {look.number} of {look.of}, nominal alpha = {look.nominal_alpha:.3g}" if look else ""
    return row if row.note else replace(row, note=words)


def _base(declared: DeclaredTest, people: int) -> Result:
    return Result(
        SECTION,
        declared.test,
        _one_name(declared.layouts),
        _one_name(declared.agents),
        contrast=declared.contrast,
        question="" if declared.measure == REWARD else declared.measure,
        n=people,
        unit="people",
    )


def look_at(declared: DeclaredTest, people: int) -> Look | None:
    """Return which of the declared looks this many people are; None without looks, and before the first."""
    two_sided = declared.direction == "two_sided"
    return current_look(declared.looks, people, declared.alpha, declared.spending, two_sided)


def level_of(declared: DeclaredTest, people: int) -> float:
    """Return the level below which p is significant with this many people."""
    look = look_at(declared, people)
    return look.nominal_alpha if look else declared.alpha


def _one_name(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else "chosen" if names else ALL


def _means(base: Result, declared: DeclaredTest, first: Values, second: Values) -> Result:
    test = stats.ttest_ind(
        first, second, equal_var=declared.test == "student", alternative=ALTERNATIVES[declared.direction]
    )
    level = interval_level(declared, base.n)
    both = stats.ttest_ind(first, second, equal_var=declared.test == "student").confidence_interval(level)
    difference = float(first.mean() - second.mean())
    g = effects.hedges_g(first, second, level)
    return replace(
        base,
        estimate=difference,
        estimate_low=float(both.low),
        estimate_high=float(both.high),
        se=difference / float(test.statistic) if test.statistic else np.nan,
        statistic_name="t",
        statistic=float(test.statistic),
        df=float(test.df),
        p=float(test.pvalue),
        effect_name="Hedges g",
        effect=g.value,
        ci_low=g.low,
        ci_high=g.high,
        ci_level=level,
    )


def mann_whitney(first: Values, second: Values, declared: DeclaredTest) -> tuple[Values, Values]:
    """Return U of `first` and p along the last axis: exact below EXACT_BELOW people in both groups if no two values are
    equal, otherwise from the normal distribution, corrected for ties and continuity (as R's wilcox.test)."""
    ordered = np.sort(np.concatenate([first, second], axis=-1), axis=-1)
    is_exact = max(first.shape[-1], second.shape[-1]) < EXACT_BELOW and bool((np.diff(ordered) > 0).all())
    method: Literal["exact", "asymptotic"] = "exact" if is_exact else "asymptotic"
    alternative = ALTERNATIVES[declared.direction]
    test = stats.mannwhitneyu(first, second, axis=-1, alternative=alternative, method=method)
    return np.asarray(test.statistic), np.asarray(test.pvalue)


def _ranks(base: Result, declared: DeclaredTest, first: Values, second: Values) -> Result:
    """Estimate the difference by the median of all differences between two people (Hodges and Lehmann)."""
    u, p = mann_whitney(first, second, declared)
    delta = effects.cliffs_delta(first, second, interval_level(declared, base.n))
    return replace(
        base,
        estimate=float(np.median(first[:, None] - second[None, :])),
        statistic_name="U",
        statistic=float(u[()]),
        p=float(p[()]),
        effect_name="Cliff delta",
        effect=delta.value,
        ci_low=delta.low,
        ci_high=delta.high,
        ci_level=delta.level,
    )


def at_this_look(declared: DeclaredTest, people: int) -> DeclaredTest:
    """Return the declared test with the level of the look that this many people are, as a single test."""
    if look_at(declared, people) is None:
        return declared
    return replace(declared, alpha=level_of(declared, people), looks=())


def interval_level(declared: DeclaredTest, people: int) -> float:
    """Return the level of the interval that leaves out zero exactly where the test is significant; at an interim look,
    this is the repeated confidence interval."""
    return 1 - level_of(declared, people) * (1 if declared.direction == "two_sided" else 2)
