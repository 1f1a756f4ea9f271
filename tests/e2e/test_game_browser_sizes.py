"""The game's page on large and small screens: nothing scrolls, jumps, overlaps or is cut off."""

from typing import Any

import pytest
from playwright.sync_api import Browser, Page

from server.play.messages import Countdown, Notice, Paused, Ready
from tests.support.browser.double_rings import MOMENT, WALK_TURN_SERVE, rings
from tests.support.browser.double_rings import server as server
from tests.support.browser.fake_game_server import FakeGameServer, kitchen, tick
from tests.support.browser.game_page import (
    DESKTOP,
    at_rest,
    drawn,
    is_blue,
    opened,
    pixel,
    screenshot,
    start,
)
from tests.support.parameters import mostly_slow

pytestmark = [pytest.mark.browser, pytest.mark.timeout(90)]


@pytest.mark.parametrize("shows", mostly_slow([True, False]))
def test_stage_and_cards_have_one_size_in_all_conditions(
    chromium: Browser, server: FakeGameServer, shows: bool
) -> None:
    server.welcome = rings(shows_predictions=shows)
    with opened(chromium, server) as page:
        start(page, server, kitchen(t=195, **MOMENT))
        assert page.is_visible("#legend-predictions") == shows
        assert page.is_visible("#legend-pots") != shows
        boxes = [
            page.locator(part).bounding_box() for part in (".stage", "canvas.board", "#legend", ".panel.ids", ".kb")
        ]
        sizes = [(round(box["x"]), round(box["y"]), round(box["width"]), round(box["height"])) for box in boxes if box]
        assert sizes == SIZES.setdefault("desktop", sizes)


SIZES: dict[str, Any] = {}


CLIPPED = "[...document.querySelectorAll('.side .panel')].filter(one => one.scrollHeight > one.clientHeight).length"


@pytest.mark.parametrize("display", mostly_slow(["both", "actions", "none"]))
def test_no_panel_next_to_the_kitchen_cuts_off_its_last_line(
    chromium: Browser, server: FakeGameServer, display: str
) -> None:
    server.welcome = rings(shows_predictions=display != "none", display=display)
    with opened(chromium, server) as page:
        page.wait_for_selector("[data-phase=ready]")
        for height in (640, 700, 721, 768, 800, 821, 900, 1080):
            page.set_viewport_size({"width": 1366, "height": height})
            assert page.evaluate(CLIPPED) == 0, height
        page.set_viewport_size(DESKTOP)


@pytest.mark.parametrize(
    "size",
    [
        *((1366, 768), (390, 844), (844, 390)),
        *(pytest.param(size, marks=pytest.mark.slow) for size in ((1024, 600), (1920, 1080), (683, 384), (360, 640))),
    ],
    ids=lambda size: f"{size[0]}x{size[1]}",
)
def test_everything_that_matters_is_in_sight_without_scrolling(
    chromium: Browser, server: FakeGameServer, size: tuple[int, int]
) -> None:
    width, height = size
    touch = size in ((390, 844), (360, 640), (844, 390))
    server.welcome = rings(display="both", show="on_key")  # with the longest legend and one more button
    with opened(
        chromium, server, viewport={"width": width, "height": height}, has_touch=touch, is_mobile=touch
    ) as page:
        start(page, server, kitchen(t=195, **MOMENT))
        server.send(tick(kitchen(t=196, **MOMENT), WALK_TURN_SERVE))
        drawn(page, 250)
        parts = ["#time", "#score", "#soups", "canvas.board"] + (
            [".touch .ask", ".touch .use", ".pad [data-action='1']"] if touch else []
        )
        for part in parts:
            box = page.locator(part).bounding_box()
            assert box is not None, part
            assert box["x"] >= 0, part
            assert box["y"] >= 0, part
            assert box["x"] + box["width"] <= width + 1, part
            assert box["y"] + box["height"] <= height + 1, part
        board = page.locator("canvas.board").bounding_box()
        assert board is not None
        assert board["width"] >= 0.4 * width, "the kitchen is what one looks at"
        screenshot(page, f"game-{width}x{height}")


def test_a_resized_window_fits_the_kitchen_again(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        start(page, server, kitchen(t=195, **MOMENT))
        wide = page.evaluate("document.querySelector('canvas.board').width")
        page.set_viewport_size({"width": 1024, "height": 600})
        page.wait_for_function("(wide) => document.querySelector('canvas.board').width < wide", arg=wide)
        assert is_blue(pixel(page, 3.5, 3.75)), "and draws it again"


@pytest.mark.parametrize(
    "size",
    [
        *((1366, 768), (320, 540), (540, 320)),
        *(
            pytest.param(size, marks=pytest.mark.slow)
            for size in ((1024, 600), (390, 844), (360, 640), (844, 390), (667, 375))
        ),
    ],
    ids=lambda size: f"{size[0]}x{size[1]}",
)
def test_no_dialog_hides_its_button_or_the_kitchen_that_one_studies(
    chromium: Browser, server: FakeGameServer, size: tuple[int, int]
) -> None:
    width, height = size
    touch = width < 1000
    viewport = {"width": width, "height": height}
    with opened(chromium, server, viewport=viewport, has_touch=touch, is_mobile=touch) as page:
        page.wait_for_selector("#start:visible")
        at_rest(page)
        button = page.locator("#start-button").bounding_box()
        assert button is not None
        assert button["y"] + button["height"] <= height
        page.click("#start-button")
        server.wait_for(lambda server: bool(server.of(Ready)))
        server.send(Countdown(30))
        page.wait_for_selector("#count:visible")
        above_the_board(page, "#count")
        server.send(tick(kitchen(t=195, **MOMENT)), Paused("blur", 20.0))
        page.wait_for_selector("#pause:visible")
        above_the_board(page, "#pause")
        page.click("#pause-button", trial=True)
        board = page.locator("canvas.board").bounding_box()
        assert board is not None
        assert board["width"] / 9 >= 24, "cells are large enough to play"
        legend = page.locator("#legend [data-mark=hand]")
        assert legend.is_visible()


@pytest.mark.parametrize(
    "size",
    [(390, 844), *(pytest.param(size, marks=pytest.mark.slow) for size in ((844, 390), (360, 640), (1366, 768)))],
    ids=str,
)
def test_a_message_of_the_researcher_covers_neither_the_dialog_of_a_pause_nor_the_kitchen(
    chromium: Browser, server: FakeGameServer, size: tuple[int, int]
) -> None:
    server.welcome = rings()
    touch = size[0] < 1000
    viewport = {"width": size[0], "height": size[1]}
    with opened(chromium, server, viewport=viewport, has_touch=touch, is_mobile=touch) as page:
        start(page, server, kitchen(t=195, **MOMENT))
        server.send(Notice("The server restarts in five minutes. Please stay on this page; your progress is saved."))
        page.wait_for_selector("#notice:visible")
        for message, dialog in ((Paused("researcher", 0.0), "#pause"), (Countdown(30), "#count")):
            server.send(message)
            page.wait_for_selector(f"{dialog}:visible")
            at_rest(page)
            for part in (dialog, "canvas.board"):
                assert not overlap(page, "#notice", part), (dialog, part)
            page.click("#notice button", trial=True)
            screenshot(page, f"notice-{size[0]}x{size[1]}-{dialog[1:]}")


def overlap(page: Page, one: str, other: str) -> bool:
    """Whether two elements cover each other by more than a rounded pixel."""
    first, second = page.locator(one).bounding_box(), page.locator(other).bounding_box()
    assert first is not None
    assert second is not None
    across = min(first["x"] + first["width"], second["x"] + second["width"]) - max(first["x"], second["x"])
    down = min(first["y"] + first["height"], second["y"] + second["height"]) - max(first["y"], second["y"])
    return bool(across > 1 and down > 1)


def above_the_board(page: Page, dialog: str) -> None:
    """The dialog covers no more of the kitchen than the edge of its upper counter."""
    at_rest(page)
    panel, board = page.locator(dialog).bounding_box(), page.locator("canvas.board").bounding_box()
    assert panel is not None
    assert board is not None
    assert panel["y"] >= 0
    assert panel["y"] + panel["height"] <= board["y"] + 0.2 * board["width"] / 9, dialog
