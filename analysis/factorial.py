"""Factorial analysis of variance over people: main effects, interactions, marginal means and simple effects.

Each person has one value, the mean of the person's episodes or answers. Effects are coded as deviations from the
unweighted mean (sum coding), and each is tested with all others in the model (type III sums of squares), so that cells
of different size do not mix effects.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product
from typing import Final

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy import stats

from analysis import compare, effects, mixed_model
from analysis.declared import BY as BY
from analysis.groups import ALL, Values, computed
from analysis.results import Result
from analysis.tables import Export, in_order
from analysis.within_effects import PREFIX as PREFIX

SECTION: Final = "factorial"
SIMPLE: Final = "factorial simple effects"
REWARD: Final = "reward"

Array = NDArray[np.float64]
Factors = Mapping[str, Sequence[str]]


@dataclass(frozen=True)
class FactorialCells:
    """The values of people by combination of levels, in the order of the factors' product."""

    factors: Factors
    values: tuple[Values, ...]

    @property
    def names(self) -> list[dict[str, str]]:
        """The level of each factor, by cell."""
        return [dict(zip(self.factors, levels, strict=True)) for levels in product(*self.factors.values())]

    @property
    def people(self) -> int:
        return sum(values.size for values in self.values)

    def where(self, **levels: str) -> Values:
        """Return the values of everybody with these levels."""
        return np.concatenate(
            [
                values
                for name, values in zip(self.names, self.values, strict=True)
                if all(name[factor] == level for factor, level in levels.items())
            ]
        )


def factors_of(export: Export) -> dict[str, tuple[str, ...]]:
    """Return the levels of each factor in the order of the study file; {} for a study without two factors."""
    found = levels_in(export)
    return {name: levels for name, levels in found.items() if len(levels) > 1} if len(found) > 1 else {}


def levels_in(export: Export) -> dict[str, tuple[str, ...]]:
    """Return the levels of each factor of the participants."""
    declared = export.about.get("factors") or {}
    found = {}
    for column in export.participants.columns:
        if column.startswith(PREFIX):
            name = column.removeprefix(PREFIX)
            known = tuple(declared.get(name, ()))
            found[name] = known or in_order(export.participants[column].cast(pl.String), known)
    return found


def factorial_rows(export: Export, episodes: pl.DataFrame, answers: pl.DataFrame) -> list[Result]:
    """Return the analysis of reward and of each question; [] for a study without factors. p values of questions are
    corrected over the questions, for each effect."""
    factors = factors_of(export)
    if not factors:
        return []
    rows = of_measure(cells_of(episodes.select("participant", pl.col(REWARD).alias("value")), export, factors), "")
    by_question = (
        of_measure(cells_of(answers.filter(pl.col("question") == question), export, factors), str(question))
        for question in dict.fromkeys(answers["question"])
    )
    return [*rows, *adjusted(by_question)]


def adjusted(by_question: Iterable[list[Result]]) -> Iterator[Result]:
    """Yield the rows of all questions, each effect corrected over the questions."""
    asked: dict[tuple[str, str], list[Result]] = {}
    for rows in by_question:
        for row in rows:
            key = row.contrast if row.test == "anova" else row.question
            asked.setdefault((row.test, key), []).append(row)
    for (test, _), family in asked.items():
        yield from compare.adjust(family) if test == "anova" else family


def cells_of(table: pl.DataFrame, export: Export, factors: Factors) -> FactorialCells:
    """Return each person's mean of the column `value`, by combination of levels."""
    people = export.participants.select("participant", *(pl.col(f"{PREFIX}{name}").cast(pl.String) for name in factors))
    means = table.drop_nulls("value").group_by("participant", maintain_order=True).agg(pl.col("value").mean())
    joined = means.join(people, on="participant")
    columns = [joined[f"{PREFIX}{name}"].to_list() for name in factors]
    cell_of = dict(enumerate(zip(*columns, strict=True)))
    values = joined["value"].to_numpy().astype(np.float64)
    return FactorialCells(
        factors,
        tuple(
            np.array([values[row] for row, found in cell_of.items() if found == levels], dtype=np.float64)
            for levels in product(*factors.values())
        ),
    )


def of_measure(cells: FactorialCells, question: str) -> list[Result]:
    """Return tests, marginal means and simple effects of one measure; one row with the reason where there are none."""
    n = sum(values.size for values in cells.values)
    base = Result(SECTION, "anova", ALL, ALL, question=question, n=n, unit="people")
    if problem := problem_with(cells):
        return [replace(base, note=problem)]
    rows = []
    for term in terms(cells.factors):
        named = replace(base, contrast=BY.join(term))
        rows.append(computed(tested, named, cells, term))
        if has_one_difference(cells.factors, term):
            named = replace(named, test="difference", note=difference_words(cells.factors, term))
            rows.append(computed(difference, named, cells, term))
    return [*rows, *_marginal_means(replace(base, test="marginal_mean"), cells), *_simple_effects(base, cells)]


def has_one_difference(factors: Factors, term: Sequence[str]) -> bool:
    """Return whether a term is about one difference (of differences), as all its factors have two levels."""
    return all(len(factors[name]) == 2 for name in term)


def difference_words(factors: Factors, term: Sequence[str]) -> str:
    """Return a description of that difference: each later level minus the earlier."""
    return BY.join(f"({factors[name][1]} - {factors[name][0]})" for name in term)


def problem_with(cells: FactorialCells) -> str:
    """Return why no effect can be tested; empty where it can."""
    for name, values in zip(cells.names, cells.values, strict=True):
        if not values.size:
            return f"nobody has values with {', '.join(f'{factor} {level}' for factor, level in name.items())}"
    if max(values.size for values in cells.values) < 2:
        return "every combination of levels has one person"
    return ""


def terms(factors: Factors) -> list[tuple[str, ...]]:
    """Return the main effects, then the interactions, the smaller first."""
    return [term for size in range(1, len(factors) + 1) for term in combinations(factors, size)]


def contrast_weights(factors: Factors, term: Sequence[str]) -> Array:
    """Return the hypothesis of a term as weights of the cells' means: (degrees of freedom, cells).

    A row for each independent difference between levels (of differences, for an interaction); cells that differ in the
    other factors are averaged.
    """
    weights = np.ones((1, 1))
    for name, levels in factors.items():
        count = len(levels)
        differences = np.column_stack([-np.ones(count - 1), np.eye(count - 1)])  # each later level minus the first
        weights = np.kron(weights, differences if name in term else np.full((1, count), 1 / count))
    return np.asarray(weights, dtype=np.float64)


def _within(cells: FactorialCells) -> tuple[float, int]:
    """Return the variance within cells and its degrees of freedom. Raises ValueError."""
    squares = sum(float(((values - values.mean()) ** 2).sum()) for values in cells.values)
    df = sum(values.size - 1 for values in cells.values)
    if squares <= 0:
        raise ValueError("the values do not vary within the combinations of levels")
    return squares / df, df


def tested(base: Result, cells: FactorialCells, term: Sequence[str]) -> Result:
    """Return the F test of a term, with partial eta squared."""
    variance, rest = _within(cells)
    weights = contrast_weights(cells.factors, term)
    means = np.array([values.mean() for values in cells.values])
    spread = weights / np.array([values.size for values in cells.values]) @ weights.T
    found = weights @ means
    df = len(weights)
    f = float(found @ np.linalg.solve(spread, found)) / df / variance
    return f_tested(base, f, df, rest)


def f_tested(base: Result, f: float, df: float, rest: float) -> Result:
    """Return the result of an F test, with partial eta squared."""
    eta = effects.eta_squared(f, df, rest)
    return replace(
        base,
        statistic_name="F",
        statistic=f,
        df=float(df),
        df_residual=float(rest),
        p=float(stats.f.sf(f, df, rest)),
        effect_name="partial eta squared",
        effect=eta.value,
        ci_low=eta.low,
        ci_high=eta.high,
        ci_level=eta.level,
    )


def difference(base: Result, cells: FactorialCells, term: Sequence[str]) -> Result:
    """Return, of factors with two levels, the difference (or difference of differences) that the F test of the term is
    about, each later level minus the earlier."""
    variance, rest = _within(cells)
    weights = contrast_weights(cells.factors, term)[0]
    estimate = float(weights @ np.array([values.mean() for values in cells.values]))
    sizes = np.array([values.size for values in cells.values])
    return mixed_model.with_t_test(base, estimate, float(np.sqrt(variance * (weights**2 / sizes).sum())), float(rest))


def _marginal_means(base: Result, cells: FactorialCells) -> Iterator[Result]:
    """Return the mean of each level over the other factors, with equal weight for each combination; the interval is
    from the variance within all combinations."""
    try:
        variance, rest = _within(cells)
    except ValueError:
        return
    means = np.array([values.mean() for values in cells.values])
    sizes = np.array([values.size for values in cells.values])
    for factor, levels in cells.factors.items():
        for level in levels:
            chosen = np.array([name[factor] == level for name in cells.names])
            weights = chosen / chosen.sum()
            named = replace(base, contrast=factor, condition=level, n=int(sizes[chosen].sum()), ci_level=0.95)
            se = float(np.sqrt(variance * (weights**2 / sizes).sum()))
            estimate, half = float(weights @ means), float(stats.t.ppf(0.975, rest)) * se
            yield replace(named, estimate=estimate, estimate_low=estimate - half, estimate_high=estimate + half, se=se)


def _simple_effects(base: Result, cells: FactorialCells) -> Iterator[Result]:
    """Return for each factor t-tests between its levels at every combination of levels of the others,
    Benjamini-Hochberg within the factor: they describe an interaction."""
    for factor, levels in cells.factors.items():
        others = {name: cells.factors[name] for name in cells.factors if name != factor}
        family = []
        for fixed in product(*others.values()):
            at = dict(zip(others, fixed, strict=True))
            for first, second in combinations(levels, 2):
                row = replace(base, section=SIMPLE, test="simple_effect", contrast=f"{factor}: {second} - {first}")
                row = replace(row, condition=", ".join(f"{name} {level}" for name, level in at.items()))
                values = (cells.where(**at, **{factor: level}) for level in (second, first))
                family.append(compare.t_test(row, *values))
        yield from compare.adjust(family)
