"""Hashes of everything a study runs on: kitchens, models and every file of the code. The same on every machine."""

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from models.agents.model_paths import without_variant
from server.participation.episode_specs import layout_of
from server.required_models import WITHOUT_WEIGHTS, RequiredModels, required_models
from server.settings import ROOT
from server.study.loader import StudyFile
from server.study_check import missing_problems
from server.version import code_version

NOT_HASHED: Final = "cannot be hashed"
_PARTS: Final = ("kitchenmind", "overcooked", "models", "server", "analysis", "migrations", "static", "templates")
_KINDS: Final = frozenset({".py", ".html", ".j2", ".js", ".css", ".svg", ".yaml", ".layout"})


class StateError(ValueError):
    """Something that the study needs is missing; the message says what."""


@dataclass(frozen=True)
class BundleState:
    """The SHA-256 of everything that a study runs on, by name: grids by layout, weights by LAYOUT/MODEL, and files of
    the code by path in the repository."""

    code_version: str
    layouts: Mapping[str, str]
    models: Mapping[str, str]
    code: Mapping[str, str]

    @classmethod
    def of(cls, manifest: Mapping[str, Any]) -> "BundleState":
        """Read from a manifest. Raises KeyError, TypeError for an invalid one."""
        parts = {name: dict(manifest[name]) for name in ("layouts", "models", "code")}
        return cls(str(manifest["code_version"]), **parts)

    def to_manifest(self) -> dict[str, Any]:
        """Return the values for a manifest."""
        maps = {name: dict(getattr(self, name)) for name in ("layouts", "models", "code")}
        return {"code_version": self.code_version, **maps}


def state_of(file: StudyFile) -> BundleState:
    """Return the current state of this machine. Raises StateError for missing models, LayoutError, StudyError."""
    required = required_models([file])
    missing = [file.describe(problem) for problem in missing_problems(file, required)]
    if missing:
        raise StateError("\n".join(missing))
    kitchens = (*file.study.layouts, file.study.tutorial.layout)
    layouts = {kitchen.name: _sha256(layout_of(kitchen).text.encode()) for kitchen in kitchens}
    models = {
        f"{layout}/{model}": _model(required, layout, model)
        for layout, model in sorted({*required.agents, *required.predictors})
    }
    return BundleState(code_version(), dict(sorted(layouts.items())), models, dict(_code()))


def outside_models(file: StudyFile) -> list[str]:
    """Return the models of a study that are code outside this repository or an address: `module:Class` and URLs."""
    required = required_models([file])
    models = {without_variant(model) for _, model in (*required.agents, *required.predictors)}
    return sorted(model for model in models if ":" in model)


def differences(wanted: BundleState, here: BundleState) -> list[str]:
    """Return the differences from `wanted`, one sentence each; empty: everything is the same."""
    found = [f"the kitchen {name} is another one" for name in _unlike(wanted.layouts, here.layouts)]
    found += [f"the weights of {name} are others" for name in _unlike(wanted.models, here.models)]
    files = _unlike(wanted.code, here.code)
    if files:
        more = f" and {len(files) - 5} more" if len(files) > 5 else ""
        versions = f"made with {wanted.code_version}, this is {here.code_version}"
        found.append(f"the code differs in {', '.join(files[:5])}{more} ({versions})")
    return found


def _unlike(wanted: Mapping[str, str], here: Mapping[str, str]) -> list[str]:
    return sorted(name for name in wanted.keys() | here.keys() if wanted.get(name) != here.get(name))


def _model(required: RequiredModels, layout: str, model: str) -> str:
    base = without_variant(model)
    return required.fingerprint(layout, model) or (f"scripted: {base}" if base in WITHOUT_WEIGHTS else NOT_HASHED)


def _code() -> Iterator[tuple[str, str]]:
    """Hash every file that runs or is shown, by its path; weights are hashed with their models."""
    for path in sorted(path for part in _PARTS for path in (ROOT / part).rglob("*")):
        inside = path.relative_to(ROOT)
        if path.suffix in _KINDS and inside.parts[:2] != ("models", "weights"):
            yield inside.as_posix(), _sha256(path.read_bytes())


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
