"""The key and the button that ask for the marks, in a real browser with a server that records the messages."""

from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.e2e.test_game_browser_sizes import CLIPPED
from tests.support.browser.fake_game_server import NONE, FakeGameServer, kitchen, tick, welcome
from tests.support.browser.game_page import DESKTOP, PHONE, opened, screenshot, settled, start

pytestmark = [pytest.mark.browser, pytest.mark.timeout(90)]
LANDSCAPE = {"width": 844, "height": 390}
MARKS = ((1, 95), (5, 80), (5, 60))
TOUCH: dict[str, Any] = {"has_touch": True, "is_mobile": True}


def asked(server: FakeGameServer) -> list[bool | None]:
    return [each.marks for each in server.inputs()]


def test_the_marks_key_is_sent_while_held_and_walking_continues(chromium: Browser, server: FakeGameServer) -> None:
    server.welcome = welcome(show="on_key")
    with opened(chromium, server) as page:
        start(page, server)
        expect(page.locator("#legend-ask")).to_have_text("Hold Q to see them.")
        page.keyboard.down("KeyQ")
        page.keyboard.down("KeyQ")  # repeated by the keyboard
        page.keyboard.down("ArrowRight")
        page.keyboard.up("ArrowRight")
        page.keyboard.up("KeyQ")
        server.wait_for(lambda server: len(server.inputs()) == 4)
        found = [(each.held, each.tap, each.marks) for each in server.inputs()]
        assert found == [(None, None, True), (2, 2, None), (None, None, None), (None, None, False)]


@pytest.mark.slow
def test_another_key_can_be_chosen_and_the_legend_names_it(chromium: Browser, server: FakeGameServer) -> None:
    server.welcome = welcome(show="toggle")
    with opened(chromium, server, viewport=DESKTOP) as page:
        start(page, server)
        page.click("#change-keys")
        page.click("[data-rebind='6']")
        page.keyboard.press("KeyF")
        page.click("#keys-dialog .btn >> nth=0")
        expect(page.locator("#legend-ask")).to_have_text("Press F to show or hide them.")
        page.keyboard.press("KeyQ")
        page.keyboard.press("KeyF")
        server.wait_for(lambda server: len(server.inputs()) == 2)
        assert asked(server) == [True, False]


def test_where_marks_are_always_drawn_there_is_neither_key_nor_button(
    chromium: Browser, server: FakeGameServer
) -> None:
    with opened(chromium, server, viewport=PHONE, **TOUCH) as page:
        start(page, server)
        page.keyboard.press("KeyQ")
        settled(page, server)
        assert server.inputs() == []
        for part in ("#legend-ask", ".touch .ask", "#keys-dialog [data-on-demand]"):
            expect(page.locator(part)).to_be_hidden()


@pytest.mark.parametrize("show", ["on_key", "toggle"])
@pytest.mark.parametrize(
    "size",
    [PHONE, *(pytest.param(size, marks=pytest.mark.slow) for size in (LANDSCAPE, {"width": 360, "height": 640}))],
    ids=str,
)
def test_on_a_touch_screen_a_button_asks_for_the_marks(
    chromium: Browser, server: FakeGameServer, size: dict[str, Any], show: str
) -> None:
    server.welcome = welcome(show=show)
    with opened(chromium, server, viewport=size, **TOUCH) as page:
        start(page, server)
        press_and_release(page)
        server.wait_for(lambda server: len(server.inputs()) == 2)
        assert asked(server) == [True, False]
        server.send(tick(kitchen(t=2), MARKS))
        page.wait_for_selector("[data-timestep='2']")
        if show == "toggle":
            expect(page.locator(".touch .ask")).to_have_attribute("aria-pressed", "true")
            server.send(tick(kitchen(t=3), NONE))  # still on: the partner has left the view
            page.wait_for_selector("[data-timestep='3']")
            expect(page.locator(".touch .ask")).to_have_attribute("aria-pressed", "true")
        assert overlapping(page) == []
        screenshot(page, f"marks-{show}-{size['width']}x{size['height']}")


@pytest.mark.parametrize("language", ["en", "zh"])
@pytest.mark.slow
def test_on_a_desktop_no_line_of_the_legend_is_cut_off(
    chromium: Browser, server: FakeGameServer, language: str
) -> None:
    server.page["language"] = language
    server.welcome = welcome(show="toggle")
    with opened(chromium, server, viewport=DESKTOP) as page:
        start(page, server)
        server.send(tick(kitchen(t=2), MARKS))
        page.wait_for_selector("[data-timestep='2']")
        screenshot(page, f"marks-toggle-desktop-{language}")
        for height in (640, 700, 721, 768, 821, 1080):
            page.set_viewport_size({"width": 1366, "height": height})
            assert page.evaluate(CLIPPED) == 0, height


def press_and_release(page: Page) -> None:
    box = page.locator(".touch .ask").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.up()


def overlapping(page: Page) -> list[str]:
    """Which buttons lie over the kitchen, over each other or out of sight."""
    found: list[str] = page.evaluate(
        """() => {
      const parts = ['.touch .ask', '.touch .use', '.pad', 'canvas.board', '#legend'];
      const boxes = parts.map((part) => [part, document.querySelector(part).getBoundingClientRect()]);
      const meet = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1
        && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1;
      const isOut = (box) => box.right > innerWidth + 1 || box.bottom > innerHeight + 1 || box.left < -1;
      const out = boxes.filter(([, box]) => isOut(box));
      const pairs = boxes.flatMap(([a, one], k) =>
        boxes.slice(k + 1).filter(([, other]) => meet(one, other)).map(([b]) => `${a} and ${b}`));
      return [...out.map(([part]) => `${part} out of sight`), ...pairs];
    }"""
    )
    return found


def test_a_screen_reader_s_press_stays_down_until_the_next_one(chromium: Browser, server: FakeGameServer) -> None:
    server.welcome = welcome(show="on_key")
    with opened(chromium, server, viewport=PHONE, **TOUCH) as page:
        start(page, server)
        for count in (1, 2):
            page.evaluate("document.querySelector('.touch .ask').click()")
            server.wait_for(lambda server, count=count: len(server.inputs()) == count)  # type: ignore[misc]
        assert asked(server) == [True, False]
