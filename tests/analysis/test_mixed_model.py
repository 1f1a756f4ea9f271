"""The mixed model compared with an exact fit by brute force, in the case in which a gradient method stops too early."""

import math
from itertools import product

import numpy as np
import polars as pl
import pytest
from scipy import stats
from statsmodels.regression.mixed_linear_model import MixedLM

from analysis import mixed_model, mixed_model_fit
from analysis.mixed_model_fit import Data, FitError
from analysis.results import Result, select
from tests.support.parameters import mostly_slow

PERSON_SD, RESIDUAL_SD, ARM = 8.0, 25.0, 29
CONDITIONS = ("none", "tom")
LAYOUTS = ("coordination_ring", "double_rings", "double_counters", "matrix", "clear_division")
AGENTS = ("sp", "fcp")
SIZE = len(LAYOUTS) * len(AGENTS)


def study(seed: int, effect: float = 8.0, arm: int = ARM, conditions: tuple[str, ...] = CONDITIONS) -> pl.DataFrame:
    generator = np.random.default_rng(seed)
    rows = []
    for condition, person in product(conditions, range(arm)):
        talent = 70 + generator.normal(0, PERSON_SD) + (effect if condition == "tom" else 0)
        for agent, layout in product(AGENTS, LAYOUTS):
            reward = talent + 10 * LAYOUTS.index(layout) + generator.normal(0, RESIDUAL_SD)
            rows.append((f"{condition}{person}", condition, layout, agent, reward))
    return pl.DataFrame(rows, schema=["participant", "condition", "layout", "agent", "reward"], orient="row")


def columns_of(episodes: pl.DataFrame, interaction: bool = False) -> np.ndarray:
    """Intercept, ToM, agent, layouts, and ToM by layout, written out."""
    tom = episodes["condition"].to_numpy() == "tom"
    layouts = [episodes["layout"].to_numpy() == layout for layout in LAYOUTS[1:]]
    parts = [np.ones(episodes.height), tom, episodes["agent"].to_numpy() == "fcp", *layouts]
    parts += [tom & layout for layout in layouts] if interaction else []
    return np.stack(parts, axis=1).astype(float)


def dense(episodes: pl.DataFrame, columns: np.ndarray, restricted: bool) -> tuple[float, np.ndarray, np.ndarray]:
    """Log-likelihood, estimates and their covariance with the whole covariance matrix inverted for every ratio of the
    variances on a grid that is made finer three times around its best point."""
    y, people = episodes["reward"].to_numpy(), episodes["participant"].to_numpy()
    same = (people[:, None] == people[None, :]).astype(float)
    count = len(y) - (columns.shape[1] if restricted else 0)

    def at(ratio: float) -> tuple[float, np.ndarray, np.ndarray]:
        whole = np.eye(len(y)) + ratio * same
        inverse = np.linalg.inv(whole)
        inner = columns.T @ inverse @ columns
        beta = np.linalg.solve(inner, columns.T @ inverse @ y)
        rest = y - columns @ beta
        scale = rest @ inverse @ rest / count
        value = count * (math.log(2 * math.pi * scale) + 1) + np.linalg.slogdet(whole)[1]
        value += np.linalg.slogdet(inner)[1] if restricted else 0.0
        return -0.5 * value, beta, np.linalg.inv(inner) * scale

    low, high = 0.0, 2.0
    for _ in range(5):
        grid = np.linspace(low, high, 9)
        best = int(np.argmax([at(ratio)[0] for ratio in grid]))
        low, high = grid[max(0, best - 1)], grid[min(8, best + 1)]
    return at((low + high) / 2 if low else float(grid[best]))


@pytest.mark.parametrize("seed", mostly_slow(range(2)))
def test_the_difference_and_its_error_are_those_of_exact_reml(seed: int) -> None:
    episodes = study(seed)
    row = select(mixed_model.fit(episodes, "reward", CONDITIONS).rows, test="fixed_effect")[0]
    _, beta, covariance = dense(episodes, columns_of(episodes), restricted=True)
    assert row.estimate == pytest.approx(beta[1], abs=1e-6)
    assert row.se == pytest.approx(math.sqrt(covariance[1, 1]), rel=2e-3)


@pytest.mark.slow
def test_the_interaction_is_that_of_exact_maximum_likelihood() -> None:
    episodes = study(0)
    row = select(mixed_model.fit(episodes, "reward", CONDITIONS).rows, test="condition_by_layout")[0]
    plain, full = (dense(episodes, columns_of(episodes, interaction), False)[0] for interaction in (False, True))
    assert row.statistic == pytest.approx(2 * (full - plain), abs=0.01)


def anova_se(episodes: pl.DataFrame) -> float:
    """The exact error of a balanced study, in closed form: of REML it is the analysis of variance of person means,
    or of everything where people vary less than their own episodes say."""
    columns = columns_of(episodes)
    y = episodes["reward"].to_numpy()
    means = y.reshape(-1, SIZE).mean(axis=1)  # people in the order of their rows
    tom = columns[::SIZE, 1] == 1
    between = sum(((group - group.mean()) ** 2).sum() for group in (means[tom], means[~tom])) * SIZE
    own = y - np.repeat(means, SIZE)
    places = columns[:, 2:] - columns[:, 2:].mean(axis=0)
    within = float(np.linalg.lstsq(places, own, rcond=None)[1][0])
    df_between, df_within = len(means) - 2, len(y) - len(means) - places.shape[1]
    if between / df_between >= within / df_within:
        mean_square = between / df_between
    else:
        mean_square = (between + within) / (df_between + df_within)
    return math.sqrt(mean_square / SIZE * (1 / tom.sum() + 1 / (~tom).sum()))


def test_every_fit_of_fifty_is_exact_where_there_are_closed_formulas() -> None:
    for seed in range(50):
        episodes = study(seed)
        row = select(mixed_model.fit(episodes, "reward", CONDITIONS).rows, test="fixed_effect")[0]
        assert row.se == pytest.approx(anova_se(episodes), rel=3e-5), seed


@pytest.mark.slow
def test_the_brute_force_and_the_closed_formula_agree() -> None:
    episodes = study(1)
    covariance = dense(episodes, columns_of(episodes), restricted=True)[2]
    assert math.sqrt(covariance[1, 1]) == pytest.approx(anova_se(episodes), rel=2e-3)


def test_degrees_of_freedom_of_a_balanced_study_are_people_minus_conditions() -> None:
    for seed, arm in product(range(3), (4, ARM)):
        episodes = study(seed, arm=arm)
        row = select(mixed_model.fit(episodes, "reward", CONDITIONS).rows, test="fixed_effect")[0]
        assert row.statistic_name == "t"
        assert row.df == pytest.approx(2 * arm - 2, rel=1e-4)
        assert row.p == pytest.approx(2 * stats.t.sf(abs(row.statistic), row.df))
        assert row.estimate_high - row.estimate == pytest.approx(stats.t.ppf(0.975, row.df) * row.se)


def test_degrees_of_freedom_are_satterthwaites_also_where_episodes_are_missing() -> None:
    """Against the definition, with dense matrices and derivatives written out."""
    episodes = study(3, arm=6).filter(pl.int_range(pl.len()) % 7 > 0)
    columns, y = columns_of(episodes), episodes["reward"].to_numpy()
    names, person = np.unique(episodes["participant"].to_numpy(), return_inverse=True)
    fitted = mixed_model_fit.fit(Data(y, columns, person))
    member = (person[:, None] == np.arange(len(names))[None, :]).astype(float)
    parts = (member @ member.T, np.eye(len(y)))
    whole = np.linalg.inv(fitted.between * parts[0] + fitted.within * parts[1])
    covariance = np.linalg.inv(columns.T @ whole @ columns)
    left = whole - whole @ columns @ covariance @ columns.T @ whole
    information = np.array([[0.5 * np.trace(left @ one @ left @ other) for other in parts] for one in parts])
    weights = np.eye(columns.shape[1])[1]
    slope = np.array(
        [weights @ covariance @ columns.T @ whole @ one @ whole @ columns @ covariance @ weights for one in parts]
    )
    variance = weights @ covariance @ weights
    by_hand = 2 * variance**2 / (slope @ np.linalg.solve(information, slope))
    assert fitted.degrees(weights) == pytest.approx(by_hand, rel=1e-6)
    assert fitted.covariance == pytest.approx(covariance, rel=1e-6)


def test_an_unbalanced_fit_has_no_smaller_likelihood_than_statsmodels_finds() -> None:
    for seed in range(5):
        episodes = study(seed, arm=12).filter(pl.int_range(pl.len()) % 9 > 0)
        columns, y = columns_of(episodes), episodes["reward"].to_numpy()
        _, person = np.unique(episodes["participant"].to_numpy(), return_inverse=True)
        ours = mixed_model_fit.fit(Data(y, columns, person))
        theirs = MixedLM(y, columns, person).fit(reml=True, method="powell")
        assert ours.log_likelihood >= theirs.llf - 1e-6
        assert ours.beta == pytest.approx(np.asarray(theirs.fe_params), abs=0.05)
        assert ours.residuals.std() == pytest.approx(np.asarray(theirs.resid).std(), rel=0.02)


def reasons(model: mixed_model.MixedModel) -> list[str]:
    return [row.note for row in model.rows]


def flat(episodes: pl.DataFrame, reward: pl.Expr) -> pl.DataFrame:
    return episodes.with_columns(reward=reward)


def test_rewards_that_do_not_vary_give_a_reason() -> None:
    episodes = study(1)
    for reward in (pl.lit(0.0), pl.lit(20.0), pl.when(pl.col("condition") == "tom").then(20.0).otherwise(0.0)):
        model = mixed_model.fit(flat(episodes, reward), "reward", CONDITIONS)
        assert model.variance is None
        assert reasons(model) == ["could not be fitted: nothing varies apart from the effects"]


def test_people_who_always_earn_the_same_give_a_reason() -> None:
    episodes = study(1)
    same = flat(episodes, pl.col("reward").mean().over("participant"))
    assert "nothing varies between the episodes of a person" in reasons(mixed_model.fit(same, "reward", CONDITIONS))[0]


def test_conditions_that_played_with_different_agents_give_a_reason() -> None:
    episodes = study(1).filter((pl.col("condition") == "tom") == (pl.col("agent") == "sp"))
    assert "cannot be separated" in reasons(mixed_model.fit(episodes, "reward", CONDITIONS))[0]


def test_a_search_that_does_not_settle_gives_a_reason_and_no_variance(monkeypatch: pytest.MonkeyPatch) -> None:
    def unsettled(*_: object) -> float:
        raise FitError("the search for its variances did not converge")

    monkeypatch.setattr(mixed_model_fit, "best_ratio", unsettled)
    model = mixed_model.fit(study(1), "reward", CONDITIONS)
    assert model.variance is None
    assert model.residuals.size == 0
    assert [row.test for row in model.rows] == ["fixed_effect"]
    assert isinstance(model.rows[0], Result)
    assert "did not converge" in model.rows[0].note
