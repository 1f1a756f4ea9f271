"""Effect sizes and tests against published data sets, definitions and formulas written out by hand."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from analysis import effects
from analysis.assumptions import residuals
from analysis.compare import adjust, t_test, welch_t_test
from analysis.ranks import epsilon_of_counts
from analysis.results import Result

# Miles per gallon of the 1974 Motor Trend cars (R: mtcars), by gearbox.
MANUAL = np.array([21, 21, 22.8, 32.4, 30.4, 33.9, 27.3, 26, 30.4, 15.8, 19.7, 15, 21.4])
AUTOMATIC = np.array(
    [21.4, 18.7, 18.1, 14.3, 24.4, 22.8, 19.2, 17.8, 16.4, 17.3, 15.2, 10.4, 10.4, 14.7, 21.5, 15.5, 15.2, 13.3, 19.2]
)
# Dobson's plant weights (R: PlantGrowth).
PLANTS = [
    np.array([4.17, 5.58, 5.18, 6.11, 4.50, 4.61, 5.17, 4.53, 5.33, 5.14]),
    np.array([4.81, 4.17, 4.41, 3.59, 5.87, 3.83, 6.03, 4.89, 4.32, 4.69]),
    np.array([6.31, 5.12, 5.54, 5.50, 5.37, 5.29, 4.92, 6.15, 5.80, 5.26]),
]


def test_student_and_welch_agree_with_r() -> None:
    student = t_test(Result("reward", "t_test"), AUTOMATIC, MANUAL)
    assert (student.statistic, student.df) == (pytest.approx(-4.1061, abs=5e-5), 30)
    assert student.p == pytest.approx(0.000285, abs=5e-7)
    assert (student.estimate, student.estimate_low, student.estimate_high) == pytest.approx(
        (-7.244939, -10.84837, -3.64151), abs=5e-5
    )
    welch = welch_t_test(Result("reward", "welch_t_test"), AUTOMATIC, MANUAL)
    assert (welch.statistic, welch.df) == pytest.approx((-3.7671, 18.332), abs=5e-4)
    assert welch.p == pytest.approx(0.001374, abs=5e-7)


def test_hedges_g_and_its_interval_agree_with_r() -> None:
    g = effects.hedges_g(AUTOMATIC, MANUAL)
    assert (g.value, g.low, g.high) == pytest.approx((-1.44, -2.21, -0.65), abs=0.006)


def test_hedges_g_is_the_difference_over_the_pooled_deviation_times_the_gamma_correction() -> None:
    first, second = MANUAL, AUTOMATIC
    squares = sum((value - first.mean()) ** 2 for value in first) + sum(
        (value - second.mean()) ** 2 for value in second
    )
    df = len(first) + len(second) - 2
    d = (first.mean() - second.mean()) / math.sqrt(squares / df)
    correction = math.gamma(df / 2) / (math.sqrt(df / 2) * math.gamma((df - 1) / 2))
    assert effects.hedges_g(first, second).value == pytest.approx(correction * d, rel=1e-12)


def test_bounds_of_g_are_where_the_observed_t_is_just_significant() -> None:
    g = effects.hedges_g(MANUAL, AUTOMATIC)
    t = stats.ttest_ind(MANUAL, AUTOMATIC).statistic
    scale = math.sqrt(1 / 13 + 1 / 19) * math.gamma(15) / (math.sqrt(15) * math.gamma(14.5))
    assert stats.nct.cdf(t, 30, g.low / scale) == pytest.approx(0.975, abs=1e-6)
    assert stats.nct.cdf(t, 30, g.high / scale) == pytest.approx(0.025, abs=1e-6)


@pytest.mark.parametrize("difference", [0.0, 0.4, 9.0, -40.0])
def test_the_interval_of_g_exists_for_tiny_and_huge_effects(difference: float) -> None:
    noise = np.random.default_rng(1).normal(0, 1, (2, 25))
    g = effects.hedges_g(noise[0] - noise[0].mean() + difference, noise[1] - noise[1].mean())
    assert g.low < g.value < g.high


def test_eta_squared_is_the_share_between_groups_and_its_bounds_are_noncentral() -> None:
    f, _ = stats.f_oneway(*PLANTS)
    everything = np.concatenate(PLANTS)
    between = sum(10 * (group.mean() - everything.mean()) ** 2 for group in PLANTS)
    total = ((everything - everything.mean()) ** 2).sum()
    eta = effects.eta_squared(float(f), 2, 27)
    assert eta.value == pytest.approx(between / total, rel=1e-12)
    for bound, tail in ((eta.low, 0.95), (eta.high, 0.05)):
        noncentrality = bound * 30 / (1 - bound)
        assert stats.ncf.cdf(f, 2, 27, noncentrality) == pytest.approx(tail, abs=1e-6)


def test_eta_squared_starts_at_zero_exactly_when_the_test_is_not_significant() -> None:
    critical = stats.f.ppf(0.95, 2, 27)
    assert effects.eta_squared(critical * 0.999, 2, 27).low == 0
    assert effects.eta_squared(critical * 1.001, 2, 27).low > 0


def test_cliffs_delta_counts_pairs() -> None:
    wins = sum(1 if a > b else -1 if a < b else 0 for a in AUTOMATIC for b in MANUAL)
    delta = effects.cliffs_delta(AUTOMATIC, MANUAL)
    assert delta.value == pytest.approx(wins / (13 * 19), rel=1e-12)
    assert delta.value == pytest.approx(2 * 42 / (13 * 19) - 1, rel=1e-12)  # R: wilcox.test gives W = 42
    assert -1 <= delta.low < delta.value < delta.high < 0


def test_the_interval_of_cliffs_delta_covers_the_truth_about_as_often_as_its_level() -> None:
    generator = np.random.default_rng(3)
    truth = 2 * stats.norm.cdf(0.5 / math.sqrt(2)) - 1
    found = [effects.cliffs_delta(generator.normal(0.5, 1, 30), generator.normal(0, 1, 30)) for _ in range(400)]
    assert 0.92 < np.mean([delta.low <= truth <= delta.high for delta in found]) < 0.98


def kruskal_h(groups: list[np.ndarray]) -> float:
    values, value = np.unique(np.concatenate(groups), return_inverse=True)
    counts = np.zeros((1, len(groups), values.size))
    np.add.at(counts[0], (np.repeat(np.arange(len(groups)), [group.size for group in groups]), value), 1.0)
    return float(epsilon_of_counts(counts)[0] * (value.size - 1))


def test_h_of_many_draws_equals_scipys_also_with_ties() -> None:
    generator = np.random.default_rng(5)
    groups = [generator.integers(0, 9, size).astype(float) for size in (12, 17, 9)]
    assert kruskal_h(groups) == pytest.approx(stats.kruskal(*groups).statistic, rel=1e-12)
    assert kruskal_h(PLANTS) == pytest.approx(7.9882, abs=5e-5)  # R: kruskal.test
    assert effects.epsilon_squared(7.9882, 30) == pytest.approx(0.2755, abs=5e-5)


def test_residuals_are_what_is_left_of_each_group() -> None:
    assert stats.shapiro(residuals(PLANTS)).statistic == pytest.approx(0.96607, abs=5e-6)  # R: shapiro.test of aov


def test_a_mean_comes_with_students_interval() -> None:
    mean = effects.mean_interval(np.array([1.0, 2, 3, 4, 10]))
    half = 2.7764451 * math.sqrt(12.5 / 5)
    assert (mean.value, mean.low, mean.high) == pytest.approx((4, 4 - half, 4 + half), abs=1e-6)


@pytest.mark.parametrize(
    ("groups", "reason"),
    [
        ([np.array([1.0, 2])], "only one condition"),
        ([np.array([1.0]), np.array([1.0, 2])], "fewer than two values in a condition"),
        ([np.array([3.0, 3]), np.array([5.0, 5])], "no variance within the conditions"),
    ],
)
def test_impossible_comparisons_give_a_reason(groups: list[effects.Values], reason: str) -> None:
    assert effects.can_compare(groups) == reason


def rejected_by_hand(p_values: list[float], alpha: float) -> list[bool]:
    """Benjamini and Hochberg 1995, in their words: the largest k with p(k) <= k/m alpha; reject the k smallest."""
    m = len(p_values)
    ordered = sorted(p_values)
    k = max((rank for rank in range(1, m + 1) if ordered[rank - 1] <= rank / m * alpha), default=0)
    return [k > 0 and p <= ordered[k - 1] for p in p_values]


@settings(max_examples=200, deadline=None)
@given(st.lists(st.floats(1e-6, 1), min_size=1, max_size=12), st.sampled_from([0.01, 0.05, 0.2]))
def test_corrected_values_reject_what_benjamini_and_hochberg_reject(p_values: list[float], alpha: float) -> None:
    rows = adjust([Result("reward", "t_test", p=p) for p in p_values])
    sure = [row.p_adjusted for row in rows]
    near = [abs(value - alpha) < 1e-9 for value in sure]
    by_hand = rejected_by_hand(p_values, alpha)
    assert all(close or (value <= alpha) == hand for value, close, hand in zip(sure, near, by_hand, strict=True))


def test_rows_without_a_test_are_not_counted_in_the_correction() -> None:
    rows = adjust([Result("reward", "t_test", p=0.04), Result("reward", "t_test", note="no variance")])
    assert rows[0].p_adjusted == 0.04
    assert math.isnan(rows[1].p_adjusted)
