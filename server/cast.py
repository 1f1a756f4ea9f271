"""Which agents and predictors the studies need, and which of them there are no weights for. Loads none of them."""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from models.blackbox import is_foreign
from server.settings import ROOT
from server.study.loader import StudyFile
from server.web.episodes import models_of

WEIGHTS = ROOT / "models" / "weights"
WITHOUT_WEIGHTS: Final = frozenset({"planner", "guide", "random", "stay"})
Name = tuple[str, str]  # (layout, model)


@dataclass(frozen=True)
class Cast:
    """The models of some studies."""

    agents: tuple[Name, ...]
    predictors: tuple[Name, ...]

    @property
    def missing(self) -> tuple[Name, ...]:
        return tuple(name for name in (*self.agents, *self.predictors) if not _is_there(name))


def cast_of(files: Iterable[StudyFile]) -> Cast:
    """Everything that is asked in the games of these studies."""
    pairs = [models_of(file.study) for file in files]
    agents = {name for of_study, _ in pairs for name in of_study}
    predictors = {name for _, of_study in pairs for name in of_study}
    return Cast(tuple(sorted(agents)), tuple(sorted(predictors)))


def fingerprint(layout: str, model: str) -> str | None:
    """Names a checkpoint in the data: the hash of its `sha256` file. None for a model that is none of ours."""
    path = WEIGHTS / layout / _base(model) / "sha256"
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else None


def _is_there(name: Name) -> bool:
    layout, model = name
    return model in WITHOUT_WEIGHTS or is_foreign(model) or (WEIGHTS / layout / _base(model) / "config.json").is_file()


def _base(model: str) -> str:
    return model.partition("@")[0]
