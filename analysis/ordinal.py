"""The cumulative-link mixed model of the answers, which treats a 1-7 scale as ordered categories."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import polars as pl
from scipy import stats

from analysis import mixed_model, ordinal_fit, questionnaires
from analysis.compare import adjust
from analysis.groups import pairs
from analysis.ordinal_fit import OrdinalData, OrdinalFit, OrdinalFitError
from analysis.results import Result

SECTION = "ordinal"
MAX_CATEGORIES = 9  # points of a scale; more distinct values are a number question


def ordinal_rows(answers: pl.DataFrame, conditions: Sequence[str]) -> list[Result]:
    """Return, for each question, the differences between conditions as log odds of a higher answer (`odds`), with
    agent and layout as further effects and people as random intercepts; Benjamini-Hochberg over all of them; and the
    standard deviation between people (`person_sd`)."""
    odds: list[Result] = []
    others: list[Result] = []
    for question in questionnaires.questions(answers):
        asked = answers.filter(pl.col("question") == question)
        found, spread = _question(asked, question, [name for name in conditions if name in set(asked["condition"])])
        odds += found
        others += spread
    return [*adjust(odds), *others]


def _question(asked: pl.DataFrame, question: str, conditions: Sequence[str]) -> tuple[list[Result], list[Result]]:
    base = Result(SECTION, "odds", "chosen", "all", question=question, n=asked.height, unit="answers")
    people = asked["participant"].n_unique()
    if len(conditions) < 2:
        return [], []
    if people < mixed_model.MIN_PEOPLE or asked.height <= people:
        return [replace(base, note="needs six people and more than one answer a person")], []
    if asked["value"].n_unique() > MAX_CATEGORIES:
        return [replace(base, note="is not an answer scale: too many different values")], []
    try:
        fitted = ordinal_fit.fit(_data(asked, conditions))
    except OrdinalFitError as error:
        return [replace(base, note=f"could not be fitted: {error}")], []
    spread = replace(base, test="person_sd", estimate=fitted.person_sd, n=people, unit="people")
    df = float(people - len(conditions))
    return [_odds(replace(base, df=df), fitted, conditions, pair) for pair in pairs(conditions)], [spread]


def _data(asked: pl.DataFrame, conditions: Sequence[str]) -> OrdinalData:
    _, category = np.unique(asked["value"].to_numpy(), return_inverse=True)
    _, person = np.unique(asked["participant"].to_numpy(), return_inverse=True)
    return OrdinalData(category, mixed_model.fixed_effects(asked, conditions)[:, 1:], person)


def _odds(base: Result, fitted: OrdinalFit, conditions: Sequence[str], pair: tuple[str, str]) -> Result:
    """Wald's test, with t for the normal distribution: with few people the latter rejects too often. The first
    condition's effect is in the thresholds."""
    weights = np.zeros(fitted.beta.size)
    for name, sign in zip(pair, (1.0, -1.0), strict=True):
        if name != conditions[0]:
            weights[list(conditions).index(name) - 1] = sign
    estimate, se = float(weights @ fitted.beta), math.sqrt(float(weights @ fitted.covariance @ weights))
    low, high = (estimate + sign * float(stats.t.ppf(0.975, base.df)) * se for sign in (-1, 1))
    return replace(
        base,
        contrast=" - ".join(pair),
        estimate=estimate,
        estimate_low=low,
        estimate_high=high,
        se=se,
        statistic_name="t",
        statistic=estimate / se,
        p=float(2 * stats.t.sf(abs(estimate / se), base.df)),
        effect_name="odds ratio",
        effect=math.exp(estimate),
        ci_low=math.exp(low),
        ci_high=math.exp(high),
        ci_level=0.95,
    )
