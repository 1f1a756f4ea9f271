"""Names of a study's arms on researchers' pages."""

import hashlib

from server.study.definition import Study


def arm_names(study: Study, blind: bool) -> dict[str, str]:
    """Return the name of each condition; in blind mode a letter, in an order that reveals nothing."""
    names = [condition.name for condition in study.conditions]
    if not blind:
        return {name: name for name in names}
    order = sorted(names, key=lambda name: _sealed(f"{study.seed}\n{name}"))
    return {name: f"Arm {chr(65 + index)}" for index, name in enumerate(order)}


def _sealed(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
