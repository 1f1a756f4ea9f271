"""Which agents and predictors the studies need, and which of them there are no weights for. Loads none of them."""

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from models.blackbox import is_foreign
from server.settings import ROOT
from server.study.loader import StudyError, StudyFile
from server.web.episodes import layout_of, models_of

WEIGHTS = ROOT / "models" / "weights"
WITHOUT_WEIGHTS: Final = frozenset({"planner", "guide", "random", "stay"})
Name = tuple[str, str]  # (layout, model)


@dataclass(frozen=True)
class Cast:
    """The models of some studies."""

    agents: tuple[Name, ...]
    predictors: tuple[Name, ...]
    grids: Mapping[str, str]  # layouts that the studies draw themselves: name -> grid

    @property
    def missing(self) -> tuple[Name, ...]:
        return tuple(name for name in (*self.agents, *self.predictors) if not _is_there(name))


def cast_of(files: Iterable[StudyFile]) -> Cast:
    """Everything that is asked in the games of these studies. Raises StudyError where two draw one name differently."""
    files = list(files)
    pairs = [models_of(file.study) for file in files]
    agents = {name for of_study, _ in pairs for name in of_study}
    predictors = {name for _, of_study in pairs for name in of_study}
    return Cast(tuple(sorted(agents)), tuple(sorted(predictors)), _grids(files))


def _grids(files: Iterable[StudyFile]) -> dict[str, str]:
    grids: dict[str, str] = {}
    drawn: set[str] = set()
    for file in files:
        for kitchen in (*file.study.layouts, file.study.tutorial.layout):
            text = layout_of(kitchen).text
            if grids.setdefault(kitchen.name, text) != text:
                reason = f"{file.source}: {kitchen.name!r} is another kitchen in another study"
                raise StudyError([f"{reason}. Rename one of them."])
            drawn |= {kitchen.name} if kitchen.grid is not None else set()
    return {name: grids[name] for name in drawn}


def fingerprint(layout: str, model: str) -> str | None:
    """Names a checkpoint in the data: the hash of its `sha256` file. None for a model that is none of ours."""
    path = folder_of(layout, model) / "sha256"
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else None


def folder_of(layout: str, model: str) -> Path:
    """Where a model's checkpoint lies or would lie: a path as it is, a name among the shipped ones."""
    base = _base(model)
    return Path(base) if "/" in base else WEIGHTS / layout / base


def _is_there(name: Name) -> bool:
    layout, model = name
    if _base(model) in WITHOUT_WEIGHTS or is_foreign(model):
        return True
    return (folder_of(layout, model) / "config.json").is_file()


def _base(model: str) -> str:
    return model.partition("@")[0]
