"""Effect sizes with confidence intervals, from plain arrays.

Intervals come from noncentral distributions (Steiger 2004) or from the dominance variance (Cliff 1996), not from a
normal approximation: groups of a laboratory study are small.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special, stats

from analysis.results import Interval

Values = NDArray[np.float64]


def pooled_sd(first: Values, second: Values) -> float:
    """Return the standard deviation within two groups, weighted by their degrees of freedom."""
    squares = (first.size - 1) * first.var(ddof=1) + (second.size - 1) * second.var(ddof=1)
    return math.sqrt(squares / (first.size + second.size - 2))


def hedges_g(first: Values, second: Values, level: float = 0.95) -> Interval:
    """Return the standardised difference first - second without small-sample bias, with its exact interval (noncentral
    t)."""
    spread = pooled_sd(first, second)
    if spread == 0:
        return Interval(math.nan, level=level)
    df = first.size + second.size - 2
    scale = math.sqrt(1 / first.size + 1 / second.size)
    unbias = math.exp(special.gammaln(df / 2) - special.gammaln((df - 1) / 2)) / math.sqrt(df / 2)
    d = float(first.mean() - second.mean()) / spread
    low, high = _noncentral_t(d / scale, df, level)
    return Interval(unbias * d, unbias * low * scale, unbias * high * scale, level)


def _noncentral_t(t: float, df: float, level: float) -> tuple[float, float]:
    """Return the two noncentrality parameters at which t is just on the border of significance, from above and from
    below."""

    def solve(tail: float) -> float:
        def beyond(shift: float) -> float:
            return float(special.nctdtr(df, shift, t)) - tail

        reach = 1.0  # far from the root the distribution function is not defined in floating point
        while beyond(t - reach) < 0 or beyond(t + reach) > 0:
            reach *= 1.5
        return float(optimize.brentq(beyond, t - reach, t + reach, xtol=1e-10))

    return solve((1 + level) / 2), solve((1 - level) / 2)


def eta_squared(f: float, df_between: float, df_within: float, level: float = 0.90) -> Interval:
    """Return the share of variance between groups of a one-way ANOVA, with its interval (noncentral F). 90 % by
    default: the test is one-sided, so that this interval leaves out zero exactly when p < .05."""
    share = f * df_between / (f * df_between + df_within)
    total = df_between + df_within + 1
    low, high = (
        _noncentral_f(f, df_between, df_within, tail) / (_noncentral_f(f, df_between, df_within, tail) + total)
        for tail in ((1 + level) / 2, (1 - level) / 2)
    )
    return Interval(share, low, high, level)


def _noncentral_f(f: float, df_between: float, df_within: float, tail: float) -> float:
    if stats.f.cdf(f, df_between, df_within) <= tail:
        return 0.0
    top = 10.0
    while special.ncfdtr(df_between, df_within, top, f) > tail:
        top *= 2
    return float(
        optimize.brentq(lambda shift: special.ncfdtr(df_between, df_within, shift, f) - tail, 0, top, xtol=1e-10)
    )


def epsilon_squared(h: float, n: int) -> float:
    """Return the effect size of Kruskal-Wallis: the share of the variance of ranks that lies between groups (Kelley; 0
    to 1)."""
    return h / (n - 1)


def cliffs_delta(first: Values, second: Values, level: float = 0.95) -> Interval:
    """Return P(first > second) - P(first < second), the rank-biserial correlation; asymmetric interval (Cliff 1996)."""
    dominance = np.sign(first[:, None] - second[None, :])  # (first, second)
    delta = float(dominance.mean())
    m, n = dominance.shape
    if abs(delta) == 1 or min(m, n) < 2:
        return Interval(delta, level=level)
    rows = ((dominance.mean(axis=1) - delta) ** 2).sum()
    columns = ((dominance.mean(axis=0) - delta) ** 2).sum()
    cells = ((dominance - delta) ** 2).sum()
    variance = (n * n * rows + m * m * columns - cells) / (m * n * (m - 1) * (n - 1))
    variance = max(float(variance), (1 - delta**2) / (m * n - 1))
    z = float(stats.norm.ppf((1 + level) / 2))
    spread = z * math.sqrt(variance) * math.sqrt((1 - delta**2) ** 2 + z**2 * variance)
    bottom = 1 - delta**2 + z**2 * variance
    centre = delta - delta**3
    return Interval(delta, max(-1.0, (centre - spread) / bottom), min(1.0, (centre + spread) / bottom), level)


def mean_interval(values: Values, level: float = 0.95) -> Interval:
    """Mean with Student's interval; without bounds for a single value."""
    mean = float(values.mean()) if values.size else math.nan
    if values.size < 2:
        return Interval(mean, level=level)
    half = float(special.stdtrit(values.size - 1, (1 + level) / 2)) * standard_error(values)
    return Interval(mean, mean - half, mean + half, level)


def standard_error(values: Values) -> float:
    """Return the standard error of the mean; nan for fewer than two values."""
    return float(values.std(ddof=1) / math.sqrt(values.size)) if values.size > 1 else math.nan


def difference_interval(first: Values, second: Values, level: float = 0.95) -> Interval:
    """Return first - second with Student's interval for equal variances."""
    df = first.size + second.size - 2
    half = float(special.stdtrit(df, (1 + level) / 2)) * pooled_sd(first, second)
    half *= math.sqrt(1 / first.size + 1 / second.size)
    difference = float(first.mean() - second.mean())
    return Interval(difference, difference - half, difference + half, level)


def can_compare(groups: Sequence[Values]) -> str:
    """Return why these groups cannot be compared by a test of means, empty if they can."""
    if len(groups) < 2:
        return "only one condition"
    if any(group.size < 2 for group in groups):
        return "fewer than two values in a condition"
    if all(np.ptp(group) == 0 for group in groups):
        return "no variance within the conditions"
    return ""
