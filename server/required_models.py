"""Find the agents and predictors that the studies need, where they are, and which are missing, without loading them."""

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from models.agents.blackbox import is_foreign
from models.agents.model_paths import ModelPaths, has_class, is_class, located, source_file, without_variant
from models.agents.onnx_weights import onnx_sha256
from server.participation.episode_specs import layout_of, models_of
from server.settings import ROOT
from server.study.loader import StudyError, StudyFile

WEIGHTS = ROOT / "models" / "weights"
WITHOUT_WEIGHTS: Final = frozenset({"planner", "guide", "carrier", "random", "stay"})
Name = tuple[str, str]  # (layout, model)


@dataclass(frozen=True)
class RequiredModels:
    """The models of some studies."""

    agents: tuple[Name, ...]
    predictors: tuple[Name, ...]
    grids: Mapping[str, str]  # layouts that the studies draw themselves: name -> grid
    paths: ModelPaths = field(default_factory=ModelPaths)

    @property
    def missing(self) -> tuple[Name, ...]:
        """The models that this machine does not have."""
        return tuple(name for name in (*self.agents, *self.predictors) if self.lacks(*name) is not None)

    def lacks(self, layout: str, model: str) -> str | None:
        """Return what is missing of a model, as a clause; None if it is complete. No code of it is run."""
        base = without_variant(self.paths.located(model))
        if base in WITHOUT_WEIGHTS or base.startswith(("http://", "https://")):
            return None
        if is_class(base):
            file = source_file(base, self.paths.folders)
            module, _, wanted = base.partition(":")
            if file is None:
                return f"there is no Python module {module}"
            try:
                return None if has_class(file, base) else f"{file} has no class {wanted}"
            except (SyntaxError, ValueError, RecursionError) as error:
                line = f":{error.lineno}" if isinstance(error, SyntaxError) and error.lineno else ""
                return f"{file}{line} is not valid Python ({str(error).partition(' (')[0]})"
        if base.endswith(".onnx"):
            return None if Path(base).is_file() else f"there is no file {base}"
        if (folder_of(layout, base) / "config.json").is_file():
            return None
        return f"there is no checkpoint in {base}" if "/" in base else f"there are no weights for {layout} of: {base}"

    def fingerprint(self, layout: str, model: str) -> str | None:
        """Return the SHA-256 that identifies a model in the data, see `fingerprint`."""
        return fingerprint(layout, self.paths.located(model), self.paths.folders)


def required_models(files: Iterable[StudyFile]) -> RequiredModels:
    """Return all models of these studies' games. Raises StudyError where two of them mean different
    kitchens or different files by one name."""
    files = list(files)
    pairs = [models_of(file.study) for file in files]
    agents = {name for of_study, _ in pairs for name in of_study}
    predictors = {name for _, of_study in pairs for name in of_study}
    return RequiredModels(tuple(sorted(agents)), tuple(sorted(predictors)), _grids(files), _paths(files))


def _paths(files: list[StudyFile]) -> ModelPaths:
    """Relative paths count from the folder of the study file."""
    found: dict[str, str] = {}
    for file in files:
        for _, model in sorted(set().union(*models_of(file.study))):
            path = located(model, file.folder)
            if path != model and found.setdefault(model, path) != path:
                reason = f"{file.source}: {model!r} is another file than in another study ({found[model]})"
                raise StudyError([f"{reason}. Rename one of them, or write absolute paths."])
    return ModelPaths(found, tuple(dict.fromkeys(str(file.folder) for file in files)))


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


def fingerprint(layout: str, model: str, folders: Iterable[str] = ()) -> str | None:
    """Return the SHA-256 that identifies a model in the data: of a checkpoint's `sha256` file, of an ONNX file, of the
    source file of a Python class. None for scripted models and addresses, which have no file."""
    base = without_variant(model)
    if is_class(base):
        path = source_file(base, folders)
    elif is_foreign(base):
        return onnx_sha256(Path(base)) if Path(base).is_file() else None
    else:
        path = folder_of(layout, base) / "sha256"
    return hashlib.sha256(path.read_bytes()).hexdigest() if path is not None and path.is_file() else None


def folder_of(layout: str, model: str) -> Path:
    """Return where a model's checkpoint is or would be: a path as it is, a name among the bundled ones."""
    base = without_variant(model)
    return Path(base) if "/" in base else WEIGHTS / layout / base
