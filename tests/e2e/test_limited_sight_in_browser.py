"""Limited sight on the board: cells out of view are dark and show no chef, and marks end where they leave the view."""

from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.support.browser.fake_game_server import RINGS, FakeGameServer, kitchen, tick, welcome
from tests.support.browser.game_page import DESKTOP, PHONE, at_rest, drawn, opened, pixel, screenshot, start

pytestmark = [pytest.mark.browser, pytest.mark.timeout(90)]
LANDSCAPE = {"width": 844, "height": 390}
OWN = (2, 1, 2, 0)
UNKNOWN = ((7, 0), (8, 2), (7, 4))
POTS = ((4, 0, 2, -1), (6, 0, 1, -1))
COUNTERS = ((3, 4, 2),)
PATH = ((2, 95), (2, 80), (6, 60))  # the server leaves out what is beyond the edge


def limited(**more: Any) -> Any:
    return welcome(grid=RINGS, state=kitchen(players=(OWN, (3, 1, 2, 1))), view_radius=2, **more)


def shown(page: Page, server: FakeGameServer, timestep: int, partner: Any, marks: Any, seen: bool) -> None:
    state = kitchen(t=timestep, players=(OWN, partner), pots=POTS, counters=COUNTERS)
    frame = tick(state, marks)
    server.send(type(frame)(state, marks, (4, 4), -1, False, seen, UNKNOWN))
    page.wait_for_selector(f"[data-timestep='{timestep}']")
    at_rest(page)
    drawn(page, 300)  # a chef glides for a timestep


def brightness(page: Page, column: float, row: float) -> int:
    return sum(pixel(page, column, row))


@pytest.mark.parametrize("size", [DESKTOP, PHONE, LANDSCAPE], ids=str)
@pytest.mark.slow
def test_the_view_is_bright_and_the_rest_is_dark(
    chromium: Browser, server: FakeGameServer, size: dict[str, int]
) -> None:
    touch: dict[str, Any] = {} if size == DESKTOP else {"has_touch": True, "is_mobile": True}
    server.welcome = limited()
    with opened(chromium, server, viewport=size, **touch) as page:
        start(page, server, kitchen(t=1, players=(OWN, (3, 1, 2, 1))))
        shown(page, server, 2, (3, 1, 2, 1), PATH, True)
        screenshot(page, f"sight-{size['width']}x{size['height']}")
        assert brightness(page, 1.5, 3.5) > brightness(page, 5.5, 3.5) + 100, "floor in view and out of view"
        assert brightness(page, 5.5, 4.5) > brightness(page, 7.5, 4.5) + 60, "remembered and never seen"


@pytest.mark.parametrize(("radius", "note"), [(1, "view: 1 cell each way"), (2, "view: 2 cells each way")])
@pytest.mark.slow
def test_the_note_on_the_view_counts_its_cells(
    chromium: Browser, server: FakeGameServer, radius: int, note: str
) -> None:
    server.welcome = welcome(grid=RINGS, state=kitchen(players=(OWN, (3, 1, 2, 1))), view_radius=radius)
    with opened(chromium, server, viewport=DESKTOP) as page:
        start(page, server, kitchen(t=1, players=(OWN, (3, 1, 2, 1))))
        expect(page.locator("#round")).to_contain_text(note)


def test_a_partner_out_of_view_is_not_drawn_and_has_no_marks(chromium: Browser, server: FakeGameServer) -> None:
    server.welcome = limited()
    with opened(chromium, server, viewport=DESKTOP) as page:
        start(page, server, kitchen(t=1, players=(OWN, (3, 1, 2, 1))))
        expect(page.locator("#round")).to_contain_text("view: 2 cells each way")
        shown(page, server, 2, (3, 1, 2, 1), PATH, True)
        near = brightness(page, 3.5, 1.5)
        shown(page, server, 3, (2, 1, 0, 0), ((6, 95), (6, 80), (6, 60)), False)
        screenshot(page, "sight-alone")
        assert brightness(page, 3.5, 1.5) != near
        assert brightness(page, 3.5, 1.5) == brightness(page, 1.5, 1.5)
