"""The design of a study for a power analysis, from a study file or from the export of a pilot."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import polars as pl
import yaml

from analysis import measures, mixed_model, primary
from analysis.declared import DeclaredTest, declaration_of, declared_test
from analysis.factorial import levels_in
from analysis.factorial_within import repeated_factors, within_of
from analysis.mixed_model import Variance
from analysis.study import MEASURE, smallest_condition
from analysis.tables import Export
from analysis.within_effects import with_levels


@dataclass(frozen=True)
class StudyPlan:
    """Episodes of a participant, planned participants, and the variance of reward if data are given."""

    episodes: int
    participants: int
    person_sd: float | None = None
    residual_sd: float | None = None
    declared: DeclaredTest | None = None  # the primary test of the study file
    primary_episodes: int = 0  # of a participant that the primary test uses
    factors: dict[str, int] = field(default_factory=dict)  # how many levels each has
    within: tuple[str, ...] = ()  # factors of which each participant meets all levels, in blocks
    left_out: tuple[str, ...] = ()  # combinations of levels that the study does not have
    answer_sds: tuple[float, float] | None = None  # between and within people, of the primary test's question
    simulated: bool = False  # the variances come from simulated participants
    for_two: bool = False  # rounds are played by two people, and count for one of them
    unequal: tuple[str, ...] = ()  # conditions with their quotas or weights, if these differ


def plan_of_study_file(path: Path) -> StudyPlan:
    """Return the episodes of a participant as a study file plans them. Raises ValueError for any other file."""
    try:
        study = yaml.load(path.read_text(encoding="utf-8"), Loader=yaml.BaseLoader)  # noqa: S506 - texts only
        repeat = int(study.get("order", {}).get("repeat", 1))
        layouts, agents = len(study["layouts"]), len(study["agents"])
        partners = [str(agent.get("human")).lower() for agent in study["agents"] if isinstance(agent, dict)]
        for_two = bool({"true", "yes", "on"} & set(partners))
        factors = {name: len(levels) for name, levels in (study.get("factors") or {}).items()}
        cells = study.get("cells") or {}
        left_out, within = (tuple(map(str, cells.get(key) or ())) for key in ("without", "within"))
        repeat *= math.prod(factors[name] for name in within)  # each block has all rounds
        unequal = _unequal(study.get("conditions") or ())
    except OSError as error:
        raise ValueError(
            f"cannot read {path}: {error.strerror}. Give a study file or the folder of an export."
        ) from None
    except (yaml.YAMLError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise ValueError(f"{path} is not a study file: it needs `layouts` and `agents`.") from None
    try:
        declared = declared_test(study)
    except ValueError as error:
        raise ValueError(f"{path}: {error}. `kitchenmind study check {path}` names the line.") from None
    used = (len(declared.layouts) or layouts) * (len(declared.agents) or agents) * repeat if declared else 0
    return StudyPlan(
        layouts * agents * repeat,
        29,
        declared=declared,
        primary_episodes=used,
        factors=factors,
        within=within,
        left_out=left_out,
        for_two=for_two,
        unequal=unequal,
    )


def _unequal(conditions: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    """Return the conditions of a study file with their quotas, or their weights where one has no quota; nothing if
    these are equal."""
    quotas = all(condition.get("quota") for condition in conditions)
    sizes = {
        str(condition["name"]): int((condition.get("quota") if quotas else condition.get("weight")) or 1)
        for condition in conditions
    }
    return tuple(f"{name} {size}" for name, size in sizes.items()) if len(set(sizes.values())) > 1 else ()


def plan_of_export(export: Export, declared: DeclaredTest | None = None) -> StudyPlan:
    """Return the design of an exported study and how its reward varies, and the answers too if the primary test
    (`declared`, else the study's own) is about them. Raises ValueError if the data do not show the variance."""
    episodes = measures.analysed(measures.episode_measures(export), export.participants)
    model = mixed_model.fit(episodes, MEASURE, export.conditions)
    variance = model.variance
    if variance is None:
        raise ValueError(
            f"{export.folder} does not show how reward varies: its mixed model {model.rows[0].note}. Give both "
            "--person-sd and --residual-sd with a study file."
        )
    plan = _plan_of(export, episodes, variance, declared or declaration_of(export).primary)
    if plan.declared is None:
        return plan
    table, measure = primary.values_of_episodes(plan.declared, episodes, export.answers)
    people = max(1, table["participant"].n_unique())
    plan = replace(plan, primary_episodes=max(1, round(table.height / people)))
    if measure == MEASURE:
        return plan
    spread = mixed_model.fit(with_levels(table, episodes), measure, export.conditions).variance
    return replace(plan, answer_sds=(spread.person_sd, spread.residual_sd)) if spread else plan


def _plan_of(export: Export, episodes: pl.DataFrame, variance: Variance, declared: DeclaredTest | None) -> StudyPlan:
    """Return the design of the study that was exported, with the variance of its reward."""
    within = within_of(export)
    factors = repeated_factors(export) if within else levels_in(export)
    return StudyPlan(
        round(episodes.height / episodes["participant"].n_unique()),
        smallest_condition(episodes, export.conditions),
        variance.person_sd,
        variance.residual_sd,
        declared,
        factors={name: len(levels) for name, levels in factors.items()},
        within=within,
        left_out=tuple(export.about.get("left_out") or ()),
        simulated=export.is_simulated,
        for_two=episodes["watched_person"].is_not_null().any(),
    )
