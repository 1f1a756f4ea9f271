"""The paper's tests of reward, and for each the additional statistics that reviewers expect. Tables of episodes in,
Result rows out.

Expects the columns participant, condition, layout, agent and a measure; the caller has removed excluded episodes.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
import polars as pl
from scipy import special, stats

from analysis import effects
from analysis.groups import ALL, Groups, PeopleGroups, Values, computed, pairs
from analysis.results import Result

CORRECTED = "Benjamini-Hochberg"  # in a note


def means(
    episodes: pl.DataFrame, measure: str, conditions: Sequence[str], places: Sequence[tuple[str, str]], section: str
) -> list[Result]:
    """Mean, standard error and 95 % interval in every condition at every (layout, agent), over the mean of every person
    where somebody has several episodes there, since one person's episodes are not independent."""
    people = PeopleGroups(episodes, measure)
    apart = not repeats(episodes)
    return [
        mean_row(
            Result(section, "mean", layout, agent, condition, unit="episodes" if apart and layout != ALL else "people"),
            values,
        )
        for layout, agent in places
        for condition, values in people.at(layout, agent, conditions).items()
        if values.size
    ]


def mean_row(base: Result, values: Values) -> Result:
    """Return the mean of the values with its standard error and interval put into `base`."""
    mean = effects.mean_interval(values)
    return replace(
        base,
        estimate=mean.value,
        estimate_low=mean.low,
        estimate_high=mean.high,
        se=effects.standard_error(values),
        n=values.size,
        ci_level=mean.level,
    )


def repeats(episodes: pl.DataFrame) -> bool:
    """Return True if somebody played a layout with an agent more than once."""
    return bool(episodes.select("participant", "layout", "agent").is_duplicated().any())


def anova(
    episodes: pl.DataFrame, measure: str, conditions: Sequence[str], places: Sequence[tuple[str, str]]
) -> Iterator[Result]:
    """One-way analysis of variance at every (layout, agent) with eta squared, as published: `anova` and `welch_anova`
    take episodes for independent, `anova_people` is over the mean of every person."""
    groups, people = Groups(episodes, measure), PeopleGroups(episodes, measure)
    for layout, agent in places:
        found = [values for values in groups.at(layout, agent, conditions).values() if values.size]
        base = Result("reward", "anova", layout, agent, n=sum(group.size for group in found))
        if problem := effects.can_compare(found):
            yield replace(base, note=problem)
            continue
        yield computed(_anova, base, found)
        welch = replace(base, test="welch_anova")
        flat = any(np.ptp(group) == 0 for group in found)
        yield replace(welch, note="no variance within a condition") if flat else computed(_welch_anova, welch, found)
        means = [values for values in people.at(layout, agent, conditions).values() if values.size]
        base = replace(base, test="anova_people", n=sum(group.size for group in means), unit="people")
        if problem := effects.can_compare(means):
            yield replace(base, note=problem)
        else:
            yield computed(_anova, base, means)


def _anova(base: Result, groups: Sequence[Values]) -> Result:
    f, p = stats.f_oneway(*groups)
    df = (float(len(groups) - 1), float(base.n - len(groups)))
    eta = effects.eta_squared(float(f), *df)
    return replace(
        base,
        statistic_name="F",
        statistic=float(f),
        df=df[0],
        df_residual=df[1],
        p=float(p),
        effect_name="eta squared",
        effect=eta.value,
        ci_low=eta.low,
        ci_high=eta.high,
        ci_level=eta.level,
    )


def _welch_anova(base: Result, groups: Sequence[Values]) -> Result:
    """Welch 1951, with his correction of the denominator."""
    sizes, means = (np.array([value(group) for group in groups]) for value in (np.size, np.mean))
    weights = sizes / np.array([group.var(ddof=1) for group in groups])
    share = weights / weights.sum()
    df = float(len(groups) - 1)
    lack = float(((1 - share) ** 2 / (sizes - 1)).sum()) / (df * (df + 2))
    f = float((weights * (means - (share * means).sum()) ** 2).sum()) / df / (1 + 2 * (df - 1) * lack)
    rest = 1 / (3 * lack)
    return replace(base, statistic_name="F", statistic=f, df=df, df_residual=rest, p=float(stats.f.sf(f, df, rest)))


def t_test(base: Result, first: Values, second: Values) -> Result:
    """Return Student's two-sided test of first - second put into `base`, with Hedges' g; or why there is none."""
    base = replace(base, n=first.size + second.size)
    if problem := effects.can_compare([first, second]):
        return replace(base, note=problem)
    return computed(_t_test, base, first, second)


def _t_test(base: Result, first: Values, second: Values) -> Result:
    difference = effects.difference_interval(first, second)
    se = effects.pooled_sd(first, second) * math.sqrt(1 / first.size + 1 / second.size)
    t = difference.value / se
    g = effects.hedges_g(first, second)
    return replace(
        base,
        estimate=difference.value,
        estimate_low=difference.low,
        estimate_high=difference.high,
        se=se,
        statistic_name="t",
        statistic=t,
        df=float(base.n - 2),
        p=float(2 * special.stdtr(base.n - 2, -abs(t))),
        effect_name="Hedges g",
        effect=g.value,
        ci_low=g.low,
        ci_high=g.high,
        ci_level=g.level,
    )


def welch_t_test(base: Result, first: Values, second: Values) -> Result:
    """Return the t-test that does not assume equal variances, next to Cliff's delta, which assumes no distribution at
    all."""
    base = replace(base, n=first.size + second.size)
    if problem := effects.can_compare([first, second]):
        return replace(base, note=problem)
    return computed(_welch_t_test, base, first, second)


def _welch_t_test(base: Result, first: Values, second: Values) -> Result:
    t, p = stats.ttest_ind_from_stats(*_moments(first), *_moments(second), equal_var=False)
    delta = effects.cliffs_delta(first, second)
    return replace(
        base,
        estimate=float(first.mean() - second.mean()),
        statistic_name="t",
        statistic=float(t),
        df=_welch_df(first, second),
        p=float(p),
        effect_name="Cliff delta",
        effect=delta.value,
        ci_low=delta.low,
        ci_high=delta.high,
        ci_level=delta.level,
    )


def _moments(values: Values) -> tuple[float, float, int]:
    """Return the moments for a t-test; scipy's function of the raw values warns if one condition's values are all the
    same."""
    return float(values.mean()), float(values.std(ddof=1)), values.size


def _welch_df(first: Values, second: Values) -> float:
    """Degrees of freedom of Welch and Satterthwaite."""
    a, b = (group.var(ddof=1) / group.size for group in (first, second))
    return float((a + b) ** 2 / (a**2 / (first.size - 1) + b**2 / (second.size - 1)))


def pairwise(
    episodes: pl.DataFrame, measure: str, conditions: Sequence[str], places: Sequence[tuple[str, str]]
) -> list[Result]:
    """Tests of every two conditions at every (layout, agent); Benjamini-Hochberg within each comparison. `t_test`: over
    episodes, as published; `t_test_people` and `welch_t_test`: over the mean of every person at the place."""
    groups, people = Groups(episodes, measure), PeopleGroups(episodes, measure)
    kinds: tuple[tuple[str, Groups | PeopleGroups, str, Callable[..., Result]], ...] = (
        ("t_test", groups, "episodes", t_test),
        ("t_test_people", people, "people", t_test),
        ("welch_t_test", people, "people", welch_t_test),
    )
    rows: list[Result] = []
    for first, second in pairs(conditions):
        for name, found, unit, test in kinds:
            family = []
            for layout, agent in places:
                values = found.at(layout, agent, (first, second))
                base = Result("reward", name, layout, agent, contrast=f"{first} - {second}", unit=unit)
                family.append(test(base, values[first], values[second]))
            rows += adjust(family)
    return rows


def adjust(family: Sequence[Result]) -> list[Result]:
    """Return the same rows with Benjamini-Hochberg p values over those that have a p value, added to their notes."""
    tested = [row for row in family if not math.isnan(row.p)]
    if not tested:
        return list(family)
    p = np.array([row.p for row in tested])
    order = np.argsort(p)[::-1]  # from the largest down: each is at most the one before it
    adjusted_p = np.empty(p.size)
    adjusted_p[order] = np.minimum(1, np.minimum.accumulate(p[order] * p.size / np.arange(p.size, 0, -1)))
    adjusted = iter(adjusted_p)
    note = f"{CORRECTED} over {len(tested)} tests"
    before = [row.note.partition(CORRECTED)[0].removesuffix("; ") for row in family]  # of the test, which stays
    notes = ["; ".join(filter(None, (own, note))) for own in before]
    return [
        row if math.isnan(row.p) else replace(row, p_adjusted=float(next(adjusted)), note=own)
        for row, own in zip(family, notes, strict=True)
    ]
