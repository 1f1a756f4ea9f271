"""Check the tests' assumptions: normal residuals (Shapiro-Wilk) and equal variances (Levene, about medians)."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import polars as pl
from scipy import stats

from analysis.groups import Groups, Values, computed
from analysis.results import Result

FEWEST = 3  # with fewer values, neither test is informative


def check(
    episodes: pl.DataFrame, measure: str, conditions: Sequence[str], places: Sequence[tuple[str, str]]
) -> Iterator[Result]:
    """Return a Shapiro-Wilk and a Levene row for every (layout, agent), over the conditions with FEWEST values or more;
    the note names the others."""
    found = Groups(episodes, measure)
    for layout, agent in places:
        values = found.at(layout, agent, conditions)
        groups = [group for group in values.values() if group.size >= FEWEST]
        small = ", ".join(name for name, group in values.items() if group.size < FEWEST)
        base = Result("assumptions", "", layout, agent, n=sum(group.size for group in groups))
        base = replace(base, note=f"without {small}: fewer than {FEWEST} values") if small else base
        yield computed(_normality, replace(base, test="shapiro_wilk"), groups)
        yield computed(_equal_variance, replace(base, test="levene"), groups)


def residuals(groups: Sequence[Values]) -> Values:
    """Return every value minus the mean of its group, end to end."""
    return np.concatenate([group - group.mean() for group in groups]) if groups else np.empty(0)


def _normality(base: Result, groups: Sequence[Values]) -> Result:
    rest = residuals(groups)
    if rest.size < FEWEST or np.ptp(rest) == 0:
        return replace(base, note="too few different values")
    test = stats.shapiro(rest)
    return replace(base, statistic_name="W", statistic=float(test.statistic), p=float(test.pvalue))


def _equal_variance(base: Result, groups: Sequence[Values]) -> Result:
    if len(groups) < 2 or np.ptp(residuals(groups)) == 0:
        return replace(base, note="too few conditions with different values")
    f, p = stats.levene(*groups, center="median")
    df = float(len(groups) - 1), float(base.n - len(groups))
    return replace(base, statistic_name="F", statistic=float(f), df=df[0], df_residual=df[1], p=float(p))
