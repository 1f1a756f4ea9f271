"""The levels of a study's factors, as columns of the tables of participants and episodes."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from server.export.codebook import BLOCK, FACTOR
from server.export.codebook_columns import Column
from server.store.studies import StudyVersion
from server.study.factors import arms, levels_of
from server.study.loader import StudyError, values_of

Levels = dict[str, "VersionLevels"]  # by version of a study, as "key 1"


@dataclass(frozen=True)
class VersionLevels:
    """The levels of one version of a study, by condition and block of rounds."""

    arms: Mapping[str, tuple[dict[str, str], ...]]
    episodes_of_a_block: int

    @property
    def has_blocks(self) -> bool:
        return any(len(blocks) > 1 for blocks in self.arms.values())

    def of_participant(self, condition: str) -> dict[str, str]:
        """Return the levels that a participant has in all blocks."""
        blocks = self.arms.get(condition, ())
        return {name: level for name, level in (blocks[0] if blocks else {}).items()
                if all(block[name] == level for block in blocks)}  # fmt: skip

    def of_episode(self, condition: str, number: int) -> dict[str, Any]:
        """Return the levels of an episode, and its block if there are several; none of the practice (number 0)."""
        blocks = self.arms.get(condition, ())
        place = (number - 1) // self.episodes_of_a_block if len(blocks) > 1 else 0
        if number < 1 or place >= len(blocks):
            return {}
        return {**blocks[place], **({BLOCK.name: place + 1} if self.has_blocks else {})}


def factor_levels(versions: list[StudyVersion]) -> Levels:
    """Return the levels of the versions that have factors."""
    found: Levels = {}
    for version in versions:
        try:
            values = values_of(version.source)
        except StudyError:  # a study file of another software version
            continue
        if factors := levels_of(values.get("factors")):
            found[version_key(version.key, version.version)] = _of_version(values, factors)
    return found


def _of_version(values: Mapping[str, Any], factors: Mapping[str, tuple[str, ...]]) -> VersionLevels:
    within = (values.get("cells") or {}).get("within") or ()
    rounds = int((values.get("order") or {}).get("repeat") or 1)
    rounds *= len(values.get("layouts") or ()) * len(values.get("agents") or ())
    named = {condition: tuple(map(_named, blocks)) for condition, blocks in arms(factors, within)}
    return VersionLevels(named, rounds)


def _named(block: Mapping[str, str]) -> dict[str, str]:
    return {FACTOR.name.format(factor=factor): level for factor, level in block.items()}


def version_key(key: str, version: int) -> str:
    return f"{key} {version}"


def participant_columns(levels: Levels) -> tuple[Column, ...]:
    """Return a column for each factor that does not vary within people, in the order of the study files."""
    rows = (version.of_participant(arm) for version in levels.values() for arm in version.arms)
    return _columns(name for row in rows for name in row)


def episode_columns(levels: Levels) -> tuple[Column, ...]:
    """Return a column for each factor, and the block of rounds where a version has blocks."""
    rows = (block for version in levels.values() for blocks in version.arms.values() for block in blocks)
    found = _columns(name for row in rows for name in row)
    return (BLOCK, *found) if any(version.has_blocks for version in levels.values()) else found


def _columns(names: Iterator[str]) -> tuple[Column, ...]:
    return tuple(Column(name, FACTOR.type, FACTOR.meaning) for name in dict.fromkeys(names))
