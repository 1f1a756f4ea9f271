"""What the game's page shows: pixels of the board, messages over it, sizes, accessibility."""

import re
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from server.play.messages import Countdown, Ended, Lesson, Paused, Ready, Superseded, Welcome
from tests.support.browser.fake_game_server import NONE, PRACTICE, RINGS, FakeGameServer, kitchen, tick, welcome
from tests.support.browser.game_page import (
    DESKTOP,
    PHONE,
    at_rest,
    drawn,
    is_blue,
    is_green,
    opened,
    picture,
    pixel,
    screenshot,
    start,
    violations,
)

pytestmark = [pytest.mark.browser, pytest.mark.timeout(90)]

# Double Rings: the partner at (7, 3) with a soup walks up, turns to the hatch, serves.
WALK_TURN_SERVE = ((0, 95), (2, 80), (5, 60))
MOMENT: dict[str, Any] = {
    "players": ((3, 3, 2, 1), (7, 3, 2, 3)),
    "counters": ((6, 2, 2), (4, 4, 1)),
    "pots": ((4, 0, 3, 12), (6, 0, 2, -1)),
    "score": 40,
    "soups": 2,
}


def rings(**changes: Any) -> Welcome:
    """A round in Double Rings. Its ticks are so long that no mark grows stale while a test looks at it."""
    state = kitchen(t=194, **MOMENT)
    named = {"title": "Double Rings", "layout": "double_rings"}
    return welcome(**{"grid": RINGS, "tick_ms": 5000, "state": state, **named, **changes})


@pytest.fixture
def server(server: FakeGameServer) -> FakeGameServer:
    server.welcome = rings()
    return server


def shown(page: Page, server: FakeGameServer, state: Any, prediction: Any, **more: Any) -> None:
    """Send a tick and wait until its marks are there in full."""
    server.send(tick(state, prediction, **more))
    page.wait_for_selector(f"[data-timestep='{state.t}']")
    drawn(page, 220)


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


def test_score_time_and_soups_follow_the_server(chromium: Browser, server: FakeGameServer) -> None:
    server.welcome = rings(tick_ms=200)
    with opened(chromium, server) as page:
        start(page, server, kitchen(t=195, **MOMENT))
        assert [page.inner_text(f"#{name}") for name in ("time", "score", "soups")] == ["0:41", "40", "2"]
        shown(page, server, kitchen(t=390, **{**MOMENT, "score": 60, "soups": 3}), NONE)
        assert [page.inner_text(f"#{name}") for name in ("time", "score", "soups")] == ["0:02", "60", "3"]
        assert page.inner_text("#title") == "Double Rings"
        assert page.inner_text("#round") == "Round 4 of 10"


def test_a_delivery_shows_its_points_and_is_announced(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        at_hatch = {**MOMENT, "players": ((3, 3, 2, 1), (7, 2, 2, 3))}
        start(page, server, kitchen(t=195, **at_hatch))
        served = {**MOMENT, "players": ((3, 3, 2, 1), (7, 2, 2, 0)), "score": 60, "soups": 3}
        shown(page, server, kitchen(t=196, **served), NONE, actions=(4, 5))
        screenshot(page, "game-delivery")
        assert page.inner_text("#polite") == "Soup served. Score 60."


@pytest.mark.parametrize("shows", [True, False])
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


@pytest.mark.parametrize("display", ["actions", "both", "none"])
def test_no_card_beside_the_kitchen_cuts_off_its_last_line(
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
    [(1024, 600), (1366, 768), (1920, 1080), (683, 384), (390, 844), (360, 640), (844, 390)],
    ids=lambda size: f"{size[0]}x{size[1]}",
)
def test_everything_that_matters_is_in_sight_without_scrolling(
    chromium: Browser, server: FakeGameServer, size: tuple[int, int]
) -> None:
    width, height = size
    touch = size in ((390, 844), (360, 640), (844, 390))
    with opened(
        chromium, server, viewport={"width": width, "height": height}, has_touch=touch, is_mobile=touch
    ) as page:
        start(page, server, kitchen(t=195, **MOMENT))
        server.send(tick(kitchen(t=196, **MOMENT), WALK_TURN_SERVE))
        drawn(page, 250)
        parts = ["#time", "#score", "#soups", "canvas.board"] + (
            [".touch .use", ".pad [data-action='1']"] if touch else []
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


@pytest.mark.parametrize("factor", [2, 3])
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


def test_a_resized_window_fits_the_kitchen_again(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        start(page, server, kitchen(t=195, **MOMENT))
        wide = page.evaluate("document.querySelector('canvas.board').width")
        page.set_viewport_size({"width": 1024, "height": 600})
        page.wait_for_function("(wide) => document.querySelector('canvas.board').width < wide", arg=wide)
        assert is_blue(pixel(page, 3.5, 3.75)), "and draws it again"


def test_who_watches_two_agents_has_no_controls(chromium: Browser, server: FakeGameServer) -> None:
    server.welcome = rings(kind="watch", seat=-1)
    with opened(chromium, server) as page:
        page.wait_for_selector("#start:visible")
        page.click("#start-button")
        server.wait_for(lambda server: bool(server.of(Ready)))
        server.send(Countdown(0), tick(kitchen(t=195, **MOMENT), WALK_TURN_SERVE))
        page.wait_for_selector("[data-phase=playing]")
        assert page.is_hidden(".panel.kb")
        page.keyboard.press("ArrowUp")
        server.send(tick(kitchen(t=196, **MOMENT)))
        page.wait_for_selector("[data-timestep='196']")
        assert server.inputs() == []


def test_who_has_only_watched_is_not_told_of_a_saved_result(chromium: Browser, server: FakeGameServer) -> None:
    server.welcome = rings(kind="watch", seat=-1)
    with opened(chromium, server) as page:
        start(page, server, kitchen(t=399, **MOMENT))
        server.send(Ended(40, 2, 9.0, True, "/blank", "horizon"))
        page.wait_for_selector("#over:visible")
        assert page.inner_text("#over-text") == "Nothing was stored."
        assert page.inner_text("#over-next") == "Watch others"


def lesson_page(server: FakeGameServer, **page: Any) -> None:
    server.page |= {"lessons": ["walk", "fetch", "fill", "wait", "plate", "deliver", "marks"], **page}
    state = kitchen(players=((2, 2, 3, 0), (5, 3, 0, 0)))
    server.welcome = welcome(
        kind="tutorial", number=0, endless=True, horizon=0, grid=PRACTICE, title="Practice", state=state
    )


def test_the_tutorial_tells_what_to_do_and_where(chromium: Browser, server: FakeGameServer) -> None:
    lesson_page(server)
    with opened(chromium, server) as page:
        start(page, server, kitchen(t=1, players=((2, 2, 3, 0), (5, 3, 0, 0))))
        server.send(Lesson("fetch", 1, 7, False))
        page.wait_for_selector("#coach:visible")
        assert page.inner_text("#coach .t") == "Take an onion"
        assert page.inner_text("#coach kbd") == "Space"
        assert page.locator(".todo li").count() == 7
        assert page.inner_text(".todo [aria-current]") == "Take an onion"
        assert page.locator(".todo .done").count() == 1
        assert page.is_hidden(".stat.time")
        for _ in range(40):  # it swells and shrinks
            red, green, blue = pixel(page, 0.5, 2.07)
            if min(red - 150, red - blue - 90, red - green - 60) > 0:
                break
            page.wait_for_timeout(50)
        else:
            pytest.fail("there is no ring round the crate")
        screenshot(page, "tutorial-desktop")
        server.send(Lesson("plate", 4, 7, False))
        page.wait_for_function("() => document.querySelector('#coach .t').textContent === 'Fill a dish'")
        words = " ".join(page.inner_text("#coach .how").split())
        assert words == "Take a dish from the rack with Space, then press Space at the pot."


def test_without_predictions_the_tutorial_leaves_the_marks_out(chromium: Browser, server: FakeGameServer) -> None:
    lesson_page(server)
    with opened(chromium, server) as page:
        start(page, server, kitchen(t=1, players=((2, 2, 3, 0), (5, 3, 0, 0))))
        server.send(Lesson("walk", 0, 6, False))
        page.wait_for_selector("#coach:visible")
        assert page.locator(".todo li").count() == 6


def test_the_end_shows_the_result_and_leads_on(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        start(page, server, kitchen(t=399, **MOMENT))
        server.send(tick(kitchen(t=400, **MOMENT), NONE), Ended(40, 2, 9.0, True, "/blank", "horizon"))
        server.drop(1000)
        page.wait_for_selector("#over:visible")
        assert [page.inner_text(f"#over-{name}") for name in ("title", "score", "soups")] == [
            "The round is over",
            "40",
            "2",
        ]
        page.wait_for_function("() => document.activeElement.id === 'over-next'")
        screenshot(page, "game-over")
        page.keyboard.press("Enter")
        page.wait_for_url("**/blank")
        assert server.hellos == 1


def test_the_end_leads_nowhere_outside(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        start(page, server, kitchen(t=399, **MOMENT))
        server.send(Ended(0, 0, 0.0, False, "https://elsewhere.example/x", "horizon"))
        page.wait_for_selector("#over:visible")
        assert page.inner_text("#over-title") == "The round has ended"
        assert page.get_attribute("#over-next", "href") == "/"


def test_sound_is_off_until_it_is_wanted_and_the_wish_is_kept(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server, viewport=DESKTOP) as page:
        start(page, server, kitchen(t=195, **MOMENT))
        assert page.get_attribute("#sound", "aria-pressed") == "false"
        page.click("#sound")
        assert page.evaluate("document.activeElement.className") == "stage", "the game has the keys again"
        page.reload()
        expect(page.locator("#sound")).to_have_attribute("aria-pressed", "true")


@pytest.mark.parametrize(
    "broken",
    [
        "delete window.AudioContext",
        "window.AudioContext = function () { throw new DOMException('no device', 'NotSupportedError'); }",
        "AudioContext.prototype.createOscillator = () => { throw new DOMException('closed', 'InvalidStateError'); }",
    ],
    ids=["no WebAudio", "no device", "closed"],
)
def test_a_browser_that_cannot_make_sound_plays_on(chromium: Browser, server: FakeGameServer, broken: str) -> None:
    with opened(chromium, server, viewport=DESKTOP) as page:
        troubles: list[str] = []
        page.on("pageerror", lambda error: troubles.append(str(error)))
        page.evaluate(f"() => {{ {broken}; }}")
        page.wait_for_selector("#start:visible")
        page.evaluate("document.querySelector('#sound').click()")
        page.click("#start-button")
        server.wait_for(lambda server: bool(server.of(Ready)))
        server.send(Countdown(2.0))
        page.wait_for_selector("#count:visible")
        server.send(tick(kitchen(t=195, **MOMENT)))
        page.wait_for_selector("#count", state="hidden")
        assert page.get_attribute("#sound", "aria-pressed") == "true"
        assert troubles == []


def test_the_page_speaks_chinese(chromium: Browser, server: FakeGameServer) -> None:
    server.page["language"] = "zh"
    with opened(chromium, server) as page:
        start(page, server, kitchen(t=195, **MOMENT))
        assert page.get_attribute("html", "lang") == "zh"
        visible = page.inner_text("body")
        assert "剩余时间" in visible
        assert not re.search(r"[a-z]+\.[a-z_]+\.[a-z]+|\{\w+\}", visible), "no key and no gap shows"
        screenshot(page, "game-chinese")


def test_axe_finds_nothing_in_any_state(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        page.wait_for_selector("#start:visible")
        check(page, "start")
        page.click("#start-button")
        server.wait_for(lambda server: bool(server.of(Ready)))
        server.send(Countdown(30))
        page.wait_for_selector("#count:visible")
        check(page, "countdown")
        server.send(tick(kitchen(t=195, **MOMENT), WALK_TURN_SERVE))
        check(page, "playing")
        page.click("#change-keys")
        check(page, "keys")
        page.keyboard.press("Escape")
        server.send(Paused("blur", 20.0))
        page.wait_for_selector("#pause:visible")
        check(page, "paused")
        server.send(Paused("database", 0.0))
        page.wait_for_selector("#banner:visible")
        check(page, "database")
        server.refusing = True
        server.drop()
        page.wait_for_selector("[data-link=lost]")
        check(page, "reconnecting")
        server.refusing = False
        server.wait_for(lambda server: server.hellos == 2)
        server.send(Ended(40, 2, 0.0, True, "/blank", "horizon"))
        page.wait_for_selector("#over:visible")
        check(page, "ended")
        server.send(Superseded())
        page.wait_for_selector("#other:visible")
        check(page, "other tab")


def test_axe_finds_nothing_in_the_tutorial_on_a_phone(chromium: Browser, server: FakeGameServer) -> None:
    lesson_page(server)
    with opened(chromium, server, viewport=PHONE, has_touch=True, is_mobile=True) as page:
        start(page, server, kitchen(t=1, players=((2, 2, 3, 0), (5, 3, 0, 0))))
        server.send(Lesson("walk", 0, 7, False))
        page.wait_for_function("() => document.querySelector('#lessons .how').textContent")
        check(page, "tutorial")
        screenshot(page, "tutorial-phone")


def check(page: Page, state: str) -> None:
    """No violation of WCAG 2.2 AA."""
    at_rest(page)  # an overlay that still comes in is half transparent
    assert violations(page) == [], state


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


def above_the_board(page: Page, dialog: str) -> None:
    """The dialog covers no more of the kitchen than the edge of its upper counter."""
    at_rest(page)
    panel, board = page.locator(dialog).bounding_box(), page.locator("canvas.board").bounding_box()
    assert panel is not None
    assert board is not None
    assert panel["y"] >= 0
    assert panel["y"] + panel["height"] <= board["y"] + 0.2 * board["width"] / 9, dialog
