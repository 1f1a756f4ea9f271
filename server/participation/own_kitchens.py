"""Kitchens drawn in the dashboard, in the studies that name them. When a study is read, the grids of these kitchens are
written into its text. A stored, bundled or hashed version of a study thus contains its kitchens, and later changes to a
kitchen do not affect it.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from overcooked.layout import Layout, layout_names
from server.required_models import WEIGHTS
from server.study.definition import Study
from server.study.loader import StudyFile, load_study, parse_study
from server.study.written_grids import with_grids

SCRIPTED: Final = ("planner", "random", "stay")  # agents that can play every kitchen
Grids = Callable[[], Mapping[str, str]]  # called only if a study names a kitchen that is not bundled


def load_with_kitchens(path: str | Path, grids: Grids, models_folder: Path | None = None) -> StudyFile:
    """Return the study in a file, with the grids of the kitchens that it names. Raises StudyError, FileNotFoundError,
    and what `grids` raises."""
    return with_own_kitchens(load_study(path, models_folder), grids)


def with_own_kitchens(file: StudyFile, grids: Grids) -> StudyFile:
    """Return the study with the grids of the kitchens that it names; errors still name the lines of the file."""
    wanted = named_kitchens(file.study) - set(layout_names())
    found = {name: grid for name, grid in grids().items() if name in wanted} if wanted else {}
    if not found:
        return file
    made = parse_study(with_grids(file.text, found), file.source)
    return replace(file, study=made.study, text=made.text, sha256=made.sha256)


def named_kitchens(study: Study) -> set[str]:
    """Return the names of the kitchens that a study uses without drawing them."""
    return {kitchen.name for kitchen in (*study.layouts, study.tutorial.layout) if kitchen.grid is None}


def studies_with(studies: Mapping[str, Study], kitchen: str) -> list[str]:
    """Return the names of the studies that play in a kitchen of this name."""
    return [
        name
        for name, study in studies.items()
        if any(one.name == kitchen for one in (*study.layouts, study.tutorial.layout))
    ]


@dataclass(frozen=True)
class TrainedModels:
    """What can play in a grid, or predict in it. `layout`: the name of the kitchen that has these models."""

    layout: str
    scripted: tuple[str, ...]
    agents: tuple[str, ...]
    predictors: tuple[str, ...]


def trained_models(layout: Layout) -> TrainedModels:
    """Return the agents and predictors of a grid; a kitchen's name decides where a study finds its models."""
    found: dict[str, list[str]] = {}
    for config in sorted(WEIGHTS.glob("*/*/config.json")):
        if json.loads(config.read_text("utf-8")).get("grid") == layout.text:
            found.setdefault(config.parents[1].name, []).append(config.parent.name)
    name = layout.name if layout.name in found else min(found, default=layout.name)
    models = found.get(name, [])
    return TrainedModels(
        layout=name,
        scripted=SCRIPTED,
        agents=tuple(one for one in models if "_predictor_" not in one),
        predictors=tuple(one for one in models if "_predictor_" in one),
    )
