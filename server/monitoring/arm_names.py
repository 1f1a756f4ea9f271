"""Names of a study's arms on researchers' pages."""

import hashlib
from collections.abc import Iterable, Sequence

from server.study.definition import Study


def arm_names(study: Study, blind: bool, of_all_versions: Iterable[str] = ()) -> dict[str, str]:
    """Return the name of each condition; in blind mode a letter, in an order that reveals nothing. `of_all_versions`:
    also conditions that only earlier versions had, in which people may be."""
    now = [condition.name for condition in study.conditions]
    former = sorted(set(of_all_versions) - set(now))
    if not blind:
        return {name: name for name in (*now, *former)}
    return _lettered(study, now, "Arm") | _lettered(study, former, "Earlier arm")


def _lettered(study: Study, names: Sequence[str], word: str) -> dict[str, str]:
    order = sorted(names, key=lambda name: _sealed(f"{study.seed}\n{name}"))
    return {name: f"{word} {chr(65 + index)}" for index, name in enumerate(order)}


def _sealed(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
