"""Presets of `kitchenmind train study`: how many agents a study has, and the settings of each role in each kitchen.

A preset is a TOML file (`training/configs/study_*.toml`). Its tables name roles: `[population_sp]` changes the settings
of a role in every kitchen, `[layout.NAME.ROLE]` in one kitchen, and a table named after one run (`population_sp_1`)
changes that run alone. `[predictor]` changes the predictors' settings. `like = "NAME"` in `[layout.OTHER]` gives a
kitchen the tables of kitchen NAME; its own take precedence.
"""

import difflib
import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import Field

from overcooked.other_names import bundled_name
from training.agent_config import CONFIG_FOLDER, AgentConfig
from training.settings import ConfigError, TrainingSettings

ROLES = ("population_sp", "target_sp", "population_fcp", "target_fcp", "features")
AUXILIARY_ROLES = ("crowd_sp", "crowd_fcp")  # the names of their tasks, which are stored
FIRST_SEEDS = {
    "population_sp": 1, "target_sp": 11, "population_fcp": 21, "target_fcp": 31, "features": 41,
    "crowd_sp": 101, "crowd_fcp": 201,
}  # fmt: skip
_RUN = re.compile(rf"({'|'.join((*ROLES, *AUXILIARY_ROLES))})_\d+")
_AUXILIARY_KEYS = ("auxiliary_partners", "crowd")  # the second is the former name
_STREAM_EXTRAS = "stream_extras"
_LIKE = "like"


class StudyScale(TrainingSettings):
    """The settings at the top of a preset."""

    population: int = Field(ge=1, description="SP agents, and as many FCP agents, whose skill levels are the partners.")
    targets: int = Field(ge=1, description="Runs from which the target is chosen, for SP and FCP alike.")
    least_reward: float = Field(
        0.0,
        ge=0,
        description="A run whose best reward is lower is trained again with two more seeds; the best run is kept.",
    )
    extras: bool = Field(True, description="Whether predictors also train with partners that the paper does not have.")
    publish: bool = Field(
        True, serialization_alias="ship", description="Whether the results replace the weights in models/weights."
    )


class Preset(StudyScale):
    """A preset: the scale of a study and the tables of its settings."""

    name: str
    tables: dict[str, Any]

    def auxiliary_partners(self, layout: str) -> int:
        """Return how many SP agents, and half as many FCP agents, are partners in training predictors only."""
        found = [table[key] for _, table in self._tables_of(layout) for key in _AUXILIARY_KEYS if key in table]
        return int(found[-1]) if found else 0

    def forms_with_extras(self, layout: str) -> tuple[str, ...]:
        """Return the forms whose predictors also train with partners that the paper does not have."""
        if self.extras:
            return ("stream", "window")
        wanted = [table[_STREAM_EXTRAS] for _, table in self._tables_of(layout) if _STREAM_EXTRAS in table]
        return ("stream",) if wanted and wanted[-1] else ()

    def config(self, layout: str, role: str, run: str = "") -> AgentConfig:
        """Return the training config of a role in a kitchen, and of one of its runs. Auxiliary partners learn as the
        population does. Raises ConfigError."""
        role = role.replace("crowd", "population")
        config = AgentConfig()
        for prefix, tables in (("", self.tables), *self._tables_of(layout)):
            for name in (role, run):
                config = config.changed(tables.get(name, {}), f"{self.name}: [{prefix}{name}]")
        return config

    def predictor_settings(self, layout: str) -> dict[str, Any]:
        """Return the changed settings of a kitchen's predictors; a table in it belongs to one form."""
        settings = dict(self.tables.get("predictor", {}))
        for _, table in self._tables_of(layout):
            settings.update(table.get("predictor", {}))
        return settings

    def _tables_of(self, layout: str) -> list[tuple[str, Mapping[str, Any]]]:
        """Return the tables of a kitchen, each with its prefix: first those of the kitchen named by `like`, then its
        own, which take precedence."""
        layouts: Mapping[str, Mapping[str, Any]] = self.tables.get("layout", {})
        own = layouts.get(layout, {})
        names = (own[_LIKE], layout) if _LIKE in own else (layout,)
        return [(f"layout.{name}.", layouts.get(name, {})) for name in names]


def load_preset(name: str) -> Preset:
    """Return a preset by its name, e.g. cpu, or of a TOML file. Raises ConfigError."""
    path = Path(name) if name.endswith(".toml") else CONFIG_FOLDER / f"study_{name}.toml"
    if not path.is_file():
        known = ", ".join(sorted(p.stem.removeprefix("study_") for p in CONFIG_FOLDER.glob("study_*.toml")))
        raise ConfigError(f"there is no preset {name!r}. Known: {known}; or give the path of a .toml file.")
    try:
        settings = tomllib.loads(path.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path}: {error}. Write lines like: population = 5") from error
    tables = {key: value for key, value in settings.items() if isinstance(value, dict)}
    scale = StudyScale.checked({key: settings[key] for key in settings.keys() - tables.keys()}, str(path))
    _check_tables(tables, "", ("predictor", "layout"), path)
    for layout, table in tables.get("layout", {}).items():
        _check_layout(layout, table, path)
        _check_like(layout, tables["layout"], path)
    return Preset(name=name, tables=tables, **scale.model_dump())


def _check_layout(layout: str, table: Any, path: Path) -> None:
    place = f"{path}: [layout.{layout}]"
    if not isinstance(table, dict):
        raise ConfigError(f"{place} is {table!r}. Write a table, e.g. [layout.{layout}.population_sp].")
    if bundled_name(layout) != layout:
        name = bundled_name(layout)
        raise ConfigError(f"{place}: {layout} is called {name} here. Write [layout.{name}].")
    for key in _AUXILIARY_KEYS:
        if type(table.get(key, 0)) is not int or table.get(key, 0) < 0:
            raise ConfigError(f"{place} {key} is {table[key]!r}. Write a whole number of at least 0.")
    if type(table.get(_STREAM_EXTRAS, False)) is not bool:
        raise ConfigError(f"{place} {_STREAM_EXTRAS} is {table[_STREAM_EXTRAS]!r}. Write true or false.")
    names = [key for key in table if key not in (*_AUXILIARY_KEYS, _STREAM_EXTRAS, _LIKE)]
    _check_tables({key: table[key] for key in names}, f"layout.{layout}.", ("predictor",), path)


def _check_like(layout: str, layouts: Mapping[str, Any], path: Path) -> None:
    """Refuse a `like` that names no kitchen with settings of its own."""
    table = layouts[layout]
    known = [name for name, other in layouts.items() if isinstance(other, dict) and _LIKE not in other]
    if _LIKE in table and table[_LIKE] not in known:
        names = f"one of {', '.join(known)}" if known else "a kitchen that has its own tables"
        raise ConfigError(f"{path}: [layout.{layout}] like is {table[_LIKE]!r}. Write {names}.")


def _check_tables(tables: Mapping[str, Any], prefix: str, others: Iterable[str], path: Path) -> None:
    """Refuse a table that no role, run or predictor would read, and a value where a table belongs."""
    known = (*ROLES, *others)
    for name, table in tables.items():
        if name not in known and not _RUN.fullmatch(name):
            near = difflib.get_close_matches(name, known, 1)
            hint = f"Did you mean [{prefix}{near[0]}]? " if near else ""
            raise ConfigError(f"{path}: unknown table [{prefix}{name}]. {hint}Known: {', '.join(known)}, or one run.")
        if not isinstance(table, dict):
            raise ConfigError(f"{path}: {prefix}{name} is {table!r}. Write a table: [{prefix}{name}].")


def seeds(role: str, preset: Preset) -> list[str]:
    """Return the names of a role's runs."""
    count = {"features": 1, "population_sp": preset.population, "population_fcp": preset.population}.get(
        role, preset.targets
    )
    return [f"{role}_{FIRST_SEEDS[role] + k}" for k in range(count)]
