"""Factorial analysis where people meet the levels of a factor in blocks of rounds: effects within people.

A person has a mean for each combination of levels that was met. An effect within people is tested on each person's own
differences, in which everything that is constant over a person's blocks cancels; an effect between people is tested on
the mean over the combinations. The people of a condition, who met the blocks in one order, are a group: groups with the
same levels are averaged with equal weight, and only variance within groups is error, so that an effect of the blocks'
order does not count as an effect of the levels (Hills and Armitage 1979). That needs the same
average block for every level, so that a steady change over the blocks, such as practice, cancels; where the orders that
are left lack that, levels are adjusted for the block (block_orders), and where that is impossible, nothing is tested.
Balanced data give the tests of a split-plot analysis of variance. Where an effect within people has several
differences, its degrees of freedom are corrected (Greenhouse and Geisser 1959).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, product

import numpy as np
import polars as pl

from analysis import compare, factorial, mixed_model
from analysis.block_orders import ADJUSTED, Order, by_order, can_separate, is_balanced
from analysis.factorial import PREFIX, SIMPLE, Array, Factors, contrast_weights
from analysis.groups import computed
from analysis.results import Result
from analysis.tables import Export

WITHIN = "within people"  # in the note of a test


@dataclass(frozen=True)
class RepeatedCells:
    """The means of people by combination of the levels within people. `groups`: of each condition, the combination of
    levels between people, and (people, combinations) in the order of the factors' product. `orders`: of each group, the
    combinations of levels in the order of the blocks; () where it is unknown."""

    factors: Factors
    within: tuple[str, ...]
    groups: tuple[tuple[tuple[str, ...], Array], ...]
    orders: tuple[tuple[tuple[str, ...], ...], ...] = ()

    @property
    def inner(self) -> Factors:
        """The factors within people."""
        return {name: levels for name, levels in self.factors.items() if name in self.within}

    @property
    def outer(self) -> Factors:
        """The factors between people."""
        return {name: levels for name, levels in self.factors.items() if name not in self.within}

    @property
    def people(self) -> int:
        return sum(len(values) for _, values in self.groups)

    @property
    def combinations(self) -> list[tuple[str, ...]]:
        """The combinations of the levels within people."""
        return list(product(*self.inner.values()))

    def orders_with(self, between: tuple[str, ...]) -> list[Order]:
        """Return the orders of the groups with these levels between people."""
        known = self.orders or ((),) * len(self.groups)
        return [order for (levels, _), order in zip(self.groups, known, strict=True) if levels == between]

    @cached_property
    def adjusted_words(self) -> str:
        """Return for a note that levels are adjusted for the block; empty where all orders count the same."""
        balanced = all(is_balanced(self.orders_with(between)) for between in dict(self.groups))
        return "" if balanced else f", {ADJUSTED}"


def within_of(export: Export) -> tuple[str, ...]:
    """Return the factors whose levels differ between the episodes of a person."""
    own = set(export.participants.columns)
    return tuple(
        name.removeprefix(PREFIX) for name in export.episodes.columns if name.startswith(PREFIX) and name not in own
    )


def repeated_factors(export: Export) -> dict[str, tuple[str, ...]]:
    """Return the levels of each factor in the order of the study file, those within people included."""
    declared = export.about.get("factors") or {}
    names = [name.removeprefix(PREFIX) for name in export.episodes.columns if name.startswith(PREFIX)]
    names.sort(key=lambda name: list(declared).index(name) if name in declared else len(declared))
    known = {name: tuple(declared.get(name, ())) for name in names}
    found = {name: tuple(export.episodes[f"{PREFIX}{name}"].drop_nulls().unique().sort().to_list()) for name in known}
    return {name: levels or found[name] for name, levels in known.items()}


def repeated_cells(table: pl.DataFrame, export: Export) -> RepeatedCells:
    """Return the means of people with values in all combinations that they meet. `table`: `episode` and `value`."""
    factors, within = repeated_factors(export), within_of(export)
    empty = RepeatedCells(factors, within, ())
    columns = [pl.col(f"{PREFIX}{name}").cast(pl.String) for name in factors]
    known = export.episodes.select("episode", "participant", "condition", "number", *columns).drop_nulls()
    values = table.drop_nulls("value").select("episode", "value").join(known, on="episode", maintain_order="left")
    keys = ["condition", "participant", *(f"{PREFIX}{name}" for name in factors)]
    means = values.group_by(keys, maintain_order=True).agg(pl.col("value").mean(), pl.col("number").min())
    inner = list(product(*empty.inner.values()))
    groups: dict[tuple[str, tuple[str, ...], tuple[tuple[str, ...], ...]], list[list[float]]] = {}
    for (condition, _), person in means.group_by("condition", "participant", maintain_order=True):
        blocks = person.sort("number")  # a block is a run of rounds
        levels_met = list(zip(*(blocks[f"{PREFIX}{name}"] for name in within), strict=True))
        met = dict(zip(levels_met, blocks["value"], strict=True))
        order = tuple(levels for levels in levels_met if levels in inner)  # an earlier version may have had more
        if all(levels in met for levels in inner):
            between = tuple(str(person[f"{PREFIX}{name}"][0]) for name in empty.outer)
            groups.setdefault((str(condition), between, order), []).append([met[levels] for levels in inner])
    found = sorted(groups.items())
    return replace(
        empty,
        groups=tuple((key[1], np.array(rows)) for key, rows in found),
        orders=tuple(key[2] for key, _ in found),
    )


def repeated_rows(export: Export, episodes: pl.DataFrame, answers: pl.DataFrame) -> list[Result]:
    """Return the analysis of reward and of each question; [] for a study without factors within people."""
    if not within_of(export):
        return []
    table = episodes.select("episode", pl.col(factorial.REWARD).alias("value"))
    rows = of_repeated(repeated_cells(table, export), "")
    by_question = (
        of_repeated(repeated_cells(answers.filter(pl.col("question") == question), export), str(question))
        for question in dict.fromkeys(answers["question"])
    )
    return [*rows, *factorial.adjusted(by_question)]


def of_repeated(cells: RepeatedCells, question: str) -> list[Result]:
    """Return tests, marginal means and simple effects of one measure; one row with the reason where there are none."""
    base = Result(factorial.SECTION, "anova", "all", "all", question=question, n=cells.people, unit="people")
    if problem := problem_with(cells):
        return [replace(base, note=problem)]
    rows = []
    for term in factorial.terms(cells.factors):
        named = replace(base, contrast=factorial.BY.join(term))
        rows.append(computed(tested, named, cells, term))
        if factorial.has_one_difference(cells.factors, term):
            words = factorial.difference_words(cells.factors, term) + cells.adjusted_words
            named = replace(named, test="difference", note=words)
            rows.append(computed(difference, named, cells, term))
    return [*rows, *_marginal_means(replace(base, test="marginal_mean"), cells), *_simple_effects(base, cells)]


def problem_with(cells: RepeatedCells) -> str:
    """Return why no effect can be tested; empty where it can."""
    present = {between for between, _ in cells.groups}
    for levels in product(*cells.outer.values()):
        if levels not in present:
            where = ", ".join(f"{name} {level}" for name, level in zip(cells.outer, levels, strict=True))
            return f"nobody has values in all blocks{' with ' + where if where else ''}"
    if cells.people == len(cells.groups):
        return "every order of the blocks has one person"
    return _imbalance(cells)


def _imbalance(cells: RepeatedCells) -> str:
    """Return where levels and blocks cannot be told apart in the orders that are left; empty if nowhere. The effect of
    the levels would contain a change over the blocks."""
    for levels in product(*cells.outer.values()):
        orders = cells.orders_with(levels)
        if not can_separate(cells.combinations, orders):
            where = ", ".join(f"{name} {level}" for name, level in zip(cells.outer, levels, strict=True))
            return (
                f"the orders of the blocks{' with ' + where if where else ''} are not balanced: some levels come "
                "earlier than others on average, so levels and blocks cannot be told apart"
            )
    return ""


def _weights(cells: RepeatedCells, term: Sequence[str]) -> tuple[Array, Array]:
    """Return the hypothesis of a term as weights of the combinations within people, and of those between people."""
    parts = (cells.inner, cells.outer)
    inner, outer = (contrast_weights(part, [name for name in term if name in part]) for part in parts)
    return inner, outer


def _of_groups(cells: RepeatedCells, inner: Array, outer: Array) -> Array:
    """Return weights of the means of all groups, (outer * inner, groups, combinations), for each row of `outer` with
    each of `inner`. Raises ValueError where levels and blocks cannot be told apart."""
    found = np.zeros((len(outer), len(inner), len(cells.groups), inner.shape[1]))
    for column, between in enumerate(product(*cells.outer.values())):
        mine = [place for place, (levels, _) in enumerate(cells.groups) if levels == between]
        for row, weights in enumerate(inner):
            spread = by_order(weights, cells.combinations, cells.orders_with(between))
            if spread is None:
                raise ValueError(_imbalance(cells))
            found[:, row, mine] = outer[:, column, None, None] * spread
    return found.reshape(-1, *found.shape[2:])


def _pooled(cells: RepeatedCells) -> tuple[Array, Array, Array, int]:
    """Return the means (groups, combinations) and sizes of the groups, and the covariance of the combinations within
    groups with its degrees of freedom."""
    values = [part for _, part in cells.groups]
    means, sizes = np.stack([part.mean(axis=0) for part in values]), np.array([len(part) for part in values])
    rest = cells.people - len(values)
    squares = np.asarray(sum((part - part.mean(axis=0)).T @ (part - part.mean(axis=0)) for part in values))
    return means, sizes, squares / rest, rest


def tested(base: Result, cells: RepeatedCells, term: Sequence[str]) -> Result:
    """Return the F test of a term, with partial eta squared."""
    inner, outer = _weights(cells, term)
    inner = np.linalg.qr(inner.T)[0].T
    means, sizes, covariance, rest = _pooled(cells)
    own = inner @ covariance @ inner.T
    if np.trace(own) * rest <= 1e-12 * max(1.0, float(((means @ inner.T) ** 2).sum())):
        raise ValueError("the values do not vary within the orders of the blocks")
    weights, count = _of_groups(cells, inner, outer), len(inner)
    found = np.einsum("agc,gc->a", weights, means)
    spread = np.einsum("agc,bgc,g->ab", weights, weights, 1 / sizes)
    error = np.einsum("agc,cd,bgd,g->ab", weights, covariance, weights, 1 / sizes)
    f = float(found @ np.linalg.solve(spread, found)) / float(np.trace(np.linalg.solve(spread, error)))
    epsilon = float(np.trace(own) ** 2 / (count * np.trace(own @ own)))
    df, df_rest = len(outer) * count * epsilon, rest * count * epsilon
    about = WITHIN if any(name in cells.within for name in term) else "between people"
    note = f"{about}, Greenhouse-Geisser epsilon {epsilon:.3f}" if count > 1 else about
    note += cells.adjusted_words if about == WITHIN else ""
    return factorial.f_tested(replace(base, note=note), f, df, df_rest)


def estimated(base: Result, cells: RepeatedCells, inner: Array, outer: Array) -> Result:
    """Return a weighted sum of means with its t-test against 0. `inner`: weights within people; `outer`: between."""
    means, sizes, covariance, rest = _pooled(cells)
    (weights,) = _of_groups(cells, inner[None], outer[None])
    variance = float(np.einsum("gc,cd,gd,g->", weights, covariance, weights, 1 / sizes))
    return mixed_model.with_t_test(base, float((weights * means).sum()), float(np.sqrt(variance)), float(rest))


def difference(base: Result, cells: RepeatedCells, term: Sequence[str]) -> Result:
    """Return, of factors with two levels, the difference (or difference of differences): later minus earlier levels."""
    inner, outer = _weights(cells, term)
    return estimated(base, cells, inner[0], outer[0])


def _weights_at(cells: RepeatedCells, wanted: dict[str, dict[str, float]]) -> tuple[Array, Array]:
    """Return weights of the levels of the wanted factors; the others are averaged."""

    def of(factors: Factors) -> Array:
        weights = np.ones(1)
        for name, levels in factors.items():
            some = wanted.get(name, dict.fromkeys(levels, 1 / len(levels)))
            weights = np.kron(weights, np.array([some.get(level, 0.0) for level in levels]))
        return weights

    return of(cells.inner), of(cells.outer)


def _marginal_means(base: Result, cells: RepeatedCells) -> Iterator[Result]:
    """Return the mean of each level over the other factors, with equal weight for each combination."""
    for factor, levels in cells.factors.items():
        for level in levels:
            inner, outer = _weights_at(cells, {factor: {level: 1.0}})
            counting = {
                between for between, weight in zip(product(*cells.outer.values()), outer, strict=True) if weight
            }
            n = sum(len(values) for between, values in cells.groups if between in counting)
            row = computed(estimated, replace(base, contrast=factor, condition=level, n=n), cells, inner, outer)
            yield replace(row, statistic_name="", statistic=np.nan, df=np.nan, p=np.nan)


def _simple_effects(base: Result, cells: RepeatedCells) -> Iterator[Result]:
    """Compare the levels of each factor at every combination of levels of the others, Benjamini-Hochberg within the
    factor; of a single factor, only where it has more than two levels."""
    for factor, levels in cells.factors.items():
        others = {name: cells.factors[name] for name in cells.factors if name != factor}
        if not others and len(levels) == 2:
            continue
        family = []
        for fixed in product(*others.values()):
            at = dict(zip(others, fixed, strict=True))
            for first, second in combinations(levels, 2):
                row = replace(base, section=SIMPLE, test="simple_effect", contrast=f"{factor}: {second} - {first}")
                row = replace(row, condition=", ".join(f"{name} {level}" for name, level in at.items()))
                wanted = {name: {level: 1.0} for name, level in at.items()} | {factor: {second: 1.0, first: -1.0}}
                family.append(computed(estimated, row, cells, *_weights_at(cells, wanted)))
        yield from compare.adjust(family)
