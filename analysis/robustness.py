"""Compute all robustness checks in one call, as rows."""

from dataclasses import dataclass

import polars as pl

from analysis import equivalence, model_checks, ordinal, sensitivity
from analysis.declared import REWARD, Declaration, DeclaredTest
from analysis.results import Result
from analysis.tables import Export


@dataclass(frozen=True)
class RobustnessInputs:
    """The input of the checks."""

    export: Export
    every: pl.DataFrame  # all episodes with their measures
    episodes: pl.DataFrame  # those analysed
    quality: pl.DataFrame  # a proposal for every episode
    answers: pl.DataFrame  # about the analysed episodes on the questionnaire's layouts
    conditions: tuple[str, ...]
    layouts: tuple[str, ...]
    agents: tuple[str, ...]
    contrast: tuple[str, str] | None
    declaration: Declaration
    seed: int


def robustness_rows(inputs: RobustnessInputs) -> list[Result]:
    """Return all rows of the report's section on robustness."""
    rows: list[Result] = []
    if smallest := inputs.declaration.smallest:
        rows += equivalence.equivalence_rows(
            smallest, inputs.episodes, inputs.answers, inputs.conditions, inputs.contrast
        )
    if declared := main_test(inputs.declaration, inputs.contrast):
        rows += sensitivity.sensitivity_rows(declared, inputs.every, inputs.episodes, inputs.quality, inputs.export)
    rows += sensitivity.attrition_rows(inputs.export, inputs.episodes, inputs.seed)
    rows += ordinal.ordinal_rows(inputs.answers, inputs.conditions)
    rows += model_checks.model_rows(inputs.episodes, inputs.conditions)
    if inputs.contrast:
        rows += model_checks.simple_effects(inputs.episodes, inputs.contrast, inputs.layouts, inputs.agents)
    return rows


def main_test(declaration: Declaration, contrast: tuple[str, str] | None) -> DeclaredTest | None:
    """Return the declared primary test; without one, Welch's test of reward for the main contrast."""
    return declaration.primary or (DeclaredTest(REWARD, contrast) if contrast else None)
