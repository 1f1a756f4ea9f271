"""The questions of published scales that a study uses by name, from `scales/`; `analysis.scales` has the scoring."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any, Literal, get_args

import yaml

SCALES = Path(__file__).parent / "scales"
ScaleName = Literal["nasa_tlx_raw", "trust_in_automation"]
SCALE_NAMES: tuple[ScaleName, ...] = get_args(ScaleName)


@cache
def published_scale(name: str) -> dict[str, Any]:
    """Return the content of a scale's file. Raises FileNotFoundError for an unknown name."""
    scale = yaml.safe_load((SCALES / f"{name}.yaml").read_text(encoding="utf-8"))
    assert isinstance(scale, dict)  # noqa: S101 our own file
    return scale


def scale_languages(name: str) -> tuple[str, ...]:
    """Return the languages that a scale has words in."""
    return tuple(published_scale(name)["low"])


def scale_questions(name: str, subscales: Sequence[str]) -> list[dict[str, Any]]:
    """Return the items as scale questions of a study file, in the original order. No subscales: all of them."""
    scale = published_scale(name)
    shared = _only(scale, "points", "first", "step", "low", "high", "labels")
    return [
        {"type": "scale"} | shared | _only(item, "key", "text", "low", "high")
        for item in scale["items"]
        if not subscales or item["subscale"] in subscales
    ]


def _only(block: dict[str, Any], *keys: str) -> dict[str, Any]:
    return {key: block[key] for key in keys if key in block}
