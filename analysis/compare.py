"""The paper's tests of reward, and beside each what a reviewer asks for. Tables of episodes in, Result rows out.

Expects the columns participant, condition, layout, agent and a measure; leaves out what the caller left out.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations, product

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy import stats
from statsmodels.stats.multitest import multipletests
from statsmodels.stats.oneway import anova_oneway

from analysis import effects
from analysis.results import Result

Values = NDArray[np.float64]
DRAWS = 2000
SEED = 20240101


def samples(episodes: pl.DataFrame, measure: str, conditions: Sequence[str], **where: str) -> dict[str, Values]:
    """The measure's values by condition, where the named columns equal the given values ("all": any)."""
    chosen = episodes.filter(pl.col(measure).is_not_null())
    for column, value in where.items():
        if value != "all":
            chosen = chosen.filter(pl.col(column) == value)
    parts = chosen.partition_by("condition", as_dict=True)
    return {
        name: parts[(name,)][measure].to_numpy().astype(np.float64) if (name,) in parts else np.empty(0)
        for name in conditions
    }


def cells(layouts: Sequence[str], agents: Sequence[str]) -> list[tuple[str, str]]:
    """(layout, agent) pairs in reporting order, agents outermost."""
    return [(layout, agent) for agent, layout in product(agents, layouts)]


def pairs(conditions: Sequence[str]) -> list[tuple[str, str]]:
    """Comparisons of conditions, later minus earlier: tom - none, tom - random, random - none."""
    return sorted(((second, first) for first, second in combinations(conditions, 2)), key=lambda pair: pair[0] != "tom")


def means(
    episodes: pl.DataFrame, measure: str, conditions: Sequence[str], places: Sequence[tuple[str, str]], section: str
) -> list[Result]:
    """Mean, standard error and 95 % interval in every condition at every (layout, agent); over the mean of every person
    where the layout is "all", since one person's episodes are not independent."""
    rows = []
    of_people = episodes.group_by("participant", "condition", "agent", maintain_order=True).agg(pl.col(measure).mean())
    for layout, agent in places:
        table, unit = (of_people, "people") if layout == "all" else (episodes, "episodes")
        for condition, values in samples(table, measure, conditions, layout=layout, agent=agent).items():
            if values.size:
                mean = effects.mean_interval(values)
                rows.append(
                    Result(
                        section,
                        "mean",
                        layout,
                        agent,
                        condition=condition,
                        estimate=mean.value,
                        estimate_low=mean.low,
                        estimate_high=mean.high,
                        se=effects.standard_error(values),
                        n=values.size,
                        unit=unit,
                        ci_level=mean.level,
                    )
                )
    return rows


def kruskal_wallis(
    episodes: pl.DataFrame, measure: str, conditions: Sequence[str], agents: Sequence[str], draws: int = DRAWS
) -> list[Result]:
    """One rank test per agent over the conditions, as published, with epsilon squared; and its p value when the
    conditions are permuted over whole people (`kruskal_wallis_people`), as a person's episodes are not independent."""
    rows = []
    for agent in agents:
        chosen = episodes if agent == "all" else episodes.filter(pl.col("agent") == agent)
        groups = [values for values in samples(chosen, measure, conditions).values() if values.size]
        base = Result("reward", "kruskal_wallis", "all", agent, n=sum(group.size for group in groups))
        if trouble := effects.can_compare(groups):
            rows.append(replace(base, note=trouble))
            continue
        h, p = stats.kruskal(*groups)
        low, high = _epsilon_interval(chosen, measure, draws // 2)
        base = replace(base, statistic_name="H", statistic=float(h), df=float(len(groups) - 1))
        rows.append(
            replace(
                base,
                p=float(p),
                effect_name="epsilon squared",
                effect=effects.epsilon_squared(float(h), base.n),
                ci_low=low,
                ci_high=high,
                ci_level=0.95,
                note="interval: people drawn again",
            )
        )
        permuted = _permuted_people(chosen, measure, draws)
        note = f"conditions permuted over people, {draws} draws"
        rows.append(replace(base, test="kruskal_wallis_people", p=permuted, note=note))
    return rows


def _by_person(episodes: pl.DataFrame, measure: str) -> tuple[Values, NDArray[np.int64], NDArray[np.int64]]:
    """Values, the person of each value, and the condition of each person, both as integers."""
    chosen = episodes.filter(pl.col(measure).is_not_null())
    people, person = np.unique(chosen["participant"].to_numpy(), return_inverse=True)
    _, condition = np.unique(chosen["condition"].to_numpy(), return_inverse=True)
    of_person = np.zeros(people.size, dtype=np.int64)
    of_person[person] = condition
    return chosen[measure].to_numpy().astype(np.float64), person, of_person


def _rank_spread(rank_sums: Values, counts: Values) -> Values:
    """The part of H that differs between permutations: sum of squared rank sums over group sizes."""
    return np.asarray((rank_sums**2 / counts).sum(axis=-1))


def _permuted_people(episodes: pl.DataFrame, measure: str, draws: int) -> float:
    """p of H when conditions are dealt anew over people, who keep their episodes together."""
    values, person, condition = _by_person(episodes, measure)
    generator = np.random.default_rng(SEED)
    sums = np.bincount(person, stats.rankdata(values))  # (people,)
    counts = np.bincount(person).astype(np.float64)
    dealt = np.array([condition] + [generator.permutation(condition) for _ in range(draws)])  # (draws + 1, people)
    member = dealt[:, :, None] == np.arange(condition.max() + 1)  # (draws + 1, people, conditions)
    spread = _rank_spread(np.einsum("dpc,p->dc", member, sums), np.einsum("dpc,p->dc", member, counts))
    return float((spread[1:] >= spread[0] - 1e-9).sum() + 1) / (draws + 1)


def _epsilon_interval(episodes: pl.DataFrame, measure: str, draws: int) -> tuple[float, float]:
    """95 % percentile interval of epsilon squared, people drawn with replacement within their condition."""
    values, person, condition = _by_person(episodes, measure)
    of_person = [values[person == index] for index in range(condition.size)]
    generator = np.random.default_rng(SEED)
    drawn = []
    for _ in range(draws):
        groups = []
        for arm in range(condition.max() + 1):
            members = np.flatnonzero(condition == arm)
            groups.append(np.concatenate([of_person[index] for index in generator.choice(members, members.size)]))
        if np.ptp(np.concatenate(groups)) > 0:
            drawn.append(effects.epsilon_squared(kruskal_h(groups), sum(group.size for group in groups)))
    low, high = np.quantile(drawn, (0.025, 0.975)) if drawn else (math.nan, math.nan)
    return float(low), float(high)


def kruskal_h(groups: Sequence[Values]) -> float:
    """H with correction for ties, as scipy computes it but without its checks: for many draws."""
    sizes = np.array([group.size for group in groups], dtype=np.float64)
    values = np.concatenate(groups)
    ranks = stats.rankdata(values)
    sums = np.add.reduceat(ranks, np.concatenate([[0], np.cumsum(sizes[:-1])]).astype(int))
    n = values.size
    ties = np.unique(values, return_counts=True)[1].astype(np.float64)
    h = 12 / (n * (n + 1)) * float(_rank_spread(sums, sizes)) - 3 * (n + 1)
    return h / (1 - float((ties**3 - ties).sum()) / (n**3 - n))


def anova(
    episodes: pl.DataFrame, measure: str, conditions: Sequence[str], places: Sequence[tuple[str, str]]
) -> Iterator[Result]:
    """One-way analysis of variance at every (layout, agent) with eta squared, and Welch's test beside it."""
    for layout, agent in places:
        groups = [
            values
            for values in samples(episodes, measure, conditions, layout=layout, agent=agent).values()
            if values.size
        ]
        base = Result("reward", "anova", layout, agent, n=sum(group.size for group in groups))
        if trouble := effects.can_compare(groups):
            yield replace(base, note=trouble)
            continue
        f, p = stats.f_oneway(*groups)
        df = (float(len(groups) - 1), float(base.n - len(groups)))
        eta = effects.eta_squared(float(f), *df)
        yield replace(
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
        yield _welch_anova(replace(base, test="welch_anova"), groups)


def _welch_anova(base: Result, groups: Sequence[Values]) -> Result:
    if any(np.ptp(group) == 0 for group in groups):
        return replace(base, note="no variance within a condition")
    welch = anova_oneway(groups, use_var="unequal", welch_correction=True)
    df = float(welch.df_num), float(welch.df_denom)
    return replace(
        base, statistic_name="F", statistic=float(welch.statistic), df=df[0], df_residual=df[1], p=float(welch.pvalue)
    )


def t_test(base: Result, first: Values, second: Values) -> Result:
    """Student's two-sided test of first - second put into `base`, with Hedges' g; or why there is none."""
    base = replace(base, n=first.size + second.size)
    if trouble := effects.can_compare([first, second]):
        return replace(base, note=trouble)
    t, p = stats.ttest_ind_from_stats(*_moments(first), *_moments(second))
    difference = effects.difference_interval(first, second)
    g = effects.hedges_g(first, second)
    return replace(
        base,
        estimate=difference.value,
        estimate_low=difference.low,
        estimate_high=difference.high,
        se=effects.pooled_sd(first, second) * math.sqrt(1 / first.size + 1 / second.size),
        statistic_name="t",
        statistic=float(t),
        df=float(base.n - 2),
        p=float(p),
        effect_name="Hedges g",
        effect=g.value,
        ci_low=g.low,
        ci_high=g.high,
        ci_level=g.level,
    )


def welch_t_test(base: Result, first: Values, second: Values) -> Result:
    """The t-test that does not assume equal variances, beside Cliff's delta, which assumes no distribution at all."""
    base = replace(base, n=first.size + second.size)
    if trouble := effects.can_compare([first, second]):
        return replace(base, note=trouble)
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
    """What a t-test needs; scipy's other door warns where one condition's values are all the same."""
    return float(values.mean()), float(values.std(ddof=1)), values.size


def _welch_df(first: Values, second: Values) -> float:
    """Degrees of freedom of Welch and Satterthwaite."""
    a, b = (group.var(ddof=1) / group.size for group in (first, second))
    return float((a + b) ** 2 / (a**2 / (first.size - 1) + b**2 / (second.size - 1)))


def pairwise(
    episodes: pl.DataFrame, measure: str, conditions: Sequence[str], places: Sequence[tuple[str, str]]
) -> list[Result]:
    """t-tests of every two conditions at every (layout, agent); Benjamini-Hochberg within each comparison."""
    rows: list[Result] = []
    for first, second in pairs(conditions):
        for test in (t_test, welch_t_test):
            family = []
            for layout, agent in places:
                values = samples(episodes, measure, (first, second), layout=layout, agent=agent)
                base = Result("reward", test.__name__, layout, agent, contrast=f"{first} - {second}")
                family.append(test(base, values[first], values[second]))
            rows += adjust(family)
    return rows


def adjust(family: Sequence[Result]) -> list[Result]:
    """The same rows with Benjamini-Hochberg p values over those that have a p value."""
    tested = [row for row in family if not math.isnan(row.p)]
    if not tested:
        return list(family)
    adjusted = iter(multipletests([row.p for row in tested], method="fdr_bh")[1])
    note = f"Benjamini-Hochberg over {len(tested)} tests"
    return [row if math.isnan(row.p) else replace(row, p_adjusted=float(next(adjusted)), note=note) for row in family]
