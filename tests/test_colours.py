"""The colours that carry meaning differ clearly for every viewer: CIEDE2000, colour vision deficiencies (Machado 2009)
and WCAG contrast, all computed by ColorAide."""

import itertools
import re
from pathlib import Path

import pytest
from coloraide import Color

ROOT = Path(__file__).parent.parent
TOKENS = dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", (ROOT / "static/css/tokens.css").read_text("utf-8")))
TILES = ("floor", "floor-alt", "counter", "counter-top", "station", "exit", "steel")


def seen(colour: str, vision: str) -> Color:
    """A colour as a viewer without red, green or blue cones sees it."""
    return Color(colour) if vision == "normal" else Color(colour).filter(vision, method="machado").clip()


def contrast(one: str, other: str) -> float:
    return Color(TOKENS[one]).contrast(TOKENS[other], method="wcag21")


@pytest.mark.parametrize("vision", ["normal", "protan", "deutan", "tritan"])
def test_human_and_ai_differ_clearly_for_every_viewer(vision: str) -> None:
    assert seen(TOKENS["human"], vision).delta_e(seen(TOKENS["partner"], vision), method="2000") >= 20


@pytest.mark.parametrize("tile", TILES)
def test_an_outline_of_every_mark_stands_out_from_every_tile(tile: str) -> None:
    assert max(contrast(outline, tile) for outline in ("outline-light", "outline-dark")) >= 3


def test_the_two_outlines_and_the_two_colours_stand_out_from_each_other() -> None:
    assert contrast("outline-light", "outline-dark") >= 3
    assert contrast("human", "partner") >= 3


@pytest.mark.parametrize(("words", "ground"), list(itertools.product(("ink", "ink-soft", "bad"), ("paper", "card"))))
def test_text_can_be_read(words: str, ground: str) -> None:
    assert contrast(words, ground) >= 4.5
