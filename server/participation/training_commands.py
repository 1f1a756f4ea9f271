"""The commands that train agents and predictors for a kitchen. Their results are where studies find them by name."""

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from models.agents.model_paths import is_class, without_variant
from models.agents.own_checkpoints import OwnCheckpoints
from overcooked.layout import bundled_grid, layout_names, load_layout
from overcooked.layout_file import LayoutError
from server.required_models import WEIGHTS, WITHOUT_WEIGHTS
from server.settings import own_models_here

PARTNER_SEEDS: Final = (2, 3, 4, 5)


@dataclass(frozen=True)
class TrainingCommands:
    """Commands for one kitchen. `file`: the bundled kitchen's name, or the `.layout` file that they read; `models`: the
    folder to which they write; `is_taken`: the name is that of a bundled kitchen with another grid, so a study would
    find the models of that one. The kitchen needs a name of its own first."""

    kitchen: str
    file: str
    models: Path
    is_taken: bool = False

    @property
    def name(self) -> str:
        """What the trained agent is called."""
        return f"{self.kitchen}_agent"

    def agent(self, name: str = "", seed: int | None = None) -> str:
        """Return the command that trains an agent."""
        chosen = "" if seed is None else f" --seed {seed}"
        return f"kitchenmind train agent {self._layout}{chosen} --out {self._place(name or self.name)}"

    @property
    def note(self) -> str:
        """What is to be done first, in brackets; "" if the file that the commands read is there."""
        if self.file == self.kitchen or Path(self.file).is_file():
            return ""
        return f" (it reads {self.file}: save the kitchen in the dashboard, or write its rows into that file)"

    def partners(self) -> list[str]:
        """Return the commands that train partners, with whom the agent plays the games from which its predictor
        learns."""
        return [self.agent(f"partners/partner_{seed}", seed) for seed in PARTNER_SEEDS]

    def collect(self, agent: str = "") -> str:
        """Return the command that plays these games."""
        partners = "" if self.file == self.kitchen else f" --partners {self._place('partners')}"
        return f"kitchenmind collect {self._layout} --agent {self._given(agent or self.name)}{partners}"

    def predictor(self, agent: str = "", form: str = "stream") -> str:
        """Return the command that trains an agent's predictor."""
        name = agent or self.name
        short = Path(without_variant(name)).name.removesuffix(".onnx")
        out = self._place(f"{short}_predictor_{form}" if short.isidentifier() else f"{self.kitchen}_predictor")
        form_words = "" if form == "stream" else f" --form {form}"
        return f"kitchenmind train predictor {self._layout} --agent {self._given(name)}{form_words} --out {out}"

    @property
    def _layout(self) -> str:
        return f"--layout {shlex.quote(self.file)}"

    def _place(self, name: str) -> str:
        return shlex.quote(str(self.models / self.kitchen / name))

    def _given(self, agent: str) -> str:
        """Return how a command names an agent: a trained one by its folder."""
        base = without_variant(agent)
        is_known = base in WITHOUT_WEIGHTS or (WEIGHTS / self.kitchen / base).is_dir()
        if is_known or "/" in base or is_class(base) or base.endswith(".onnx") or "://" in base:
            return shlex.quote(base)
        return self._place(base)


def training_commands(kitchen: str, own_models: Path | None = None, grid: str | None = None) -> TrainingCommands:
    """Return the commands for a kitchen; `own_models`: the server's folder of trained models; `grid`: of a kitchen that
    was drawn, else it is the saved or bundled one. Folders are relative to the current one, if they are in it: a
    server's commands are run where the server runs."""
    models, bundled = own_models or own_models_here(), bundled_grid(kitchen)
    is_taken = bundled is not None and grid not in (None, bundled)
    is_bundled = bundled is not None and not is_taken
    file = kitchen if is_bundled else str(_shown(_file(kitchen, models)))
    return TrainingCommands(kitchen, file, _shown(models), is_taken)


def is_file_ready(kitchen: str, grid: str, own_models: Path) -> bool:
    """Return whether the file that the commands read has this grid."""
    try:
        return (bundled_grid(kitchen) or load_layout(_file(kitchen, own_models)).text) == grid
    except (LayoutError, OSError):
        return False


def own_names_of(grids: Mapping[str, str], own_models: Path) -> dict[str, dict[str, list[str]]]:
    """Return the trained agents and predictors of each kitchen that has some. `grids`: of the kitchens that are not
    bundled, or that a study draws."""
    checkpoints = OwnCheckpoints(own_models)
    every = {**{name: load_layout(name).text for name in layout_names()}, **grids}
    found = {kitchen: checkpoints.of_kitchen(kitchen, grid) for kitchen, grid in every.items()}
    return {
        kitchen: {
            kind: [name for name, one in named.items() if one.kind == kind.removesuffix("s")]
            for kind in ("agents", "predictors")
        }
        for kitchen, named in found.items()
        if named
    }


def _file(kitchen: str, own_models: Path) -> Path:
    return own_models.parent / "kitchens" / f"{kitchen}.layout"


def _shown(path: Path) -> Path:
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path
