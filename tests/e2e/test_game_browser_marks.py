"""How marks are drawn: on the floor and next to the chef, as one path, and never over what a station shows."""

import base64
import json
from io import BytesIO
from typing import Any

import pytest
from PIL import Image
from playwright.sync_api import Page

from server.play import messages
from tests.support.browser.fake_game_server import NONE, RINGS, kitchen, tick, welcome

pytestmark = [pytest.mark.browser, pytest.mark.timeout(90)]

CELL = 64
NORTH, SOUTH, EAST, WEST, STAY, INTERACT = range(6)
# Draws states after one another on a board of 64 pixels a cell, each 2 s after the one before; the last one `age` ms
# after it arrived. Returns the functions that the tests look with.
DRAW = """async ([welcome, ticks, age, reduced, tag]) => {
  const [{ Renderer }, { Sprites }, { apply, defaults }] = await Promise.all(
    ['renderer', 'sprites', 'state'].map((name) => import(`/static/js/board/${name}.js`)));
  const canvas = document.createElement('canvas');
  document.body.replaceChildren(canvas);
  window.sprites ??= await new Sprites('/static/sprites/').load();
  const renderer = new Renderer(canvas, window.sprites, tag);
  renderer.fit(welcome.grid, 64 * welcome.grid[0].length / devicePixelRatio, 1e4);
  let state = apply(defaults(), welcome, 0), now = 0;
  for (const tick of ticks) { now += 2000; state = apply(state, tick, now); }
  renderer.draw(state, now + age, reduced);
  return canvas.toDataURL().split(',')[1];
}"""


@pytest.fixture(scope="module")
def blank(blank: Page) -> Page:
    """With the game's style sheet, which has the colours."""
    blank.add_style_tag(url="/static/css/tokens.css")
    return blank


class Picture:
    """One drawn board, at 64 pixels a cell."""

    def __init__(self, png: str) -> None:
        self.image = Image.open(BytesIO(base64.b64decode(png))).convert("RGB")

    def at(self, x: float, y: float) -> tuple[int, int, int]:
        """The colour at a place counted in cells."""
        red, green, blue = self.image.getpixel((round(x * CELL), round(y * CELL)))  # type: ignore[misc]
        return red, green, blue

    def inner(self, x: int, y: int) -> bytes:
        """The pixels of a cell without a margin of 12 on each side."""
        left, top = x * CELL, y * CELL
        return self.image.crop((left + 12, top + 12, left + CELL - 12, top + CELL - 12)).tobytes()


def draw(page: Page, moment: Any, prediction: Any, age: float = 500, reduced: bool = True, **more: Any) -> Picture:
    """The board after the ticks `before` (no marks) and one with `prediction`."""
    before = more.pop("before", [])
    tag = more.pop("tag", "")
    wire = [json.loads(messages.encode(each)) for each in [*before, tick(moment, prediction)]]
    first = json.loads(messages.encode(welcome(grid=RINGS, tick_ms=5000, **more)))
    return Picture(page.evaluate(DRAW, [first, wire, age, reduced, tag]))


def is_green(colour: tuple[int, int, int]) -> bool:
    """The partner's green, paler or not."""
    red, green, blue = colour
    return green > 190 and green - red > 40 and green - blue > 25


def steps(*actions: int) -> list[tuple[int, int]]:
    return list(zip(actions, (95, 80, 60), strict=True))


@pytest.mark.parametrize(
    ("chef", "prediction", "station"),
    [
        ((6, 1, NORTH, 1), steps(INTERACT, INTERACT, INTERACT), (6, 0)),
        ((7, 2, EAST, 3), steps(INTERACT, STAY, INTERACT), (8, 2)),
        ((1, 2, WEST, 0), steps(WEST, INTERACT, INTERACT), (0, 2)),
        ((6, 3, SOUTH, 0), steps(INTERACT, SOUTH, STAY), (6, 4)),
        ((7, 3, NORTH, 3), steps(NORTH, EAST, INTERACT), (8, 2)),
        ((3, 1, EAST, 1), steps(EAST, NORTH, INTERACT), (4, 0)),
    ],
    ids=["pot", "hatch", "rack on the left", "rack below", "walk, turn, use", "cooking pot"],
)
def test_no_mark_hides_what_a_station_shows(blank: Page, chef: Any, prediction: Any, station: tuple[int, int]) -> None:
    moment = kitchen(t=9, players=((2, 3, 0, 0), chef), pots=((4, 0, 3, 12), (6, 0, 2, -1)))
    marked, bare = draw(blank, moment, prediction), draw(blank, moment, NONE)
    assert marked.image != bare.image
    assert marked.inner(*station) == bare.inner(*station)


def test_repeated_uses_are_drawn_as_one_hand_with_a_number(blank: Page) -> None:
    script = "async (a) => (await import('/static/js/board/marks.js')).marks(...a)"
    found = blank.evaluate(script, [steps(INTERACT, INTERACT, INTERACT), [6, 1, NORTH, 1], [2, 3, 0, 0], list(RINGS)])
    assert [(mark["kind"], mark["count"]) for mark in found] == [("hand", 3), ("none", 1), ("none", 1)]
    waits = blank.evaluate(script, [steps(STAY, INTERACT, STAY), [6, 1, NORTH, 1], [2, 3, 0, 0], list(RINGS)])
    assert [(mark["kind"], mark["count"]) for mark in waits] == [("ring", 2), ("hand", 1), ("none", 1)]
    moment = kitchen(t=9, players=((2, 3, 0, 0), (6, 1, NORTH, 1)))
    once, thrice = (draw(blank, moment, steps(INTERACT, *more)) for more in ((6, 6), (INTERACT, INTERACT)))
    assert once.image != thrice.image, "the number is drawn"


def test_the_first_arrow_starts_at_the_chef_while_it_still_walks(blank: Page) -> None:
    # The partner goes from (5, 3) to (4, 3) and is predicted to walk on to the left.
    still, gone = (((2, 1, 0, 0), (x, 3, WEST, 0)) for x in (5, 4))
    before = [tick(kitchen(t=8, players=still))]
    half = draw(blank, kitchen(t=9, players=gone), steps(WEST, 6, 6), age=95, reduced=False, before=before)
    assert is_green(half.at(4.4, 3.56)), "at the chef, who is not yet in (4, 3)"
    there = draw(blank, kitchen(t=9, players=gone), steps(WEST, 6, 6), age=500, reduced=False, before=before)
    assert is_green(there.at(3.9, 3.5)), "without a gap to the chef"


def test_an_arrow_starts_where_the_one_before_ends(blank: Page) -> None:
    moment = kitchen(t=9, players=((2, 1, 0, 0), (5, 3, WEST, 0)))
    found = draw(blank, moment, steps(WEST, WEST, WEST))
    shaft = [found.at(x / 16, 3.5) for x in range(38, 76)]
    gaps = [colour for colour in shaft if min(colour) > 200 and not is_green(colour)]
    assert sum(map(is_green, shaft)) > 20
    assert len(gaps) <= 6, "only the white outlines of two tips interrupt it"


def test_back_and_forth_lie_next_to_each_other(blank: Page) -> None:
    moment = kitchen(t=9, players=((2, 1, 0, 0), (5, 3, EAST, 0)))
    found = draw(blank, moment, steps(EAST, WEST, EAST))
    lanes = [found.at(5.9, 3.5 + shift / 64) for shift in (17, 0, -17)]
    assert all(map(is_green, lanes)), lanes
    between = [found.at(5.95, 3.5 + shift / 64) for shift in (-8, 8)]
    assert not any(map(is_green, between)), between


def test_the_tag_of_the_own_chef_leaves_the_pot_in_sight(blank: Page) -> None:
    moment = kitchen(t=9, players=((4, 1, NORTH, 1), (2, 3, 0, 0)), pots=((4, 0, 3, 12),))
    tagged, bare = draw(blank, moment, NONE, tag="YOU"), draw(blank, moment, NONE)
    assert tagged.image != bare.image
    assert tagged.inner(4, 0) == bare.inner(4, 0)
    near = kitchen(t=9, players=((3, 1, NORTH, 1), (2, 3, 0, 0)), counters=((3, 2, 1),))
    tagged, bare = draw(blank, near, NONE, tag="YOU"), draw(blank, near, NONE)
    assert tagged.inner(3, 2) == bare.inner(3, 2), "nor does it lie on a thing on the counter below"
