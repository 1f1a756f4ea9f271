"""Kitchens drawn in the dashboard, in the studies that name them. When a study is read, the grids of these kitchens are
written into its text. A stored, bundled or hashed version of a study thus contains its kitchens, and later changes to a
kitchen do not affect it.
"""

import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from models.agents.own_checkpoints import OwnCheckpoints
from models.networks.checkpoint import CheckpointError
from overcooked.layout import Layout, LayoutError, layout_names
from server.participation.episode_specs import layout_of
from server.required_models import WEIGHTS, own_names
from server.study.definition import Study
from server.study.loader import StudyError, StudyFile, load_study, parse_study
from server.study.pinned_checkpoints import with_checkpoints
from server.study.written_grids import with_grids

SCRIPTED: Final = ("planner", "random", "stay")  # agents that can play every kitchen
Grids = Callable[[], Mapping[str, str]]  # called only if a study names a kitchen that is not bundled


def load_with_kitchens(
    path: str | Path, grids: Grids, models_folder: Path | None = None, own_models: Path | None = None
) -> StudyFile:
    """Return the study in a file, with the grids of the kitchens that it names, and the SHA-256 of the trained models
    of one's own. Raises StudyError, FileNotFoundError, and what `grids` raises."""
    file = with_own_kitchens(load_study(path, models_folder), grids)
    return file if own_models is None else with_own_models(file, own_models)


def with_own_kitchens(file: StudyFile, grids: Grids) -> StudyFile:
    """Return the study with the grids of the kitchens that it names; errors still name the lines of the file."""
    wanted = named_kitchens(file.study) - set(layout_names())
    found = {name: grid for name, grid in grids().items() if name in wanted} if wanted else {}
    if not found:
        return file
    made = parse_study(with_grids(file.text, found), file.source)
    return replace(file, study=made.study, text=made.text, sha256=made.sha256)


def with_own_models(file: StudyFile, own_models: Path) -> StudyFile:
    """Return the study with the SHA-256 of each trained model of one's own in its text, so that its version keeps them;
    `own_models`: the folder that has them. A model that is missing there is an error of the check, not of this."""
    file = replace(file, own_models=own_models)
    checkpoints, found = OwnCheckpoints(own_models), dict[str, str]()
    for kitchen, name in own_names(file):
        place, one = f"{kitchen}/{name}", checkpoints.find(kitchen, name)
        if one is not None and place not in file.study.checkpoints:
            found[place] = one.sha256
    if not found:
        return file
    made = parse_study(with_checkpoints(file.text, found), file.source)
    return replace(file, study=made.study, text=made.text, sha256=made.sha256)


def keep_own_models(file: StudyFile) -> None:
    """Copy the trained models of a version to where training does not change them. Raises StudyError."""
    for kitchen, name in sorted(own_names(file)) if file.own_models is not None else ():
        pin = file.study.checkpoints.get(f"{kitchen}/{name}")
        if pin is None or file.own_models is None:
            continue
        try:
            OwnCheckpoints(file.own_models).keep(kitchen, name, pin)
        except (CheckpointError, OSError) as error:
            raise StudyError([f"{file.source}: {name!r} in {kitchen} cannot be kept: {error}"]) from error


def named_kitchens(study: Study) -> set[str]:
    """Return the names of the kitchens that a study uses without drawing them."""
    return {kitchen.name for kitchen in (*study.layouts, study.tutorial.layout) if kitchen.grid is None}


def drawn_grids(study: Study) -> dict[str, str]:
    """Return the valid grids of the kitchens that a study draws."""
    found: dict[str, str] = {}
    for kitchen in (*study.layouts, study.tutorial.layout):
        with suppress(LayoutError):
            found |= {kitchen.name: layout_of(kitchen).text} if kitchen.grid is not None else {}
    return found


def studies_with(studies: Mapping[str, Study], kitchen: str) -> list[str]:
    """Return the names of the studies that play in a kitchen of this name."""
    return [
        name
        for name, study in studies.items()
        if any(one.name == kitchen for one in (*study.layouts, study.tutorial.layout))
    ]


@dataclass(frozen=True)
class TrainedModels:
    """What can play in a grid, or predict in it. `layout`: the name of the kitchen that has these models; `other_grid`:
    models that were trained under this name for an earlier grid."""

    layout: str
    scripted: tuple[str, ...]
    agents: tuple[str, ...]
    predictors: tuple[str, ...]
    other_grid: tuple[str, ...] = ()


def trained_models(layout: Layout, own_models: Path | None = None) -> TrainedModels:
    """Return the agents and predictors of a grid; a kitchen's name decides where a study finds its models."""
    found: dict[str, list[tuple[str, str]]] = {}  # names with their kinds
    for config in sorted(WEIGHTS.glob("*/*/config.json")):
        if json.loads(config.read_text("utf-8")).get("grid") == layout.text:
            name = config.parent.name
            kind = "predictor" if "_predictor_" in name else "agent"
            found.setdefault(config.parents[1].name, []).append((name, kind))
    own = {} if own_models is None else OwnCheckpoints(own_models).of_kitchen(layout.name)
    models = [(name, one.kind) for name, one in own.items() if one.grid == layout.text]
    if models:
        known = [one for one in found.get(layout.name, []) if one[0] not in own]
        found[layout.name] = [*known, *models]
    name = layout.name if layout.name in found else min(found, default=layout.name)
    named = found.get(name, [])
    return TrainedModels(
        layout=name,
        scripted=SCRIPTED,
        agents=tuple(one for one, kind in named if kind == "agent"),
        predictors=tuple(one for one, kind in named if kind == "predictor"),
        other_grid=tuple(name for name, one in own.items() if one.grid != layout.text),
    )
