"""The cumulative-link mixed model: a published worked example, integrals by another method, and simulated answers."""

import math
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from scipy import integrate, optimize, special, stats
from statsmodels.miscmodels.ordinal_model import OrderedModel

from analysis import ordinal, ordinal_fit
from analysis.ordinal_fit import OrdinalData, OrdinalFitError
from analysis.results import select
from tests.support.simulation import CONDITIONS, World, episodes_of

# Bitterness of wine, 1 to 5 (Randall 1989, table 5). Rows: bottles 1 to 8; columns: the nine raters.
BITTERNESS = np.array(
    [
        [2, 1, 2, 3, 2, 3, 1, 2, 1],  # cold, no contact
        [3, 2, 3, 2, 3, 2, 1, 2, 2],
        [3, 1, 3, 3, 4, 3, 2, 2, 3],  # cold, contact
        [4, 3, 2, 2, 3, 2, 2, 3, 2],
        [4, 2, 5, 3, 3, 2, 2, 3, 3],  # warm, no contact
        [4, 3, 5, 2, 3, 4, 3, 3, 2],
        [5, 5, 4, 5, 3, 5, 2, 3, 4],  # warm, contact
        [5, 4, 4, 3, 3, 4, 3, 4, 4],
    ]
)
WARM = np.repeat([0.0, 0, 0, 0, 1, 1, 1, 1], 9)
CONTACT = np.repeat([0.0, 0, 1, 1, 0, 0, 1, 1], 9)
WINE = OrdinalData(BITTERNESS.ravel() - 1, np.stack([WARM, CONTACT], axis=1), np.tile(np.arange(9), 8))


def test_the_published_fit_of_the_wine_data() -> None:
    """R package ordinal: clmm(rating ~ temp + contact + (1|judge), data = wine), Laplace's approximation."""
    fitted = ordinal_fit.fit(WINE, nodes=1)
    assert fitted.thresholds == pytest.approx([-1.6237, 1.5134, 4.2285, 6.0888], abs=6e-5)
    assert fitted.beta == pytest.approx([3.0630, 1.8349], abs=6e-5)
    assert np.sqrt(np.diag(fitted.covariance)) == pytest.approx([0.5954, 0.5125], abs=5e-4)
    assert fitted.person_sd == pytest.approx(1.131, abs=6e-4)
    assert fitted.person_sd**2 == pytest.approx(1.279, abs=6e-4)
    assert fitted.log_likelihood == pytest.approx(-81.57, abs=6e-3)


def marginal(data: OrdinalData, thresholds: np.ndarray, beta: np.ndarray, sd: float) -> float:
    """The log likelihood with each person's integral by scipy's adaptive quadrature, straight from the definition."""
    edges = np.concatenate([[-np.inf], thresholds, [np.inf]])
    total = 0.0
    for person in range(data.people):
        mine = data.person == person
        centre, category = data.x[mine] @ beta, data.category[mine]

        def density(u: float, centre: np.ndarray = centre, category: np.ndarray = category) -> float:
            shift = centre + sd * u
            p = special.expit(edges[category + 1] - shift) - special.expit(edges[category] - shift)
            return float(np.prod(p)) * math.exp(-u * u / 2) / math.sqrt(2 * math.pi)

        total += math.log(integrate.quad(density, -9, 9, epsabs=0, epsrel=1e-10, limit=200)[0])
    return total


def test_the_quadrature_is_the_integral() -> None:
    values = np.array([-1.5, 1.1, 1.0, 0.6, 2.8, 1.7, 1.3])
    thresholds, beta, sd = ordinal_fit.unpacked(WINE, values)
    found = ordinal_fit.log_likelihood(WINE, values, ordinal_fit.NODES)[0]
    assert found == pytest.approx(marginal(WINE, thresholds, beta, sd), abs=1e-6)


def test_the_gradient_is_the_slope_of_the_likelihood() -> None:
    values = np.array([-1.5, 1.1, 1.0, 0.6, 2.8, 1.7, 1.3])
    slope = optimize.approx_fprime(values, lambda x: ordinal_fit.log_likelihood(WINE, x, 30)[0], 1e-6)
    assert ordinal_fit.gradient(WINE, values, 30) == pytest.approx(slope, abs=1e-4)


def test_the_exact_maximum_is_close_to_the_published_approximation_and_better() -> None:
    fitted = ordinal_fit.fit(WINE)
    truth = marginal(WINE, fitted.thresholds, fitted.beta, fitted.person_sd)
    assert fitted.log_likelihood == pytest.approx(truth, abs=1e-6)
    assert fitted.beta == pytest.approx([3.063, 1.835], abs=0.003)
    for index in range(2):
        for step in (-0.02, 0.02):
            beta = fitted.beta + step * np.eye(2)[index]
            assert marginal(WINE, fitted.thresholds, beta, fitted.person_sd) < truth


def test_people_who_are_alike_give_the_model_without_random_effect() -> None:
    """Every answer by another person and no spread: statsmodels' ordered logit."""
    generator = np.random.default_rng(3)
    x = generator.integers(0, 2, (400, 2)).astype(float)
    latent = x @ [0.8, -0.5] + generator.logistic(size=400)
    category = np.digitize(latent, [-1.0, 0.2, 1.5])
    person = np.tile(np.arange(100), 4)
    ours = ordinal_fit.fit(OrdinalData(category, x, generator.permutation(person)))
    theirs = OrderedModel(category, x, distr="logit").fit(method="bfgs", disp=False)
    assert ours.person_sd < 0.4
    assert ours.beta == pytest.approx(np.asarray(theirs.params)[:2], abs=0.03)
    assert np.sqrt(np.diag(ours.covariance)) == pytest.approx(np.asarray(theirs.bse)[:2], rel=0.05)
    assert theirs.llf - 1e-6 <= ours.log_likelihood <= theirs.llf + 1.5


def test_planted_odds_and_spread_are_found() -> None:
    generator = np.random.default_rng(11)
    people, each = 400, 8
    person = np.repeat(np.arange(people), each)
    x = np.stack([(person % 2).astype(float), np.tile([0.0, 1.0], people * each // 2)], axis=1)
    latent = x @ [0.9, -0.4] + 1.2 * generator.normal(size=people)[person] + generator.logistic(size=people * each)
    fitted = ordinal_fit.fit(OrdinalData(np.digitize(latent, [-2.0, -1, 0, 1, 2, 3]), x, person))
    se = np.sqrt(np.diag(fitted.covariance))
    assert np.abs(fitted.beta - [0.9, -0.4]).max() < 4 * se.max()
    assert fitted.person_sd == pytest.approx(1.2, abs=0.15)
    assert fitted.thresholds == pytest.approx([-2, -1, 0, 1, 2, 3], abs=0.4)
    assert se[0] > 2 * se[1], "between people there is less information than within them"


@pytest.fixture(scope="module")
def answers() -> pl.DataFrame:
    return episodes_of(World(arm=16, answers=1.0), 5)[1]


def test_every_question_is_compared_between_the_conditions(answers: pl.DataFrame) -> None:
    rows = ordinal.ordinal_rows(answers, CONDITIONS)
    odds = select(rows, test="odds")
    assert [row.contrast for row in odds] == ["tom - none", "tom - random", "random - none"] * 3
    first, second, third = (row.estimate for row in odds[:3])
    assert first - second == pytest.approx(third)
    assert all(row.p_adjusted < 0.05 for row in odds if row.contrast.startswith("tom"))
    assert odds[0].note == "Benjamini-Hochberg over 9 tests"
    assert odds[0].effect == pytest.approx(math.exp(first))
    assert len(select(rows, test="person_sd")) == 3


def test_the_contrasts_do_not_depend_on_which_condition_comes_first(answers: pl.DataFrame) -> None:
    ways = [select(ordinal.ordinal_rows(answers, order), test="odds") for order in (CONDITIONS, CONDITIONS[::-1])]
    found = [{(row.question, row.contrast): (row.estimate, row.se) for row in way} for way in ways]
    for (question, contrast), (estimate, se) in found[0].items():
        turned = " - ".join(reversed(contrast.split(" - ")))
        other = found[1].get((question, contrast)) or tuple(
            sign * value for sign, value in zip((-1, 1), found[1][question, turned], strict=True)
        )
        assert other == pytest.approx((estimate, se), abs=2e-3)


def test_answers_that_cannot_be_fitted_give_a_reason(answers: pl.DataFrame) -> None:
    one = answers.filter(pl.col("question") == "efficiency")

    def notes(table: pl.DataFrame) -> list[str]:
        return [row.note for row in ordinal.ordinal_rows(table, CONDITIONS)]

    same = one.with_columns(value=pl.lit(4.0))
    assert notes(same) == ["could not be fitted: all answers are the same"]
    split = one.with_columns(
        value=pl.when(pl.col("condition") == "tom").then(7.0).otherwise(pl.col("value").clip(1, 5))
    )
    assert notes(split)[0].startswith("could not be fitted: ")
    number = one.with_columns(value=pl.int_range(pl.len()).cast(pl.Float64))
    assert notes(number) == ["is not an answer scale: too many different values"]
    few = one.filter(pl.col("participant").is_in(one["participant"].unique().sort().to_list()[:2]))
    assert notes(few.with_columns(condition=pl.col("participant"))) == []
    assert ordinal.ordinal_rows(one.filter(pl.col("condition") == "tom"), CONDITIONS) == []


def test_the_mode_of_a_person_far_from_the_others_is_found() -> None:
    """In this study a full Newton step swings back and forth, and the likelihood has a jump."""
    table = episodes_of(World(), 203)[1].filter(pl.col("question") == "efficiency")
    rows = ordinal.ordinal_rows(table, CONDITIONS)
    assert [row.contrast for row in select(rows, test="odds")] == ["tom - none", "tom - random", "random - none"]


def test_a_flat_likelihood_is_not_a_fit() -> None:
    twice = replace(WINE, x=np.repeat(WINE.x, 2, axis=1))
    with pytest.raises(OrdinalFitError, match="cannot be separated"):
        ordinal_fit.fit(twice)


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_odds_are_claimed_no_more_often_than_alpha() -> None:
    """In studies without a difference, at the size of the published one."""
    alarms = 0
    for seed in range(250):
        table = episodes_of(World(), seed)[1].filter(pl.col("question") == "efficiency")
        alarms += select(ordinal.ordinal_rows(table, CONDITIONS), contrast="tom - none")[0].p < 0.05
    assert alarms <= stats.binom.ppf(0.9995, 250, 0.05)
