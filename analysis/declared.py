"""Read what the study file declared about its analysis before data collection, from its versions in an export."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import yaml

from analysis.alpha_spending import SPENDING
from analysis.tables import Export, ExportError

TESTS = ("welch", "student", "mann_whitney")
ANOVA = "anova"  # the test of an effect of factors
DIRECTIONS = ("two_sided", "greater", "less")
REWARD = "reward"
BY = " x "  # between the factors of an interaction
EMPTY = (None, "", "null", "~")
Found = TypeVar("Found")


@dataclass(frozen=True)
class DeclaredTest:
    """The primary test of a study file: of two conditions, or of an effect of factors. Empty layouts or agents: all."""

    measure: str
    comparison: tuple[str, ...] = ()  # two conditions; the difference is the first minus the second
    test: str = "welch"
    direction: str = "two_sided"
    alpha: float = 0.05
    layouts: tuple[str, ...] = ()
    agents: tuple[str, ...] = ()
    looks: tuple[int, ...] = ()  # people of both conditions at each interim look and the last; empty: no interim looks
    spending: str = SPENDING[0]
    effect: tuple[str, ...] = ()  # one factor, or several for their interaction; empty: there is a comparison

    @property
    def contrast(self) -> str:
        return BY.join(self.effect) or " - ".join(self.comparison)


@dataclass(frozen=True)
class DeclaredEffect:
    """The smallest effects of interest of a study file. None: not set. Empty layouts: the published one."""

    reward: float | None = None  # points of an episode
    answers: float | None = None  # points of the scale
    layouts: tuple[str, ...] = ()  # where no difference is expected


@dataclass(frozen=True)
class Declaration:
    """What the newest of the analysed versions declares, under which somebody took part. `warning`: not all declare the
    same."""

    primary: DeclaredTest | None = None
    smallest: DeclaredEffect | None = None
    warning: str = ""


def declaration_of(export: Export) -> Declaration:
    """Return what the study files in the export declare. Raises ExportError for a declaration that cannot be read."""
    every = study_files(export)
    files = {number: file for number, file in every.items() if number in export.versions} or every
    if not files:
        return Declaration()
    primary = {number: _read(declared_test, text, path) for number, (text, path) in files.items()}
    smallest = {number: _read(declared_effect, text, path) for number, (text, path) in files.items()}
    found = Declaration(primary[max(primary)], smallest[max(smallest)])
    warnings = [_late(export, primary, "primary test"), _late(export, smallest, "smallest effect")]
    return replace(found, warning=" ".join(filter(None, warnings)))


def _late(export: Export, found: Mapping[int, object], what: str) -> str:
    """Return how many took part under a version that declares something else than the newest one; empty if nobody."""
    newest = found[max(found)]
    played = [number for number in export.versions if number in found] or [max(found)]
    others = [number for number in played if found[number] != newest]
    if not others:
        return ""
    people = f"{sum(export.versions[number] for number in others)} {export.subjects.participants}"
    other = f"another {what}" if any(found[number] for number in others) else f"no {what}"
    names = ", ".join(str(number) for number in others)
    return (
        f"{people} took part under version {names} of the study file, which declares {other}. "
        f"The {what} below was not declared before those data were collected."
    )


def study_files(export: Export) -> dict[int, tuple[Mapping[str, Any], Path]]:
    """Return each version of the study file that the export holds and the report analyses, with its path."""
    plain = re.fullmatch(r"[\w-]+", export.study)  # never outside the folder
    wanted = "*" if export.version is None else export.version
    files = export.folder.glob(f"studies/{export.study}_version-{wanted}.yaml") if plain else ()
    found: dict[int, tuple[Mapping[str, Any], Path]] = {}
    for path in files:
        number = path.stem.rpartition("-")[2]
        try:
            text = yaml.load(path.read_text(encoding="utf-8"), Loader=yaml.BaseLoader)  # noqa: S506 - texts only
        except (OSError, ValueError, yaml.YAMLError, RecursionError):
            continue
        if number.isdecimal() and isinstance(text, dict):
            found[int(number)] = (text, path)
    return found


def _read(reader: Callable[[Mapping[str, Any]], Found | None], study: Mapping[str, Any], path: Path) -> Found | None:
    try:
        return reader(study)
    except ValueError as error:
        raise ExportError(f"{path}: {error}. Export the study again.") from None


def declared_test(study: Mapping[str, Any]) -> DeclaredTest | None:
    """Return the primary test of a study file's texts, none without one. Raises ValueError that names the key."""
    block = _block(study, "primary")
    if block is None:
        return None
    comparison, effect = _compared(block)
    alpha = _number("primary.alpha", block.get("alpha", "0.05"))
    if not alpha < 0.5:
        raise ValueError(f"primary.alpha: {alpha:g} is too large; it must be below 0.5")
    return DeclaredTest(
        str(block.get("measure", REWARD)),
        comparison,
        _one_of(block, "test", (ANOVA,) if effect else TESTS),
        _one_of(block, "direction", DIRECTIONS),
        alpha,
        _names(block, "primary.layouts"),
        _names(block, "primary.agents"),
        _looks(block),
        _one_of(block, "spending", SPENDING),
        effect,
    )


def _compared(block: Mapping[str, Any]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the two conditions or the factors of the effect; the other is empty."""
    comparison, effect = _names(block, "primary.comparison"), _names(block, "primary.effect")
    if effect and comparison:
        raise ValueError("primary: it names both two conditions and an effect")
    if effect and len(set(effect)) < len(effect):
        raise ValueError("primary.effect: a factor occurs twice")
    if not effect and (len(set(comparison)) != 2 or len(comparison) != 2):
        raise ValueError("primary.comparison: it needs two different conditions, such as [tom, none]")
    return comparison, effect


def declared_effect(study: Mapping[str, Any]) -> DeclaredEffect | None:
    """Return the smallest effects of a study file's texts, none without them. Raises ValueError that names the key."""
    block = _block(study, "smallest_effect")
    if block is None:
        return None
    reward, answers = (
        None if block.get(key) in EMPTY else _number(f"smallest_effect.{key}", block[key])
        for key in ("reward", "answers")
    )
    return DeclaredEffect(reward, answers, _names(block, "smallest_effect.layouts"))


def _block(study: Mapping[str, Any], key: str) -> Mapping[str, Any] | None:
    block = study.get(key)
    if isinstance(block, dict):
        return block
    if block in EMPTY:
        return None
    raise ValueError(f"{key}: this is not a block of `key: value` lines")


def _names(block: Mapping[str, Any], place: str) -> tuple[str, ...]:
    value = block.get(place.rpartition(".")[2]) or []
    if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
        raise ValueError(f"{place}: this is not a list of names")
    return tuple(value)


def _looks(block: Mapping[str, Any]) -> tuple[int, ...]:
    looks = _names(block, "primary.looks")
    numbers = tuple(int(look) for look in looks if look.isdecimal())
    if len(numbers) != len(looks) or list(numbers) != sorted(set(numbers)) or (numbers and numbers[0] < 4):
        raise ValueError("primary.looks: these are not growing numbers of people from 4")
    return numbers


def _one_of(block: Mapping[str, Any], key: str, known: tuple[str, ...]) -> str:
    value = block.get(key, known[0])
    if value not in known:
        raise ValueError(f"primary.{key}: {value!r} is not one of {', '.join(known)}")
    return str(value)


def _number(place: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = -1.0
    if not 0 < number < float("inf"):
        raise ValueError(f"{place}: {value!r} is not a number above 0")
    return number
