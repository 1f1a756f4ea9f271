"""What is drawn on the board: marks, chefs between two ticks, sharpness."""

import pytest
from playwright.sync_api import Browser

from tests.support.browser.double_rings import MOMENT, WALK_TURN_SERVE, rings, shown
from tests.support.browser.double_rings import server as server
from tests.support.browser.fake_game_server import NONE, FakeGameServer, kitchen, tick
from tests.support.browser.game_page import (
    drawn,
    is_blue,
    is_green,
    opened,
    picture,
    pixel,
    screenshot,
    start,
)
from tests.support.parameters import mostly_slow

pytestmark = [pytest.mark.browser, pytest.mark.timeout(90)]


def test_marks_are_drawn_on_the_predicted_cells_and_gone_with_the_next_tick(
    chromium: Browser, server: FakeGameServer
) -> None:
    with opened(chromium, server) as page:
        start(page, server, kitchen(t=195, **MOMENT))
        shown(page, server, kitchen(t=196, **MOMENT), WALK_TURN_SERVE)
        assert is_green(pixel(page, 7.5, 2.72)), "the arrow's shaft runs from (7, 3) to (7, 2)"
        assert is_green(pixel(page, 7.83, 2.5)), "a blunt arrow in (7, 2) towards the hatch"
        assert is_green(pixel(page, 7.86, 2.12)), "the hand's disc above it"
        assert not is_green(pixel(page, 6.5, 3.5))
        screenshot(page, "game-desktop")
        shown(page, server, kitchen(t=197, **MOMENT), NONE)
        assert not any(is_green(pixel(page, x, y)) for x, y in ((7.5, 2.72), (7.83, 2.5), (7.86, 2.12)))


def test_marks_lie_under_chefs_and_above_the_floor(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        start(page, server, kitchen(t=195, **MOMENT))
        shown(page, server, kitchen(t=196, **MOMENT), ((3, 95), (3, 80), (3, 60)))
        shown(
            page,
            server,
            kitchen(t=197, **{**MOMENT, "players": ((6, 3, 1, 0), (7, 3, 3, 3))}),
            ((3, 95), (4, 80), (4, 60)),
        )
        assert not is_green(pixel(page, 6.5, 3.7)), "the blue chef stands on the arrow"


def test_marks_turn_grey_when_no_news_comes(chromium: Browser, server: FakeGameServer) -> None:
    server.welcome = rings(tick_ms=200)
    with opened(chromium, server) as page:
        start(page, server, kitchen(t=195, **MOMENT))
        shown(page, server, kitchen(t=196, **MOMENT), WALK_TURN_SERVE)
        drawn(page, 300)
        red, green, blue = pixel(page, 7.5, 2.72)
        assert max(red, green, blue) - min(red, green, blue) < 40


def test_a_watched_human_has_blue_marks(chromium: Browser, server: FakeGameServer) -> None:
    server.welcome = rings(watched_seat=0)
    with opened(chromium, server) as page:
        start(page, server, kitchen(t=195, **MOMENT))
        shown(page, server, kitchen(t=196, **MOMENT), ((2, 95), (2, 80), (4, 60)))
        assert is_blue(pixel(page, 4.5, 3.5))


def test_several_pictures_are_drawn_between_two_ticks(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server, in_full=True) as page:
        start(page, server, kitchen(t=195, **MOMENT))
        moved = kitchen(t=196, **{**MOMENT, "players": ((4, 3, 2, 1), (7, 3, 2, 3))})
        counting = """() => new Promise((done) => {
          const canvas = document.querySelector('canvas.board'), seen = new Set();
          const look = () => {
            const x = Math.floor(canvas.width * 3.5 / 9), y = Math.floor(canvas.height * 3.2 / 5);
            seen.add(String(canvas.getContext('2d').getImageData(x, y, canvas.width / 9, 1).data));
            const over = document.querySelector('.game').dataset.timestep === '197';
            if (over) done(seen.size); else requestAnimationFrame(look);
          };
          look();
        })"""
        page.evaluate(f"void (window.counted = ({counting})())")
        shown(page, server, moved, NONE, actions=(2, 4))
        server.send(tick(kitchen(t=197, **{**MOMENT, "players": ((4, 3, 2, 1), (7, 3, 2, 3))})))
        assert page.evaluate("window.counted") >= 4


def test_nothing_moves_between_ticks_when_motion_is_reduced(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server, in_full=True, reduced_motion="reduce") as page:
        start(page, server, kitchen(t=195, **MOMENT))
        moved = kitchen(t=196, **{**MOMENT, "players": ((4, 3, 2, 1), (7, 3, 2, 3)), "pots": ((4, 0, 3, 20),)})
        server.send(tick(moved, WALK_TURN_SERVE, actions=(2, 4)))
        page.wait_for_selector("[data-timestep='196']")
        page.wait_for_function(
            "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))"
        )
        first = picture(page)
        drawn(page, 120)
        assert picture(page) == first
        assert is_green(pixel(page, 7.5, 2.72)), "marks are there at once"


@pytest.mark.parametrize("factor", mostly_slow([2, 3]))
def test_the_board_has_two_pixels_for_each_of_the_page_on_sharp_screens_and_no_more(
    chromium: Browser, server: FakeGameServer, factor: int
) -> None:
    with opened(chromium, server, device_scale_factor=factor) as page:
        start(page, server, kitchen(t=195, **MOMENT))
        drawn, seen = page.evaluate(
            "(() => { const c = document.querySelector('canvas.board'); return [c.width, c.clientWidth]; })()"
        )
        assert drawn == pytest.approx(2 * seen, abs=2)
        assert drawn % 9 == 0, "whole pixels a cell"
