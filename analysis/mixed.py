"""The mixed model of reward: condition, agent and layout as fixed effects, people as random effect."""

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy import stats
from statsmodels.regression.mixed_linear_model import MixedLM, MixedLMResults

from analysis.compare import pairs
from analysis.results import Result
from analysis.tables import AGENTS, LAYOUTS, in_order

FEWEST_PEOPLE = 6


@dataclass(frozen=True)
class Variance:
    """Where reward varies, in points: between people, and between episodes of one person."""

    person_sd: float
    residual_sd: float

    @property
    def icc(self) -> float:
        """Share of the variance that lies between people."""
        total = self.person_sd**2 + self.residual_sd**2
        return self.person_sd**2 / total if total else math.nan


@dataclass(frozen=True)
class MixedModel:
    """The fitted model; residuals and fitted values belong to the same episodes."""

    rows: tuple[Result, ...]
    variance: Variance | None
    residuals: NDArray[np.float64]


def fit(episodes: pl.DataFrame, measure: str, conditions: Sequence[str]) -> MixedModel:
    """Differences between conditions (Wald z, restricted maximum likelihood), variance components, and whether the
    differences depend on the layout (likelihood ratio). With too little data: one row that says so."""
    chosen = episodes.filter(pl.col(measure).is_not_null())
    present = [name for name in conditions if name in chosen["condition"]]
    people = chosen["participant"].n_unique()
    base = Result("mixed model", "fixed_effect", "all", "all", n=chosen.height)
    if len(present) < 2 or people < FEWEST_PEOPLE or chosen.height <= people:
        trouble = "needs two conditions, six people and more than one episode a person"
        return MixedModel((replace(base, note=trouble),), None, np.empty(0))
    columns = _design(chosen, present)
    reward = chosen[measure].to_numpy().astype(np.float64)
    groups = chosen["participant"].to_numpy()
    fitted, note = _fit(reward, columns, groups, reml=True)
    variance = Variance(math.sqrt(max(0.0, float(np.asarray(fitted.cov_re)[0, 0]))), math.sqrt(float(fitted.scale)))
    rows = [replace(row, note=note) for row in _contrasts(base, fitted, present)]
    rows += _variance_rows(replace(base, test="variance", unit="people", n=people), variance)
    if chosen["layout"].n_unique() > 1:
        rows.append(_interaction(replace(base, test="condition_by_layout"), chosen, present, reward))
    return MixedModel(tuple(rows), variance, np.asarray(fitted.resid, dtype=np.float64))


def _dummies(values: pl.Series, levels: Sequence[str]) -> NDArray[np.float64]:
    """(episodes, levels - 1): one column for every level but the first."""
    return np.stack([(values == level).to_numpy() for level in levels[1:]], axis=1).astype(np.float64)


def _design(chosen: pl.DataFrame, conditions: Sequence[str]) -> NDArray[np.float64]:
    """Intercept, conditions, agents, layouts: (episodes, columns)."""
    parts = [np.ones((chosen.height, 1)), _dummies(chosen["condition"], conditions)]
    for column, known in (("agent", AGENTS), ("layout", LAYOUTS)):
        levels = in_order(chosen[column], known)
        if len(levels) > 1:
            parts.append(_dummies(chosen[column], levels))
    return np.concatenate(parts, axis=1)


def _fit(
    reward: NDArray[np.float64], columns: NDArray[np.float64], groups: NDArray[np.object_], reml: bool
) -> tuple[MixedLMResults, str]:
    """The fit, and what statsmodels had to say about it."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        model = MixedLM(reward, columns, groups)
        try:
            fitted = model.fit(reml=reml, method="bfgs")
        except np.linalg.LinAlgError:  # a step of the gradient method left the parameter space
            fitted = model.fit(reml=reml, method="powell")
    texts = sorted({str(warning.message).split(".")[0].split("\n")[0] for warning in said})
    return fitted, "; ".join(texts) if texts else ""


def _contrasts(base: Result, fitted: MixedLMResults, conditions: Sequence[str]) -> list[Result]:
    size = len(conditions)
    beta = np.concatenate([[0.0], np.asarray(fitted.fe_params)[1:size]])
    covariance = np.zeros((size, size))
    covariance[1:, 1:] = np.asarray(fitted.cov_params())[1:size, 1:size]
    z = float(stats.norm.ppf(0.975))
    rows = []
    for first, second in pairs(conditions):
        weights = np.array([float(name == first) - float(name == second) for name in conditions])
        difference = float(weights @ beta)
        se = math.sqrt(float(weights @ covariance @ weights))
        rows.append(
            replace(
                base,
                contrast=f"{first} - {second}",
                estimate=difference,
                estimate_low=difference - z * se,
                estimate_high=difference + z * se,
                se=se,
                statistic_name="z",
                statistic=difference / se,
                p=float(2 * stats.norm.sf(abs(difference / se))),
                ci_level=0.95,
            )
        )
    return rows


def _variance_rows(base: Result, variance: Variance) -> list[Result]:
    found = (("person_sd", variance.person_sd), ("residual_sd", variance.residual_sd), ("icc", variance.icc))
    return [replace(base, test=name, estimate=value) for name, value in found]


def _interaction(base: Result, chosen: pl.DataFrame, conditions: Sequence[str], reward: NDArray[np.float64]) -> Result:
    """Likelihood ratio of the model whose condition effects differ by layout against the one in which they do not."""
    plain = _design(chosen, conditions)
    effect = _dummies(chosen["condition"], conditions)
    place = _dummies(chosen["layout"], in_order(chosen["layout"], LAYOUTS))
    products = (effect[:, :, None] * place[:, None, :]).reshape(chosen.height, -1)
    full = np.concatenate([plain, products], axis=1)
    if np.linalg.matrix_rank(full) < full.shape[1]:
        return replace(base, note="not every condition was played in every layout")
    groups = chosen["participant"].to_numpy()
    small, _ = _fit(reward, plain, groups, reml=False)
    large, note = _fit(reward, full, groups, reml=False)
    ratio = max(0.0, 2 * float(large.llf - small.llf))
    df = products.shape[1]
    return replace(
        base, statistic_name="chi2", statistic=ratio, df=float(df), p=float(stats.chi2.sf(ratio, df)), note=note
    )
