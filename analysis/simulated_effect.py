"""The difference that predictions made for simulated participants: a source of effects for a power analysis.

`benchmarks/foresight.py --write` writes the figures. They are not evidence about people.
"""

import json
from pathlib import Path
from typing import Any

VARIANCES = (
    "The standard deviations come from simulated participants: no evidence about people. Before you decide on a number "
    "of participants, use a pilot with people, or try larger values."
)
FIGURES = Path(__file__).with_suffix(".json")


def points() -> float:
    """Return the mean difference in points, to one decimal."""
    return round(float(_figures()["mean"]), 1)


def source() -> str:
    """Return a sentence that says where the difference comes from."""
    found = _figures()
    return (
        f"The effect of {points():g} points comes from simulated participants (ToM against none, "
        f"95 % interval {found['low']:.1f} to {found['high']:.1f}; {found['games']} pairs of episodes in "
        f"{len(found['layouts'])} kitchens with {len(found['agents'])} agents). They are built so that foresight can "
        "help. It is not evidence about people: use it with other effects, not alone."
    )


def _figures() -> dict[str, Any]:
    figures: dict[str, Any] = json.loads(FIGURES.read_text(encoding="utf-8"))
    return figures
