"""Checks on the mixed model: cluster-robust errors, random slopes, rounds and simple effects."""

import math
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from scipy import linalg, stats
from statsmodels.regression.linear_model import OLS
from statsmodels.regression.mixed_linear_model import MixedLM

from analysis import mixed_model, model_checks, random_slopes
from analysis.compare import adjust
from analysis.mixed_model_fit import Data
from analysis.results import Result, select
from analysis.robustness_text import check_sentences
from tests.support.simulation import AGENTS, CONDITIONS, LAYOUTS, World, episodes_of

TOM = "tom - none"


@pytest.fixture(scope="module")
def episodes() -> pl.DataFrame:
    """An unbalanced study with rounds in which people learn, ToM more, and each has an own liking of the agents."""
    table = episodes_of(World(arm=12, effect=(10.0,) * 5, missing=0.1), 7)[0]
    generator = np.random.default_rng(5)
    chance = pl.Series("chance", generator.random(table.height))
    number = table.with_columns(chance).select(pl.col("chance").rank("ordinal").over("participant")).to_series()
    _, person = np.unique(table["participant"].to_numpy(), return_inverse=True)
    liking = 12 * generator.normal(size=person.max() + 1)[person] * (table["agent"] == "fcp").to_numpy()
    learning = number.to_numpy() * np.where((table["condition"] == "tom").to_numpy(), 3.0, 1.0)
    return table.with_columns(number=number, reward=table["reward"] + pl.Series(liking + learning))


@pytest.fixture(scope="module")
def rows(episodes: pl.DataFrame) -> list[Result]:
    return model_checks.model_rows(episodes, CONDITIONS)


def columns(episodes: pl.DataFrame) -> np.ndarray:
    """Intercept, random, tom, fcp and four layouts, written out."""
    parts = [episodes["condition"] == name for name in ("random", "tom")]
    parts += [episodes["agent"] == "fcp", *(episodes["layout"] == name for name in LAYOUTS[1:])]
    return np.stack([np.ones(episodes.height), *(part.to_numpy() for part in parts)], axis=1).astype(float)


def people(episodes: pl.DataFrame) -> np.ndarray:
    return np.unique(episodes["participant"].to_numpy(), return_inverse=True)[1]


def by_whole_matrices(y: np.ndarray, x: np.ndarray, person: np.ndarray, weights: np.ndarray) -> tuple[float, float]:
    """Standard error and degrees of freedom of CR2, with every matrix written out (Pustejovsky and Tipton 2018)."""
    leverage = x @ np.linalg.pinv(x)
    left = np.eye(len(y)) - leverage
    along = x @ np.linalg.inv(x.T @ x) @ weights
    parts = []
    for number in range(person.max() + 1):
        own = person == number
        root = linalg.fractional_matrix_power(left[np.ix_(own, own)], -0.5).real
        parts.append(left[own].T @ root @ along[own])
    forms = np.stack(parts, axis=1)  # (episodes, people): the squares of e'p add up to the variance
    whole = forms @ forms.T
    return float(np.sqrt(y @ whole @ y)), float(np.trace(whole) ** 2 / np.trace(whole @ whole))


def test_cluster_robust_errors_are_those_of_bell_and_mccaffrey(episodes: pl.DataFrame, rows: list[Result]) -> None:
    y, x, person = episodes["reward"].to_numpy(), columns(episodes), people(episodes)
    theirs = OLS(y, x).fit(cov_type="cluster", cov_kwds={"groups": person}, use_t=True)
    weights = {TOM: np.eye(8)[2], "tom - random": np.eye(8)[2] - np.eye(8)[1], "random - none": np.eye(8)[1]}
    for row in select(rows, test="cluster_robust"):
        se, df = by_whole_matrices(y, x, person, weights[row.contrast])
        assert (row.estimate, row.se, row.df) == pytest.approx((weights[row.contrast] @ theirs.params, se, df))
        assert row.p == pytest.approx(2 * stats.t.sf(abs(row.estimate / se), df))
        plain = float(np.squeeze(theirs.t_test(weights[row.contrast]).sd))
        assert plain < row.se < 1.1 * plain  # 36 people: a small correction


def test_a_person_who_alone_has_a_layout_does_not_break_the_correction(episodes: pl.DataFrame) -> None:
    alone = episodes.filter((pl.col("layout") != "matrix") | (pl.col("participant") == episodes["participant"][0]))
    row = select(model_checks.model_rows(alone, CONDITIONS), test="cluster_robust", contrast=TOM)[0]
    assert row.se > 0
    assert 1 < row.df < 36


def test_random_slopes_are_no_worse_than_statsmodels(episodes: pl.DataFrame, rows: list[Result]) -> None:
    x, own = columns(episodes), columns(episodes)[:, [0, 3]]
    y, person = episodes["reward"].to_numpy(), people(episodes)
    ours = random_slopes.fit(Data(y, x, person), own)
    theirs = MixedLM(y, x, person, exog_re=own).fit(reml=True, method=["powell", "bfgs"])
    assert ours.log_likelihood >= theirs.llf - 1e-4
    assert ours.beta == pytest.approx(np.asarray(theirs.fe_params), abs=0.15)
    assert np.sqrt(np.diag(ours.covariance)) == pytest.approx(np.asarray(theirs.bse_fe), rel=0.03)
    assert ours.between == pytest.approx(np.asarray(theirs.cov_re), rel=0.2, abs=15)
    tom = select(rows, test="random_slopes", contrast=TOM)[0]
    assert tom.estimate == pytest.approx(ours.beta[2])
    assert tom.se == pytest.approx(math.sqrt(ours.covariance[2, 2]))
    assert tom.df == 33
    assert select(rows, test="slope_sd")[0].estimate == pytest.approx(math.sqrt(ours.between[1, 1]), abs=1.5)


def dense(y: np.ndarray, x: np.ndarray, person: np.ndarray, own: np.ndarray, fitted: random_slopes.SlopesFit) -> float:
    """The restricted log likelihood at the estimates, with the whole covariance matrix written out."""
    same = person[:, None] == person[None, :]
    whole = fitted.within * np.eye(len(y)) + same * (own @ fitted.between @ own.T)
    inverse = np.linalg.inv(whole)
    inner = x.T @ inverse @ x
    rest = y - x @ np.linalg.solve(inner, x.T @ inverse @ y)
    value = (len(y) - x.shape[1]) * math.log(2 * math.pi) + np.linalg.slogdet(whole)[1]
    return float(-0.5 * (value + np.linalg.slogdet(inner)[1] + rest @ inverse @ rest))


def test_the_likelihood_of_random_slopes_is_that_of_the_whole_matrix(episodes: pl.DataFrame) -> None:
    few = episodes.filter(pl.col("participant") < "p0016")
    keep = np.linalg.matrix_rank(columns(few)[:, [0, 1, 3, 4, 5, 6, 7]])
    x = columns(few)[:, [0, 1, 3, 4, 5, 6, 7]]
    assert keep == 7
    y, person, own = few["reward"].to_numpy(), people(few), x[:, [0, 2]]
    fitted = random_slopes.fit(Data(y, x, person), own)
    assert fitted.log_likelihood == pytest.approx(dense(y, x, person, own, fitted), abs=1e-6)


def test_rounds_are_a_covariate(episodes: pl.DataFrame, rows: list[Result]) -> None:
    number = episodes["number"].to_numpy().astype(float)
    x = np.column_stack([columns(episodes), number - number.mean()])
    y, person = episodes["reward"].to_numpy(), people(episodes)
    theirs = MixedLM(y, x, person).fit(reml=True, method=["powell", "bfgs"])
    tom = select(rows, test="with_round", contrast=TOM)[0]
    assert (tom.estimate, tom.se) == pytest.approx((theirs.fe_params[2], theirs.bse_fe[2]), rel=0.01)


def test_people_have_slopes_of_their_own_where_learning_is_tested(episodes: pl.DataFrame, rows: list[Result]) -> None:
    number = episodes["number"].to_numpy().astype(float)
    rounds = number - number.mean()
    x = np.column_stack([columns(episodes), rounds])
    y, person = episodes["reward"].to_numpy(), people(episodes)
    own = np.column_stack([np.ones(rounds.size), rounds / rounds.std()])
    theirs = MixedLM(y, x, person, exog_re=own).fit(reml=True, method=["powell", "bfgs"])
    slope = select(rows, test="round")[0]
    assert (slope.estimate, slope.se) == pytest.approx((theirs.fe_params[8], theirs.bse_fe[8]), rel=0.03)
    product = (x[:, 1:3].T * x[:, 8]).T
    theirs = MixedLM(y, np.column_stack([x, product]), person, exog_re=own).fit(reml=True, method=["powell", "bfgs"])
    faster = select(rows, test="round_by_condition", contrast=TOM)[0]
    assert (faster.estimate, faster.se) == pytest.approx((theirs.fe_params[10], theirs.bse_fe[10]), rel=0.03)
    assert faster.estimate == pytest.approx(2, abs=1.5)  # as planted
    assert slope.df == faster.df == 33


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_unequal_speeds_of_learning_are_rarely_taken_for_an_effect_of_the_condition() -> None:
    """Few people who learn at different speeds, whatever the condition."""
    alarms = dict.fromkeys(("cluster_robust", "round", "round_by_condition"), 0)
    for seed in range(300):
        table = episodes_of(World(arm=6), seed)[0].with_columns(number=pl.int_range(pl.len()) % 10 + 1)
        speed = np.random.default_rng(seed).normal(0, 3, 12)[people(table.filter(pl.col("condition") != "random"))]
        table = table.filter(pl.col("condition") != "random")
        table = table.with_columns(reward=pl.col("reward") + pl.Series(speed) * (pl.col("number") - 5.5))
        for row in model_checks.model_rows(table, ("none", "tom")):
            if row.test in alarms:
                alarms[row.test] += row.p < 0.05
    assert all(count <= stats.binom.ppf(0.9995, 300, 0.05) for count in alarms.values()), alarms


def test_simple_effects_are_t_tests_over_people(episodes: pl.DataFrame) -> None:
    rows = model_checks.simple_effects(episodes, ("tom", "none"), LAYOUTS, AGENTS)
    assert [(row.layout, row.agent) for row in rows] == [
        *((name, "all") for name in LAYOUTS), ("all", "sp"), ("all", "fcp"),
    ]  # fmt: skip
    matrix = episodes.filter(pl.col("layout") == "matrix").group_by("participant", "condition").agg(pl.mean("reward"))
    arms = [matrix.filter(pl.col("condition") == name)["reward"].to_numpy() for name in ("tom", "none")]
    t, p = stats.ttest_ind(*arms)
    row = next(row for row in rows if row.layout == "matrix")
    assert (row.statistic, row.p) == pytest.approx((t, p))
    corrected = stats.false_discovery_control([one.p for one in rows[:5]])
    assert [one.p_adjusted for one in rows[:5]] == pytest.approx(list(corrected))
    assert repr(rows[:5]) == repr(adjust(rows[:5]))  # what does not apply is NaN, which equals nothing


def test_one_layout_or_agent_has_no_simple_effects(episodes: pl.DataFrame) -> None:
    rows = model_checks.simple_effects(episodes, ("tom", "none"), LAYOUTS[:1], AGENTS)
    assert {row.layout for row in rows} == {"all"}


def test_checks_that_cannot_be_computed_give_a_reason(episodes: pl.DataFrame) -> None:
    one = episodes.filter(pl.col("condition") == "tom")
    (row,) = model_checks.model_rows(one, CONDITIONS)
    assert "needs two conditions" in row.note
    mixed = episodes.filter((pl.col("condition") == "tom") == (pl.col("agent") == "sp"))
    notes = {row.test: row.note for row in model_checks.model_rows(mixed, ("none", "tom"))}
    assert all("cannot be separated" in notes[test] for test in ("cluster_robust", "random_slopes"))
    same = episodes.with_columns(number=pl.col("layout").replace_strict({name: i for i, name in enumerate(LAYOUTS)}))
    notes = {row.test: row.note for row in model_checks.model_rows(same, CONDITIONS)}
    assert "came in the same order for all" in notes["with_round"]
    alone = episodes.filter(pl.col("agent") == "sp")
    notes = {row.test: row.note for row in model_checks.model_rows(alone, CONDITIONS)}
    assert notes["random_slopes"] == "needs two agents"
    constant = episodes.with_columns(reward=pl.lit(20.0))
    assert all(math.isnan(row.p) and row.note for row in model_checks.model_rows(constant, CONDITIONS))


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_false_alarms_of_the_checks_are_as_rare_as_alpha() -> None:
    """Clusters and slopes hold their level where episodes of a person are alike; thirty people an arm."""
    alarms = dict.fromkeys(("cluster_robust", "random_slopes"), 0)
    for seed in range(400):
        table = episodes_of(World(arm=30), seed)[0].with_columns(number=pl.int_range(pl.len()) % 10 + 1)
        for row in model_checks.model_rows(table, ("none", "tom")):
            if row.test in alarms:
                alarms[row.test] += row.p < 0.05
    assert all(count <= stats.binom.ppf(0.9995, 400, 0.05) for count in alarms.values()), alarms


def test_the_effects_of_the_checks_are_those_of_the_mixed_model(episodes: pl.DataFrame, rows: list[Result]) -> None:
    plain = select(mixed_model.fit(episodes, "reward", CONDITIONS).rows, test="fixed_effect")
    for test in ("cluster_robust", "random_slopes", "with_round"):
        for ours, theirs in zip(select(rows, test=test), plain, strict=True):
            assert ours.contrast == theirs.contrast
            assert ours.estimate == pytest.approx(theirs.estimate, abs=theirs.se)


def test_sentences_of_the_checks_agree_with_the_results(rows: list[Result]) -> None:
    plain = Result("mixed model", "fixed_effect", contrast=TOM, estimate=20.0, p=0.001)
    (models, learning) = check_sentences(("tom", "none"), [plain, *rows])
    assert "between ToM predictions and no prediction was +" in models
    assert "; the conclusion of the mixed model holds in all of them." in models
    assert learning.startswith("Reward changed from round to round (+")
    assert "; this did not differ significantly between ToM predictions and no prediction (+" in learning
    doubt = [replace(row, p=0.2) if row.test == "random_slopes" else row for row in rows]
    assert (
        "does not hold with a random slope of the agent for each person."
        in (check_sentences(("tom", "none"), [plain, *doubt])[0])
    )


@pytest.mark.parametrize(("p", "said"), [(0.01, True), (0.4, False)])
def test_simple_effects_are_reported_after_an_interaction_only(p: float, said: bool, episodes: pl.DataFrame) -> None:
    simple = model_checks.simple_effects(episodes, ("tom", "none"), LAYOUTS, AGENTS)
    interaction = Result("reward", "contrast_by_layout", p=p, p_adjusted=p)
    found = check_sentences(("tom", "none"), [interaction, *simple])
    assert len(found) == said
    assert all("depended on the layout, simple effects over people: +" in text for text in found)


def test_the_sentence_about_ordered_categories_names_what_differed() -> None:
    row = Result("ordinal", "odds", question="efficiency", contrast=TOM, effect=2.5, p=0.001, p_adjusted=0.004)
    (text,) = check_sentences(("tom", "none"), [row, replace(row, p=0.5, p_adjusted=0.5)])
    assert "correction over 2 comparisons, these differed" in text
    assert "“Efficiency of cooperation” ToM predictions against no prediction (odds ratio 2.50, corrected" in text
    (text,) = check_sentences(("tom", "none"), [replace(row, p=0.5, p_adjusted=0.5)])
    assert text.endswith("none differed significantly.")
