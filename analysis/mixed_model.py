"""The mixed model of reward: condition, agent, layout and levels within people as fixed effects, people as random
effect.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import polars as pl
from scipy import stats

from analysis import mixed_model_fit
from analysis.groups import pairs
from analysis.mixed_model_fit import Array, Data, Fit
from analysis.results import Result
from analysis.tables import AGENTS, LAYOUTS, in_order
from analysis.within_effects import with_within_effects

MIN_PEOPLE = 6


@dataclass(frozen=True)
class Variance:
    """The variance components of reward, as standard deviations in points: between people, and between episodes of one
    person, at the same levels."""

    person_sd: float
    residual_sd: float

    @property
    def icc(self) -> float:
        """Share of the variance that lies between people."""
        total = self.person_sd**2 + self.residual_sd**2
        return self.person_sd**2 / total if total else math.nan


@dataclass(frozen=True)
class MixedModel:
    """The fitted model. If `variance` is missing, it could not be fitted, and the only row says why."""

    rows: tuple[Result, ...]
    variance: Variance | None
    residuals: Array


def fit(episodes: pl.DataFrame, measure: str, conditions: Sequence[str]) -> MixedModel:
    """Differences between conditions (restricted maximum likelihood, t with Satterthwaite's degrees of freedom),
    variance components, and whether the differences depend on the layout (likelihood ratio). Where it cannot be fitted:
    one row that says why."""
    chosen = episodes.filter(pl.col(measure).is_not_null())
    present = [name for name in conditions if name in chosen["condition"]]
    people = chosen["participant"].n_unique()
    base = Result("mixed model", "fixed_effect", "all", "all", n=chosen.height)
    if len(present) < 2 or people < MIN_PEOPLE or chosen.height <= people:
        return _none(base, "needs two conditions, six people and more than one episode a person")
    data = _data(chosen, measure, fixed_effects(chosen, present))
    try:
        fitted = mixed_model_fit.fit(data)
    except (mixed_model_fit.FitError, np.linalg.LinAlgError) as error:
        return _none(base, f"could not be fitted: {error}")
    variance = Variance(math.sqrt(fitted.between), math.sqrt(fitted.within))
    rows = _contrasts(base, fitted, present)
    rows += _variance_rows(replace(base, test="variance", unit="people", n=people), variance)
    if chosen["layout"].n_unique() > 1:
        rows.append(_interaction(replace(base, test="condition_by_layout"), chosen, present, data))
    return MixedModel(tuple(rows), variance, fitted.residuals)


def _none(base: Result, why: str) -> MixedModel:
    return MixedModel((replace(base, note=why),), None, np.empty(0))


def _data(chosen: pl.DataFrame, measure: str, columns: Array) -> Data:
    _, person = np.unique(chosen["participant"].to_numpy(), return_inverse=True)
    return Data(chosen[measure].to_numpy().astype(np.float64), columns, person)


def _dummies(values: pl.Series, levels: Sequence[str]) -> Array:
    """Return a column for every level but the first: (episodes, levels - 1)."""
    return np.stack([(values == level).to_numpy() for level in levels[1:]], axis=1).astype(np.float64)


def fixed_effects(chosen: pl.DataFrame, conditions: Sequence[str]) -> Array:
    """Return intercept, conditions, agents, layouts and, where people met levels in blocks, these and what they add
    under each condition: (episodes, columns)."""
    parts = [np.ones((chosen.height, 1)), _dummies(chosen["condition"], conditions)]
    for column, known in (("agent", AGENTS), ("layout", LAYOUTS)):
        levels = in_order(chosen[column], known)
        if len(levels) > 1:
            parts.append(_dummies(chosen[column], levels))
    return with_within_effects(chosen, conditions, np.concatenate(parts, axis=1))


def _contrasts(base: Result, fitted: Fit, conditions: Sequence[str]) -> list[Result]:
    """Return every difference between two conditions; the first condition's effect is in the intercept."""
    rows = []
    for first, second in pairs(conditions):
        weights = np.zeros(len(fitted.beta))
        for name, sign in ((first, 1.0), (second, -1.0)):
            if name != conditions[0]:
                weights[conditions.index(name)] = sign
        difference = float(weights @ fitted.beta)
        se = math.sqrt(float(weights @ fitted.covariance @ weights))
        df = fitted.degrees(weights)
        rows.append(with_t_test(replace(base, contrast=f"{first} - {second}"), difference, se, df))
    return rows


def with_t_test(base: Result, estimate: float, se: float, df: float) -> Result:
    """Return the row with an estimate, its t-test against 0 and 95 % interval."""
    half = float(stats.t.ppf(0.975, df)) * se
    return replace(
        base,
        estimate=estimate,
        estimate_low=estimate - half,
        estimate_high=estimate + half,
        se=se,
        statistic_name="t",
        statistic=estimate / se,
        df=df,
        p=float(2 * stats.t.sf(abs(estimate / se), df)),
        ci_level=0.95,
    )


def _variance_rows(base: Result, variance: Variance) -> list[Result]:
    found = (("person_sd", variance.person_sd), ("residual_sd", variance.residual_sd), ("icc", variance.icc))
    return [replace(base, test=name, estimate=value) for name, value in found]


def _interaction(base: Result, chosen: pl.DataFrame, conditions: Sequence[str], plain: Data) -> Result:
    """Return the likelihood ratio of the model whose condition effects differ by layout against the one in which they
    do not."""
    effect = _dummies(chosen["condition"], conditions)
    place = _dummies(chosen["layout"], in_order(chosen["layout"], LAYOUTS))
    products = (effect[:, :, None] * place[:, None, :]).reshape(chosen.height, -1)
    full = replace(plain, x=np.concatenate([plain.x, products], axis=1))
    if np.linalg.matrix_rank(full.x) < full.x.shape[1]:
        return replace(base, note="not every condition was played in every layout")
    try:
        small, large = (mixed_model_fit.fit(data, restricted=False) for data in (plain, full))
    except (mixed_model_fit.FitError, np.linalg.LinAlgError) as error:
        return replace(base, note=f"could not be fitted: {error}")
    ratio = max(0.0, 2 * (large.log_likelihood - small.log_likelihood))
    df = products.shape[1]
    return replace(base, statistic_name="chi2", statistic=ratio, df=float(df), p=float(stats.chi2.sf(ratio, df)))
