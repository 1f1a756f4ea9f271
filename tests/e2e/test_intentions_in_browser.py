"""A predicted intention on the board: an icon on the edge of the station, a way over the floor, and words."""

import json
from collections.abc import Iterator
from typing import Any

import pytest
from msgspec import structs
from playwright.sync_api import Browser, Page

from overcooked.layout import load_layout
from server.play import messages
from server.study.locale import locale
from tests.e2e.test_game_browser_marks import CELL, DRAW, Picture
from tests.support.browser.fake_game_server import FakeGameServer, kitchen, tick, welcome
from tests.support.browser.game_page import opened, start
from tests.support.parameters import mostly_slow

pytestmark = [pytest.mark.browser, pytest.mark.timeout(90)]

RING, DIVISION = load_layout("coordination_ring"), load_layout("clear_division")
FILL_RIGHT_POT = (4, 4, 1, 100)
HOLDING = ((3, 3, 0, 0), (1, 1, 2, 1))  # the partner has an onion, in the upper left corner
EAST = ((2, 95), (2, 80), (5, 60))
NOTHING = (8, -1, -1, 95)
MODULES = "const [m, { catalogue }] = await Promise.all(['board/intention', 'browser/texts'].map("
MODULES += "(name) => import(`/static/js/${name}.js`)));"


@pytest.fixture(scope="module")
def server() -> Iterator[FakeGameServer]:
    running = FakeGameServer()
    yield running
    running.close()


@pytest.fixture(scope="module")
def blank(blank: Page) -> Page:
    """With the game's style sheet, which has the colours."""
    blank.add_style_tag(url="/static/css/tokens.css")
    return blank


def drawn(page: Page, intention: Any, players: Any = HOLDING, **more: Any) -> Picture:
    """The board of the coordination ring with this intention, 64 pixels a cell."""
    state = kitchen(t=1, players=players, pots=((3, 0, 3, 12), (4, 1, 1, -1)))
    frames = [structs.replace(tick(state), intention=intention)]
    told = welcome(grid=tuple(RING.grid), state=state, **more)
    sent = [json.loads(messages.encode(told)), [json.loads(messages.encode(one)) for one in frames], 150, True, ""]
    return Picture(page.evaluate(DRAW, sent))


def green(picture: Picture, x: float, y: float, side: float) -> int:
    """How many pixels of the partner's green a square around a place in cells has."""
    box = [round(value * CELL) for value in (x - side / 2, y - side / 2, x + side / 2, y + side / 2)]
    data = picture.image.crop(box).tobytes()  # type: ignore[arg-type]
    return sum(pixel == (95, 211, 141) for pixel in zip(*[iter(data)] * 3, strict=True))


def test_the_icon_lies_on_the_edge_of_the_station_and_hides_nothing_in_it(blank: Page) -> None:
    without, shown = drawn(blank, NOTHING), drawn(blank, FILL_RIGHT_POT)
    assert green(without, 4.1, 1.8, 0.5) == 0
    assert green(shown, 4.1, 1.8, 0.5) > 20
    for place in ((4.5, 1.35), (4.8, 1.24)):  # what is in the pot, and its lamp
        assert shown.at(*place) == without.at(*place)


def test_the_path_is_dotted_over_floor_cells_from_the_chef_to_the_station(blank: Page) -> None:
    shown = drawn(blank, FILL_RIGHT_POT)
    assert [green(shown, x, 1.5, 0.6) > 0 for x in (2.5, 3.5)] == [True, True]
    assert [green(shown, x, 2.5, 0.6) for x in (2.5, 3.5)] == [0, 0]


def test_an_intention_without_a_station_draws_nothing(blank: Page) -> None:
    assert drawn(blank, (0, -1, -1, 95)).image.tobytes() == drawn(blank, NOTHING).image.tobytes()


def test_of_a_station_out_of_view_no_icon_is_drawn(blank: Page) -> None:
    shown = drawn(blank, FILL_RIGHT_POT, players=((1, 2, 0, 0), (1, 1, 2, 1)), view_radius=1)
    assert green(shown, 4.1, 1.8, 0.5) == 0
    assert green(shown, 2.5, 1.5, 0.6) > 0, "the way up to the edge of the view"


@pytest.mark.parametrize(
    ("language", "intention", "words"),
    [
        ("en", (4, 6, 3), "onion to the right pot"),
        ("en", (1, 3, 0), "onion from the left crate"),
        ("en", (2, 3, 6), "dish from the rack"),
        ("en", (7, 2, 3), "onion onto a counter"),
        ("zh", (4, 4, 3), "把洋葱放进左边的锅"),
        ("zh", (6, 7, 6), "把汤送到出餐口"),
    ],
)
def test_words_name_what_is_done_and_where(
    blank: Page, language: str, intention: tuple[int, int, int], words: str
) -> None:
    script = f"""async ([grid, intention, texts]) => {{ {MODULES}
      const found = m.intentionOf([...intention, 95], [2, 4, 0, 1], undefined, grid);
      return m.intentionWords(found, grid, catalogue(texts)); }}"""
    texts = locale(language).section("game")
    assert blank.evaluate(script, [list(DIVISION.grid), list(intention), texts]) == words


def test_stations_that_words_name_by_a_number_bear_it_where_intentions_are_shown(blank: Page) -> None:
    grid = ["XPXPXPX", "O  1 2D", "XXXXSXX"]
    script = (
        f"async (grid) => {{ {MODULES} return m.numberedStations(grid).map(({{x, y, number}}) => [x, y, number]); }}"
    )
    assert blank.evaluate(script, grid) == [[1, 0, 1], [3, 0, 2], [5, 0, 3]]
    assert blank.evaluate(script, list(DIVISION.grid)) == [], "left and right tell two of a kind apart"
    seen: list[Any] = []
    for intention in (NOTHING, (0, -1, -1, 95)):
        state = kitchen(t=1, players=((3, 1, 0, 0), (5, 1, 0, 0)), pots=())
        told = welcome(grid=tuple(row.replace("1", " ").replace("2", " ") for row in grid), state=state)
        frame = structs.replace(tick(state), intention=intention)
        sent = [json.loads(messages.encode(told)), [json.loads(messages.encode(frame))], 150, True, ""]
        seen.append(Picture(blank.evaluate(DRAW, sent)))
    at = round(12 / 64 * CELL)
    discs = [[sum(picture.image.getpixel((round(x * CELL) + at - 6, at))) for x in (1, 3, 5)] for picture in seen]
    assert all(with_number > without + 60 for without, with_number in zip(*discs, strict=True)), discs


def test_the_path_follows_the_drawn_steps_if_they_lead_to_the_station(blank: Page) -> None:
    grid = ["XXXXX", "X   P", "X   X", "XXXXX"]
    script = f"""async ([grid, ahead]) => {{ {MODULES}
      return m.intentionOf([4, 4, 1, 95], [1, 2, 0, 1], undefined, grid, ahead).way; }}"""
    assert blank.evaluate(script, [grid, [[2, 2], [3, 2]]]) == [[1, 2], [2, 2], [3, 2], [3, 1]]
    assert blank.evaluate(script, [grid, [[1, 1]]]) == [[1, 2], [1, 1], [2, 1], [3, 1]]
    away = blank.evaluate(script, [["XXXXX", "X   P", "X   X", "X   X", "XXXXX"], [[1, 3]]])
    assert [1, 3] not in away
    assert len(away) == 4


@pytest.mark.parametrize(("steps", "words"), [(1, []), (2, ["First", "Second"]), (3, ["First", "Second", "Third"])])
def test_the_legend_names_as_many_steps_as_are_drawn(
    chromium: Browser, server: FakeGameServer, steps: int, words: list[str]
) -> None:
    server.reset()
    server.welcome = welcome(grid=tuple(RING.grid), steps=steps)
    with opened(chromium, server) as page:
        start(page, server, kitchen(t=1))
        assert [one.inner_text().strip() for one in page.locator("#legend-order span:visible").all()] == words
        assert page.is_visible("#legend-order") == (steps > 1)


@pytest.mark.parametrize(
    ("tick_ms", "words"), mostly_slow([(125, "2.5 seconds"), (200, "4 seconds"), (50, "1 second")])
)
def test_the_legend_tells_how_long_a_soup_cooks_at_the_studys_speed(
    chromium: Browser, server: FakeGameServer, tick_ms: int, words: str
) -> None:
    server.reset()
    server.welcome = welcome(grid=tuple(RING.grid), shows_predictions=False, display="none", tick_ms=tick_ms)
    with opened(chromium, server) as page:
        start(page, server, kitchen(t=1))
        assert page.locator("#legend-cooking").text_content() == f": {words}"


@pytest.mark.parametrize(("display", "entries"), mostly_slow([("both", 7), ("actions", 4), ("intention", 3)]))
def test_the_legend_explains_what_is_shown_and_screen_readers_hear_the_intention(
    chromium: Browser, server: FakeGameServer, display: str, entries: int
) -> None:
    server.reset()
    server.welcome = welcome(grid=tuple(RING.grid), display=display, state=kitchen(players=HOLDING), tick_ms=5000)
    with opened(chromium, server) as page:
        start(page, server, kitchen(t=1, players=HOLDING))
        assert page.locator("#legend-predictions li:visible").count() == entries
        shown = NOTHING if display == "actions" else FILL_RIGHT_POT
        server.send(structs.replace(tick(kitchen(t=2, players=HOLDING), EAST), intention=shown))
        page.wait_for_selector("[data-timestep='2']")
        said = "" if display == "actions" else "AI chef: onion to the right pot."
        assert page.locator("#polite").text_content() == said
