"""Checks on the mixed model of reward: other error terms, round order as covariate, and simple effects."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import polars as pl

from analysis import cluster_robust, compare, mixed_model, mixed_model_fit, random_slopes
from analysis.groups import ALL, PeopleGroups, Values, pairs
from analysis.mixed_model_fit import Array, Data, FitError
from analysis.results import Result

SECTION = "robustness"
REWARD = "reward"
SIMPLE = "simple effects"
Estimate = Callable[[Values], tuple[float, float, float]]  # a weighted sum of effects, its standard error and df


def model_rows(episodes: pl.DataFrame, conditions: Sequence[str]) -> list[Result]:
    """Return the differences between conditions with errors that are robust to clusters (`cluster_robust`), with a
    random slope of the agent for each person (`random_slopes`), and with the round as covariate (`with_round`); what a
    round adds (`round`), and whether it adds more under a condition (`round_by_condition`)."""
    chosen = episodes.filter(pl.col(REWARD).is_not_null())
    present = [name for name in conditions if name in set(chosen["condition"])]
    people = chosen["participant"].n_unique()
    base = Result(SECTION, "", ALL, ALL, n=chosen.height)
    if len(present) < 2 or people < mixed_model.MIN_PEOPLE or chosen.height <= people:
        return [replace(base, test="cluster_robust", note="needs two conditions, six people and several episodes each")]
    checks: tuple[tuple[str, Callable[[Result, pl.DataFrame, list[str]], list[Result]]], ...] = (
        ("cluster_robust", _cluster_robust),
        ("random_slopes", _random_slopes),
        ("with_round", _with_round),
    )
    rows: list[Result] = []
    for test, check in checks:
        named = replace(base, test=test)
        try:
            rows += check(named, chosen, present)
        except (FitError, np.linalg.LinAlgError) as error:
            rows.append(replace(named, note=f"could not be fitted: {error}"))
    return rows


def _weights(pair: tuple[str, str], conditions: Sequence[str], size: int) -> Values:
    """Return the weights of the effects whose sum is the difference; the first condition's effect is in the
    intercept."""
    weights = np.zeros(size)
    for name, sign in zip(pair, (1.0, -1.0), strict=True):
        if name != conditions[0]:
            weights[list(conditions).index(name)] = sign
    return weights


def _tested(base: Result, estimate: float, se: float, df: float) -> Result:
    """Return an estimate with its t-test and 95 % interval."""
    if not se > 0:
        return replace(base, note="nothing varies apart from the effects")
    return mixed_model.with_t_test(base, estimate, se, df)


def _differences(base: Result, conditions: Sequence[str], size: int, estimate: Estimate) -> list[Result]:
    """Return every difference between two conditions. `size`: the number of effects that `estimate` weights."""
    return [
        _tested(replace(base, contrast=" - ".join(pair)), *estimate(_weights(pair, conditions, size)))
        for pair in pairs(conditions)
    ]


def _estimate(fitted: mixed_model_fit.Fit | random_slopes.SlopesFit, df: Callable[[Values], float]) -> Estimate:
    def estimate(weights: Values) -> tuple[float, float, float]:
        return float(weights @ fitted.beta), math.sqrt(float(weights @ fitted.covariance @ weights)), df(weights)

    return estimate


def _people(chosen: pl.DataFrame) -> "np.ndarray[tuple[int], np.dtype[np.int64]]":
    return np.unique(chosen["participant"].to_numpy(), return_inverse=True)[1]


def _cluster_robust(base: Result, chosen: pl.DataFrame, conditions: list[str]) -> list[Result]:
    person = _people(chosen)
    data = Data(chosen[REWARD].to_numpy().astype(np.float64), mixed_model.fixed_effects(chosen, conditions), person)
    fitted = cluster_robust.fit(data)
    return _differences(base, conditions, fitted.beta.size, fitted.estimate)


def _random_slopes(base: Result, chosen: pl.DataFrame, conditions: list[str]) -> list[Result]:
    """Degrees of freedom: the people minus the conditions, as in a balanced study."""
    agents = sorted(set(chosen["agent"]))
    if len(agents) < 2:
        return [replace(base, note="needs two agents")]
    person = _people(chosen)
    data = Data(chosen[REWARD].to_numpy().astype(np.float64), mixed_model.fixed_effects(chosen, conditions), person)
    own = np.stack([np.ones(chosen.height), *((chosen["agent"] == name).to_numpy() for name in agents[1:])], axis=1)
    fitted = random_slopes.fit(data, own.astype(np.float64))
    df = float(person.max() + 1 - len(conditions))
    rows = _differences(base, conditions, fitted.beta.size, _estimate(fitted, lambda _: df))
    for index, name in enumerate(agents[1:], start=1):
        sd = math.sqrt(max(0.0, float(fitted.between[index, index])))
        rows.append(replace(base, test="slope_sd", agent=name, estimate=sd, unit="people"))
    return rows


def _with_round(base: Result, chosen: pl.DataFrame, conditions: list[str]) -> list[Result]:
    """Count rounds from the middle of the study, so that the difference is that in the middle."""
    rounds = chosen["number"].to_numpy().astype(np.float64)
    rounds = rounds - rounds.mean()
    plain = mixed_model.fixed_effects(chosen, conditions)
    together = np.column_stack([plain, rounds])
    if np.linalg.matrix_rank(together) == np.linalg.matrix_rank(plain):
        why = "the round cannot be separated from layout, agent or block, which came in the same order for all"
        raise FitError(why)
    data = Data(chosen[REWARD].to_numpy().astype(np.float64), together, _people(chosen))
    fitted = mixed_model_fit.fit(data)
    rows = _differences(base, conditions, together.shape[1], _estimate(fitted, fitted.degrees))
    return [*rows, *_learning(base, data, conditions)]


def _learning(base: Result, data: Data, conditions: list[str]) -> list[Result]:
    """Return what a round adds, and whether it adds more under a condition, with a slope of the round for each person:
    people learn at different speeds, and without that the episodes of one person count as independent evidence of
    learning. Degrees of freedom: the people minus the conditions. `data`: the round is the last effect."""
    size, rounds = data.x.shape[1], data.x[:, -1]
    products = data.x[:, 1 : len(conditions)] * rounds[:, None]
    own = np.column_stack([np.ones(rounds.size), rounds / rounds.std()])
    df = float(data.person.max() + 1 - len(conditions))

    def fitted(x: Array) -> Estimate:
        return _estimate(random_slopes.fit(replace(data, x=x), own), lambda _: df)

    tests = [replace(base, test=test) for test in ("round", "round_by_condition")]
    rows: list[Result] = []
    try:
        rows.append(_tested(tests[0], *fitted(data.x)(np.eye(size)[-1])))
        each = fitted(np.column_stack([data.x, products]))
    except (FitError, np.linalg.LinAlgError) as error:
        return [*rows, replace(tests[len(rows)], note=f"could not be fitted: {error}")]

    def more(weights: Values) -> tuple[float, float, float]:
        return each(np.concatenate([np.zeros(size), weights[1:]]))

    return [*rows, *_differences(tests[1], conditions, len(conditions), more)]


def simple_effects(
    episodes: pl.DataFrame, contrast: tuple[str, str], layouts: Sequence[str], agents: Sequence[str]
) -> list[Result]:
    """Return the main contrast on every layout (over agents) and with every agent (over layouts), over people,
    Benjamini-Hochberg within each: they describe an interaction with the layout or the agent."""
    people = PeopleGroups(episodes, REWARD)
    rows: list[Result] = []
    for places in ([(name, ALL) for name in layouts], [(ALL, name) for name in agents]):
        family = []
        for layout, agent in places:
            found = people.at(layout, agent, contrast)
            base = Result(SIMPLE, "simple_effect", layout, agent, contrast=" - ".join(contrast), unit="people")
            family.append(compare.t_test(base, found[contrast[0]], found[contrast[1]]))
        rows += compare.adjust(family) if len(family) > 1 else []
    return rows
