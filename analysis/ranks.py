"""Permutation tests over people, whose episodes stay together: of ranks, and of profiles over layouts or agents. A
person's episodes are not independent. The labels of the conditions are permuted over people, so these tests make no
assumption about the distribution of rewards or the correlation of a person's episodes.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy import stats

from analysis import effects
from analysis.groups import ALL, Values, computed
from analysis.results import Result

DRAWS = 2000
SEED = 1
TOLERANCE = 1e-9  # relative: permutations that differ by rounding alone are equal
BATCH = 250  # bootstrap draws in memory at a time


@dataclass(frozen=True)
class People:
    """Episodes as numbers: a value, a person and a place each; and the condition of each person."""

    values: Values  # (episodes,)
    person: NDArray[np.int64]  # (episodes,)
    condition: NDArray[np.int64]  # (people,)

    @property
    def arms(self) -> int:
        return int(self.condition.max()) + 1 if self.condition.size else 0


def people_of(episodes: pl.DataFrame, measure: str) -> People:
    """Return the people of a table of episodes with their values."""
    names, person = np.unique(episodes["participant"].to_numpy(), return_inverse=True)
    _, condition = np.unique(episodes["condition"].to_numpy(), return_inverse=True)
    of_person = np.zeros(names.size, dtype=np.int64)
    of_person[person] = condition
    return People(episodes[measure].to_numpy().astype(np.float64), person, of_person)


def dealt(condition: NDArray[np.int64], draws: int, seed: int) -> NDArray[np.float64]:
    """Return membership (draws + 1, conditions, people), 0 or 1: first the observed one, then with the labels
    permuted."""
    generator = np.random.default_rng(seed)
    labels = np.tile(condition, (draws + 1, 1))
    labels[1:] = generator.permuted(labels[1:], axis=1)
    return np.asarray(labels[:, None, :] == np.arange(condition.max() + 1)[:, None], dtype=np.float64)


def spread(member: NDArray[np.float64], sums: Values, counts: Values) -> Values:
    """Return the squared sums of conditions over their counts, added up: what differs between permutations. `sums` and
    `counts`: (people, columns)."""
    total, count = member @ sums, member @ counts  # (draws, conditions, columns)
    return np.asarray((total**2 / np.maximum(count, 1)).sum(axis=(1, 2)))


def shares(statistic: Values) -> Values:
    """Return for every draw the share of draws with a statistic as large: p values, all from the same permutations."""
    ordered = np.sort(statistic)
    slack = TOLERANCE * max(1.0, float(np.abs(ordered).max()))
    return np.asarray((statistic.size - np.searchsorted(ordered, statistic - slack)) / statistic.size)


def step_down(p: Values) -> Values:
    """Return family-wise corrected p of several tests (Westfall and Young 1993, minimum p, step-down). `p`: (tests,
    draws), of which the first draw is the observed one; tests that are alike cost little."""
    order = np.argsort(p[:, 0], kind="stable")
    adjusted = np.empty(len(order))
    before = 0.0
    for rank, test in enumerate(order):
        least = p[order[rank:]].min(axis=0)
        before = max(before, float((least <= p[test, 0] + 1e-12).mean()))
        adjusted[test] = before
    return adjusted


def kruskal_wallis(
    episodes: pl.DataFrame,
    measure: str,
    conditions: Sequence[str],
    agents: Sequence[str],
    draws: int = DRAWS,
    seed: int = SEED,
) -> list[Result]:
    """Return one rank test per agent over the conditions. `kruskal_wallis`: as published, with episodes as independent
    and epsilon squared. `kruskal_wallis_people`: its p when conditions are permuted over people, corrected for the
    agents."""
    chosen = episodes.filter(pl.col(measure).is_not_null() & pl.col("condition").is_in(list(conditions)))
    everybody = people_of(chosen, measure)
    size = everybody.condition.size
    member = dealt(everybody.condition, draws, seed) if everybody.arms > 1 else np.empty(0)
    rows, tested, people, statistics, alone = [], [], [], [], []
    for agent in agents:
        mask = np.ones(chosen.height, bool) if agent == ALL else (chosen["agent"] == agent).to_numpy()
        part = People(everybody.values[mask], everybody.person[mask], everybody.condition)
        rows.append(_published(part, agent, draws, seed))
        counts = np.bincount(part.person, minlength=size)
        played = int(np.count_nonzero(counts))
        of_condition = np.bincount(part.condition[counts > 0])
        if math.isnan(rows[-1].p):
            continue
        if of_condition[of_condition > 0].min() < 2:  # permutations of one person each are all alike
            note = "fewer than two people in a condition"
            alone.append(Result("reward", "kruskal_wallis_people", ALL, agent, n=played, unit="people", note=note))
            continue
        sums = np.bincount(part.person, stats.rankdata(part.values), size)
        statistics.append(spread(member, _column(sums), _column(counts)))
        people.append(played)
        tested.append(rows[-1])
    rows += _permuted(tested, people, np.stack([shares(one) for one in statistics])) if tested else []
    return rows + alone


def _column(of_people: NDArray[Any]) -> Values:
    return np.asarray(of_people, dtype=np.float64)[:, None]


def _published(part: People, agent: str, draws: int, seed: int) -> Result:
    """Compute Kruskal-Wallis over episodes; the interval of its effect draws people."""
    present = np.unique(part.condition[part.person])
    groups = [part.values[part.condition[part.person] == arm] for arm in present]
    base = Result("reward", "kruskal_wallis", ALL, agent, n=part.values.size)
    if problem := effects.can_compare(groups):
        return replace(base, note=problem)

    return computed(_kruskal, base, groups, epsilon_interval(part, draws, seed), _interval_note(part, draws))


def _interval_note(part: People, draws: int) -> str:
    people = np.unique(part.person).size
    return f"episodes of {people} people as independent; interval: people drawn again, {draws} bootstrap draws"


def _kruskal(base: Result, groups: Sequence[Values], interval: tuple[float, float], note: str) -> Result:
    h, p = stats.kruskal(*groups)
    return replace(
        base,
        statistic_name="H",
        statistic=float(h),
        df=float(len(groups) - 1),
        p=float(p),
        effect_name="epsilon squared",
        effect=effects.epsilon_squared(float(h), base.n),
        ci_low=interval[0],
        ci_high=interval[1],
        ci_level=0.95,
        note=note,
    )


def _permuted(rows: Sequence[Result], people: Sequence[int], p: Values) -> list[Result]:
    """Return the published rows' H with p values from permutations of people, (rows, draws), corrected over the
    rows."""
    note = f"conditions permuted over people, {p.shape[1] - 1} draws"
    if len(rows) > 1:
        note += f"; p_adjusted: corrected over {len(rows)} agents (step-down minimum p)"
    return [
        replace(
            Result("reward", "kruskal_wallis_people", ALL, row.agent, n=size, unit="people", note=note),
            statistic_name=row.statistic_name,
            statistic=row.statistic,
            df=row.df,
            p=float(one),
            p_adjusted=float(corrected),
        )
        for row, size, one, corrected in zip(rows, people, p[:, 0], step_down(p), strict=True)
    ]


def epsilon_interval(part: People, draws: int, seed: int, level: float = 0.95) -> tuple[float, float]:
    """Return the percentile interval of epsilon squared, people drawn with replacement within their condition; nan if
    none."""
    values, value = np.unique(part.values, return_inverse=True)
    held = np.zeros((part.condition.size, values.size))  # (people, distinct values)
    np.add.at(held, (part.person, value), 1.0)
    generator = np.random.default_rng(seed)
    found = []
    for start in range(0, draws, BATCH):
        size = min(BATCH, draws - start)
        counts = np.stack([weights @ held for weights in _drawn(part.condition, size, generator)], axis=1)
        found.append(epsilon_of_counts(counts))  # counts: (draws, conditions, distinct values)
    every = np.concatenate(found)
    every = every[np.isfinite(every)]
    low, high = np.quantile(every, ((1 - level) / 2, (1 + level) / 2)) if every.size else (math.nan, math.nan)
    return float(low), float(high)


def _drawn(condition: NDArray[np.int64], draws: int, generator: np.random.Generator) -> list[NDArray[np.float64]]:
    """Return how often each person is drawn, (draws, people), for each condition: 0 for people of another one."""
    weights = []
    for arm in np.unique(condition):
        members = np.flatnonzero(condition == arm)
        times = np.zeros((draws, condition.size))
        times[:, members] = generator.multinomial(members.size, np.full(members.size, 1 / members.size), draws)
        weights.append(times)
    return weights


def epsilon_of_counts(counts: NDArray[np.float64]) -> Values:
    """Return epsilon squared of tables (draws, conditions, distinct values in order) of counts; nan where nothing
    varies."""
    total = counts.sum(axis=1)  # (draws, distinct values)
    n = total.sum(axis=1)
    ranks = np.cumsum(total, axis=1) - (total - 1) / 2  # middle ranks of tied values
    sums, sizes = (counts * ranks[:, None]).sum(axis=2), counts.sum(axis=2)
    with np.errstate(all="ignore"):
        h = 12 / (n * (n + 1)) * np.where(sizes > 0, sums**2 / sizes, 0).sum(axis=1) - 3 * (n + 1)
        return np.asarray(h / (1 - (total**3 - total).sum(axis=1) / (n**3 - n)) / (n - 1))


def dependence(
    episodes: pl.DataFrame, measure: str, contrast: tuple[str, str], columns: Sequence[str], draws: int, seed: int
) -> list[Result]:
    """Return whether the difference between two conditions depends on the layout or the agent (`columns`): conditions
    are permuted over people, of whose rewards the means of places and of themselves were taken away. Corrected over the
    columns. Where it cannot be tested a row says why."""
    chosen = episodes.filter(pl.col(measure).is_not_null() & pl.col("condition").is_in(list(contrast)))
    people = people_of(chosen, measure)
    base = Result("reward", "", ALL, ALL, contrast=" - ".join(contrast), n=people.condition.size, unit="people")
    rows = [replace(base, test=f"contrast_by_{column}") for column in columns]
    if people.arms < 2 or np.bincount(people.condition).min() < 2:
        return [replace(row, note="fewer than two people in a condition") for row in rows]
    place = np.unique((chosen["layout"] + "\0" + chosen["agent"]).to_numpy(), return_inverse=True)[1]
    rest = doubly_centred(people.values, people.person, place)
    if np.abs(rest).max() <= TOLERANCE * max(1.0, float(np.abs(people.values).max())):
        return [replace(row, note="rewards do not vary apart from layout, agent and person") for row in rows]
    met = [column for column in columns if _levels_of_both(chosen, column) > 1]
    why = "fewer than two with episodes in both conditions"
    found = {name: replace(row, note=why) for name, row in zip(columns, rows, strict=True)}
    if not met:
        return list(found.values())
    member = dealt(people.condition, draws, seed)
    p = np.stack([shares(spread(member, *_profiles(people, rest, chosen[column]))) for column in met])
    note = f"conditions permuted over people, {draws} draws"
    note += f"; p_adjusted: corrected over {' and '.join(met)} (step-down minimum p)" if len(met) > 1 else ""
    for column, one, corrected in zip(met, p[:, 0], step_down(p), strict=True):
        found[column] = replace(found[column], p=float(one), p_adjusted=float(corrected), note=note)
    return list(found.values())


def _levels_of_both(chosen: pl.DataFrame, column: str) -> int:
    """Return how many layouts or agents have episodes in both conditions: the difference is known only there."""
    counts = chosen.group_by(column).agg(pl.col("condition").n_unique())
    return int((counts["condition"] > 1).sum())


def _profiles(people: People, rest: Values, column: pl.Series) -> tuple[Values, Values]:
    """Return sums and counts of every person's values at each level of the column: (people, levels) both."""
    names, level = np.unique(column.to_numpy(), return_inverse=True)
    sums, counts = np.zeros((people.condition.size, names.size)), np.zeros((people.condition.size, names.size))
    np.add.at(sums, (people.person, level), rest)
    np.add.at(counts, (people.person, level), 1.0)
    return sums, counts


def doubly_centred(values: Values, rows: NDArray[np.int64], columns: NDArray[np.int64], rounds: int = 20) -> Values:
    """Subtract the means of row and column from the values, also where some cells are empty (alternating
    projections)."""
    rest = values.copy()
    for _ in range(rounds):
        for index in (columns, rows):
            rest -= (np.bincount(index, rest) / np.maximum(np.bincount(index), 1))[index]
    return rest
