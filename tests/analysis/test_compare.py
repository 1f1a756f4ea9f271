"""The paper's tests on tables: compared with formulas computed by hand, with a simulated effect, and without an
effect.
"""

import math
from itertools import product

import numpy as np
import polars as pl
import pytest
from scipy import optimize, stats

from analysis import compare, measures, mixed_model, questionnaires, ranks
from analysis.assumptions import check
from analysis.groups import cells
from analysis.results import select
from analysis.tables import Export

CONDITIONS = ("none", "random", "tom")
LAYOUTS = ("coordination_ring", "matrix")
AGENTS = ("sp", "fcp")


def study(seed: int, effect: float = 0.0, people: int = 10, person_sd: float = 8.0) -> pl.DataFrame:
    """A balanced study with `effect` points for tom: a row per episode."""
    generator = np.random.default_rng(seed)
    rows = []
    for condition, person in product(CONDITIONS, range(people)):
        talent = generator.normal(70, person_sd) + (effect if condition == "tom" else 0)
        for agent, layout in product(AGENTS, LAYOUTS):
            rows.append((f"{condition}{person}", condition, layout, agent, talent + generator.normal(0, 10)))
    return pl.DataFrame(rows, schema=["participant", "condition", "layout", "agent", "reward"], orient="row")


def values(episodes: pl.DataFrame, **where: str) -> np.ndarray:
    for column, value in where.items():
        episodes = episodes.filter(pl.col(column) == value)
    return episodes["reward"].to_numpy()


def test_means_are_over_episodes_and_for_all_layouts_over_people() -> None:
    episodes = study(1)
    rows = compare.means(episodes, "reward", CONDITIONS, [("matrix", "sp"), ("all", "sp")], "reward")
    row = select(rows, layout="matrix", condition="tom")[0]
    by_hand = values(episodes, layout="matrix", agent="sp", condition="tom")
    assert (row.n, row.estimate) == (10, pytest.approx(sum(by_hand) / 10))
    assert row.se == pytest.approx(math.sqrt(sum((by_hand - by_hand.mean()) ** 2) / 9 / 10))
    of_people = values(episodes, agent="sp", condition="tom").reshape(10, 2).mean(axis=1)
    total = select(rows, layout="all", condition="tom")[0]
    assert (total.n, total.unit, total.se) == (10, "people", pytest.approx(of_people.std(ddof=1) / math.sqrt(10)))


def test_kruskal_wallis_is_the_rank_formula_over_all_episodes_of_an_agent() -> None:
    episodes = study(2, effect=6)
    row = select(ranks.kruskal_wallis(episodes, "reward", CONDITIONS, AGENTS, draws=200), test="kruskal_wallis")[0]
    groups = [values(episodes, agent="sp", condition=name) for name in CONDITIONS]
    ranked = stats.rankdata(np.concatenate(groups)).reshape(3, 20)
    h = 12 / (60 * 61) * sum(group.sum() ** 2 / 20 for group in ranked) - 3 * 61
    assert (row.statistic, row.df, row.n) == (pytest.approx(h), 2, 60)
    assert row.p == pytest.approx(math.exp(-h / 2))  # chi-squared with two degrees of freedom
    assert row.effect == pytest.approx(h / 59)
    assert row.ci_low < row.effect < row.ci_high


def test_people_are_permuted_whole() -> None:
    """Two people a condition can be dealt in 90 ways; three conditions may swap names: 6 of them are as extreme."""
    rows = [
        (f"{name}{person}", name, 100 * place + person + day)
        for place, name in enumerate(CONDITIONS)
        for person in range(2)
        for day in (0.0, 0.25, 0.5)
    ]
    episodes = pl.DataFrame(rows, schema=["participant", "condition", "reward"], orient="row")
    episodes = episodes.with_columns(agent=pl.lit("sp"))
    row = select(
        ranks.kruskal_wallis(episodes, "reward", CONDITIONS, ("sp",), draws=4000), test="kruskal_wallis_people"
    )
    assert row[0].p == pytest.approx(6 / 90, abs=0.015)


def test_people_are_not_permuted_where_a_condition_has_a_single_person() -> None:
    """Every permutation of one person each is like the observed one, so that p is 1 whatever the difference."""
    episodes = study(3, effect=90.0, people=1)
    rows = ranks.kruskal_wallis(episodes, "reward", CONDITIONS, ("sp", "fcp"), draws=50)
    assert not any(np.isnan(row.p) for row in select(rows, test="kruskal_wallis"))
    people = select(rows, test="kruskal_wallis_people")
    assert [(row.agent, row.n, row.note) for row in people] == [
        (agent, 3, "fewer than two people in a condition") for agent in ("sp", "fcp")
    ]
    assert all(np.isnan(row.p) for row in people)


def test_a_difference_known_with_a_single_agent_is_not_said_to_be_the_same_with_all() -> None:
    episodes = study(3, effect=20.0).filter(~((pl.col("condition") == "tom") & (pl.col("agent") == "fcp")))
    layout, agent = ranks.dependence(episodes, "reward", ("tom", "none"), ("layout", "agent"), 50, 1)
    assert np.isfinite(layout.p)
    assert layout.p_adjusted == layout.p, "a family of one"
    assert (agent.test, agent.note) == ("contrast_by_agent", "fewer than two with episodes in both conditions")
    assert np.isnan(agent.p)


def test_anova_is_the_ratio_of_mean_squares() -> None:
    episodes = study(3, effect=5)
    rows = list(compare.anova(episodes, "reward", CONDITIONS, [("matrix", "fcp")]))
    groups = [values(episodes, layout="matrix", agent="fcp", condition=name) for name in CONDITIONS]
    grand = np.concatenate(groups).mean()
    between = sum(10 * (group.mean() - grand) ** 2 for group in groups) / 2
    within = sum(((group - group.mean()) ** 2).sum() for group in groups) / 27
    row = select(rows, test="anova")[0]
    assert (row.statistic, row.df, row.df_residual) == (pytest.approx(between / within), 2, 27)
    assert row.p == pytest.approx(stats.f.sf(between / within, 2, 27))
    assert row.effect == pytest.approx(between * 2 / (between * 2 + within * 27))


def test_welch_anova_is_welchs_formula() -> None:
    episodes = study(4)
    row = select(list(compare.anova(episodes, "reward", CONDITIONS, [("matrix", "fcp")])), test="welch_anova")[0]
    groups = [values(episodes, layout="matrix", agent="fcp", condition=name) for name in CONDITIONS]
    weights = np.array([group.size / group.var(ddof=1) for group in groups])
    means = np.array([group.mean() for group in groups])
    grand = (weights * means).sum() / weights.sum()
    spread = sum((1 - weight / weights.sum()) ** 2 / 9 for weight in weights)
    f = (weights * (means - grand) ** 2).sum() / 2 / (1 + 2 / 8 * spread)
    assert (row.statistic, row.df_residual) == (pytest.approx(f), pytest.approx(8 / (3 * spread)))
    assert row.p == pytest.approx(stats.f.sf(f, 2, 8 / (3 * spread)))


def test_each_comparison_is_one_family_over_layouts_and_agents() -> None:
    episodes = study(5, effect=9)
    rows = compare.pairwise(episodes, "reward", CONDITIONS, cells(LAYOUTS, AGENTS))
    family = select(rows, test="t_test", contrast="tom - none")
    assert [row.contrast for row in rows[::4]][::3] == ["tom - none", "tom - random", "random - none"]
    by_hand = []
    for agent, layout in product(AGENTS, LAYOUTS):
        first, second = (values(episodes, layout=layout, agent=agent, condition=name) for name in ("tom", "none"))
        spread = math.sqrt((first.var(ddof=1) + second.var(ddof=1)) / 2)
        by_hand.append((first.mean() - second.mean()) / (spread * math.sqrt(2 / 10)))
    assert [row.statistic for row in family] == pytest.approx(by_hand)
    p = sorted(2 * stats.t.sf(abs(np.array(by_hand)), 18))
    adjusted = [min(p[later] * 4 / (later + 1) for later in range(rank, 4)) for rank in range(4)]
    assert sorted(row.p_adjusted for row in family) == pytest.approx(adjusted)


def test_a_planted_effect_is_found_and_only_there(planted: Export) -> None:
    episodes = measures.analysed(measures.episode_measures(planted), planted.participants)
    rows = ranks.kruskal_wallis(episodes, "reward", CONDITIONS, AGENTS, draws=500)
    assert all(row.p < 0.01 for row in rows)
    places = cells(planted.layouts, planted.agents)
    pairs = compare.pairwise(episodes, "reward", CONDITIONS, places)
    helped = select(pairs, test="t_test", contrast="tom - none")
    assert sum(row.p_adjusted < 0.05 for row in helped) >= 8
    assert np.mean([row.estimate for row in helped]) == pytest.approx(22, abs=6)
    assert sum(row.p_adjusted < 0.05 for row in select(pairs, test="t_test", contrast="random - none")) <= 1


def test_without_an_effect_tests_are_significant_about_as_often_as_alpha_says() -> None:
    p = [
        row.p
        for seed in range(60)
        for row in compare.pairwise(study(1000 + seed), "reward", ("none", "tom"), cells(LAYOUTS, AGENTS))
        if row.test == "t_test"
    ]
    assert len(p) == 240
    assert 0.01 <= np.mean(np.array(p) < 0.05) <= 0.1
    assert np.mean(p) == pytest.approx(0.5, abs=0.08)


def test_permuting_people_keeps_alpha_where_episodes_of_a_person_are_alike() -> None:
    plain, people = [], []
    for seed in range(60):
        episodes = study(2000 + seed, person_sd=25)
        rows = ranks.kruskal_wallis(episodes, "reward", CONDITIONS, ("all",), draws=99)
        plain.append(rows[0].p < 0.05)
        people.append(rows[1].p < 0.05)
    assert np.mean(plain) > 0.2  # the published test takes 120 episodes for 120 people
    assert np.mean(people) <= 0.12


def test_the_mixed_model_of_a_balanced_study_is_the_analysis_of_person_means() -> None:
    episodes = study(6, effect=7)
    model = mixed_model.fit(episodes, "reward", CONDITIONS)
    of_people = episodes.group_by("participant", "condition", maintain_order=True).agg(pl.col("reward").mean())
    means = [of_people.filter(pl.col("condition") == name)["reward"].to_numpy() for name in CONDITIONS]
    between = sum(((group - group.mean()) ** 2).sum() for group in means) / 27  # variance of person means
    row = select(model.rows, contrast="tom - none")[0]
    assert row.estimate == pytest.approx(means[2].mean() - means[0].mean())
    assert row.se == pytest.approx(math.sqrt(2 * between / 10), rel=1e-3)
    reward = episodes["reward"].to_numpy().reshape(30, 4)  # (people, agents x layouts)
    agents = reward.reshape(30, 2, 2).mean(axis=(0, 2)) - reward.mean()
    layouts = reward.reshape(30, 2, 2).mean(axis=(0, 1)) - reward.mean()
    rest = reward - reward.mean(axis=1, keepdims=True) - (agents[:, None] + layouts[None, :]).reshape(4)
    within = (rest**2).sum() / (120 - 30 - 2)
    assert model.variance is not None
    assert model.variance.residual_sd == pytest.approx(math.sqrt(within), rel=1e-3)
    assert model.variance.person_sd == pytest.approx(math.sqrt(between - within / 4), rel=1e-3)
    assert select(model.rows, test="icc")[0].estimate == pytest.approx(
        (between - within / 4) / (between + within * 0.75), rel=1e-3
    )


def log_likelihood(reward: np.ndarray, columns: np.ndarray, size: int) -> float:
    """Of a random-intercept model at its maximum, written out: people are blocks of `size` rows."""

    def minus(log_ratio: float) -> float:
        block = np.eye(size) + math.exp(log_ratio) * np.ones((size, size))
        inverse, log_det = np.linalg.inv(block), np.linalg.slogdet(block)[1]
        x, y = columns.reshape(-1, size, columns.shape[1]), reward.reshape(-1, size)
        beta = np.linalg.solve(np.einsum("pia,ij,pjb->ab", x, inverse, x), np.einsum("pia,ij,pj->a", x, inverse, y))
        rest = y - x @ beta
        scale = np.einsum("pi,ij,pj->", rest, inverse, rest) / reward.size
        return 0.5 * (reward.size * (math.log(2 * math.pi * scale) + 1) + len(y) * log_det)

    return -float(optimize.minimize_scalar(minus, bounds=(-12, 6), method="bounded").fun)


def test_the_interaction_with_layouts_is_twice_the_gain_in_log_likelihood() -> None:
    episodes = study(7, effect=4)
    row = select(mixed_model.fit(episodes, "reward", CONDITIONS).rows, test="condition_by_layout")[0]
    one, tom, random = np.ones(120), *(episodes["condition"].to_numpy() == name for name in ("tom", "random"))
    fcp, matrix = episodes["agent"].to_numpy() == "fcp", episodes["layout"].to_numpy() == "matrix"
    plain = np.stack([one, tom, random, fcp, matrix], axis=1).astype(float)
    full = np.concatenate([plain, np.stack([tom & matrix, random & matrix], axis=1)], axis=1)
    reward = episodes["reward"].to_numpy()
    gain = 2 * (log_likelihood(reward, full, 4) - log_likelihood(reward, plain, 4))
    assert (row.df, row.statistic) == (2, pytest.approx(gain, abs=1e-3))
    assert row.p == pytest.approx(math.exp(-gain / 2), abs=1e-3)


def test_a_mixed_model_says_so_when_nothing_varies_between_people() -> None:
    model = mixed_model.fit(study(8, person_sd=0), "reward", CONDITIONS)
    assert model.variance is not None
    assert model.variance.person_sd < 5


@pytest.mark.parametrize(("conditions", "people"), [(("none",), 10), (CONDITIONS, 1)])
def test_too_little_data_gives_a_reason_instead_of_a_model(conditions: tuple[str, ...], people: int) -> None:
    episodes = study(9, people=people).filter(pl.col("condition").is_in(list(conditions)))
    model = mixed_model.fit(episodes, "reward", conditions)
    assert model.variance is None
    assert "needs two conditions" in model.rows[0].note


def test_assumptions_are_checked_within_conditions() -> None:
    episodes = study(10, effect=500)
    shapiro, levene = check(episodes, "reward", CONDITIONS, [("matrix", "sp")])
    groups = [values(episodes, layout="matrix", agent="sp", condition=name) for name in CONDITIONS]
    assert shapiro.p == pytest.approx(stats.shapiro(np.concatenate([group - group.mean() for group in groups])).pvalue)
    distances = [abs(group - np.median(group)) for group in groups]  # Levene is an ANOVA of distances from medians
    f, p = stats.f_oneway(*distances)
    assert (levene.statistic, levene.p, levene.df_residual) == (pytest.approx(f), pytest.approx(p), 27)


def test_checks_of_assumptions_name_the_conditions_that_they_leave_out() -> None:
    episodes = study(10)
    one = episodes.filter(pl.col("condition") == CONDITIONS[-1])["participant"].unique().sort()[:2]
    few = episodes.filter((pl.col("condition") != CONDITIONS[-1]) | pl.col("participant").is_in(one.implode()))
    for row in check(few, "reward", CONDITIONS, [("matrix", "sp")]):
        assert row.note == f"without {CONDITIONS[-1]}: fewer than 3 values"


def test_answers_are_compared_per_question_and_agent_on_the_chosen_layouts(planted: Export) -> None:
    episodes = measures.analysed(measures.episode_measures(planted), planted.participants)
    answers = questionnaires.answers_on(planted.answers, episodes, planted.layouts[:4])
    assert "clear_division" not in answers["layout"]
    rows = questionnaires.tests(answers, CONDITIONS, AGENTS)
    row = select(rows, test="t_test", agent="sp", question="efficiency", contrast="tom - random")[0]
    chosen = answers.filter((pl.col("agent") == "sp") & (pl.col("question") == "efficiency"))
    first, second = (chosen.filter(pl.col("condition") == name)["value"].to_numpy() for name in ("tom", "random"))
    n = first.size + second.size
    pooled = (((first - first.mean()) ** 2).sum() + ((second - second.mean()) ** 2).sum()) / (n - 2)
    t = (first.mean() - second.mean()) / math.sqrt(pooled * (1 / first.size + 1 / second.size))
    assert (row.df, row.statistic) == (n - 2, pytest.approx(t))
    people = select(rows, test="t_test_people", agent="sp", question="efficiency", contrast="tom - random")[0]
    assert (people.n, people.df) == (32, 30)
    assert row.p < 0.001
    assert people.p < 0.05


def test_nobody_is_compared_on_a_question_that_was_not_asked(planted: Export) -> None:
    episodes = measures.analysed(measures.episode_measures(planted), planted.participants)
    answers = questionnaires.answers_on(planted.answers, episodes, planted.layouts)
    rows = select(questionnaires.tests(answers, CONDITIONS, ("sp",)), test="t_test", question="predictor_satisfaction")
    assert [row.contrast for row in rows] == ["tom - random"]
    means = select(questionnaires.means(answers, CONDITIONS, ("sp",)), question="predictor_satisfaction")
    assert [row.condition for row in means] == ["random", "tom"]
