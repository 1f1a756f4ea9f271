"""Find the agents and predictors that the studies need, where they are, and which are missing, without loading them."""

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from models.agents.blackbox import is_foreign
from models.agents.model_paths import ModelPaths, has_class, is_class, located, source_file, without_variant
from models.agents.onnx_weights import onnx_sha256
from models.agents.own_checkpoints import OwnCheckpoints
from overcooked.layout import load_layout
from server.participation.episode_specs import layout_of, models_of
from server.settings import ROOT
from server.study.checks import Problem
from server.study.loader import StudyFile

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
    own: OwnCheckpoints | None = None
    pins: Mapping[Name, str] = field(default_factory=dict)  # the SHA-256 that a version of a study must find

    @property
    def missing(self) -> tuple[Name, ...]:
        """The models that this machine does not have."""
        return tuple(name for name in (*self.agents, *self.predictors) if self.lacks(*name) is not None)

    def grid_of(self, layout: str) -> str:
        """Return the grid of a layout of these studies, drawn or bundled."""
        return self.grids.get(layout) or load_layout(layout).text

    def lacks(self, layout: str, model: str) -> str | None:
        """Return what is missing of a model, as a clause; None if it is complete. No code of it is run."""
        base = without_variant(self.paths.located(layout, model))
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
        if (folder_of(layout, base) / "config.json").is_file() or self._has_own(layout, base):
            return None
        return f"there is no checkpoint in {base}" if "/" in base else self._no_such(layout, base)

    def _has_own(self, layout: str, name: str) -> bool:
        pin = self.pins.get((layout, name))
        return self.own is not None and self.own.find(layout, name, pin) is not None

    def _no_such(self, layout: str, name: str) -> str:
        """Say that a kitchen has no trained model of this name, or why the existing one is another one."""
        if self.own is not None and (layout, name) in self.pins:
            found = self.own.find(layout, name)
            place = self.own.root / layout
            now = f"{found.folder} now has {found.sha256[:12]}…" if found else f"it is not in {place}"
            pin = self.pins[layout, name][:12]
            return f"this version of the study plays {layout} with the {name!r} whose SHA-256 is {pin}…; {now}"
        fault = self.own.fault(layout, name) if self.own is not None else None
        is_predictor = (layout, name) in {(one, without_variant(model)) for one, model in self.predictors}
        kind = "predictor" if is_predictor else "agent"
        return f"the kitchen {layout} has no trained {kind} called {name!r}{f' ({fault})' if fault else ''}"

    def fingerprint(self, layout: str, model: str) -> str | None:
        """Return the SHA-256 that identifies a model in the data; None for one without files. A path in the
        name counts from the folder of the study."""
        return fingerprint(layout, self.paths.located(layout, model), self.paths.folders)


def required_models(files: Iterable[StudyFile]) -> RequiredModels:
    """Return all models of these studies' games. Raises StudyError where two of them mean different
    kitchens or different files by one name."""
    files = list(files)
    pairs = [models_of(file.study) for file in files]
    agents = {name for of_study, _ in pairs for name in of_study}
    predictors = {name for _, of_study in pairs for name in of_study}
    root = next((file.own_models for file in files if file.own_models is not None), None)
    own = None if root is None else OwnCheckpoints(root)
    pins = _pins(files)
    paths = _paths(files, own, pins)
    return RequiredModels(tuple(sorted(agents)), tuple(sorted(predictors)), _grids(files), paths, own, pins)


def own_names(file: StudyFile) -> set[Name]:
    """Return (layout, name) of the models that a study names and that are nothing bundled, scripted or from outside:
    checkpoints of one's own, which may be missing."""
    named = {(layout, without_variant(model)) for layout, model in set().union(*models_of(file.study))}
    return {(layout, name) for layout, name in named if _is_own_name(layout, name, file.folder)}


def _is_own_name(layout: str, name: str, folder: Path) -> bool:
    is_plain = name not in WITHOUT_WEIGHTS and "/" not in name and not is_foreign(name)
    return is_plain and located(name, folder) == name and not (WEIGHTS / layout / name).is_dir()


def _pins(files: list[StudyFile]) -> dict[Name, str]:
    """Return the checkpoints that versions keep. Raises StudyError where two versions keep different ones of one
    name."""
    found: dict[Name, str] = {}
    for file in files:
        for layout, name in sorted(own_names(file)):
            pin = file.study.checkpoints.get(f"{layout}/{name}")
            if pin is not None and found.setdefault((layout, name), pin) != pin:
                reason = f"{name!r} in {layout} has been trained again since another version was opened"
                reason = f"{reason}, and participants keep that version"
                raise file.places.error([Problem(("agents",), reason, "Train under another name.")])
    return found


def _checkpoints(files: list[StudyFile], own: OwnCheckpoints, pins: Mapping[Name, str]) -> dict[Name, str]:
    named = set().union(*map(own_names, files))
    found = {name: own.find(*name, pins.get(name)) for name in named}
    return {name: str(one.folder) for name, one in found.items() if one is not None}


def _paths(files: list[StudyFile], own: OwnCheckpoints | None, pins: Mapping[Name, str]) -> ModelPaths:
    """Return the paths of the models. Relative ones start from the folder of the study file."""
    found: dict[str, str] = {}
    for file in files:
        for _, model in sorted(set().union(*models_of(file.study))):
            path = located(model, file.folder)
            if path != model and found.setdefault(model, path) != path:
                reason = f"{model!r} is another file than in another study ({found[model]})"
                raise file.places.error([Problem(("agents",), reason, "Rename one of them, or write absolute paths.")])
    folders = tuple(dict.fromkeys(str(file.folder) for file in files))
    return ModelPaths(found, folders, {} if own is None else _checkpoints(files, own, pins))


def _grids(files: Iterable[StudyFile]) -> dict[str, str]:
    grids: dict[str, str] = {}
    drawn: set[str] = set()
    for file in files:
        for k, kitchen in enumerate((*file.study.layouts, file.study.tutorial.layout)):
            text = layout_of(kitchen).text
            if grids.setdefault(kitchen.name, text) != text:
                reason = f"{kitchen.name!r} is another kitchen in another study of this server"
                path = ("layouts", k) if k < len(file.study.layouts) else ("tutorial", "layout")
                raise file.places.error([Problem((*path, "name"), reason, "Rename one of them.")])
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
