"""The game's page: score, tutorial, end, sound, languages, accessibility."""

import re
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from server.play.messages import Countdown, Ended, Lesson, Paused, Ready, Superseded
from tests.support.browser.double_rings import MOMENT, WALK_TURN_SERVE, rings, shown
from tests.support.browser.double_rings import server as server
from tests.support.browser.fake_game_server import NONE, PRACTICE, FakeGameServer, kitchen, tick, welcome
from tests.support.browser.game_page import (
    DESKTOP,
    PHONE,
    at_rest,
    opened,
    pixel,
    screenshot,
    start,
    violations,
)
from tests.support.parameters import mostly_slow


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


def test_a_viewer_of_two_agents_has_no_controls(chromium: Browser, server: FakeGameServer) -> None:
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


def test_a_viewer_is_not_told_that_a_result_was_saved(chromium: Browser, server: FakeGameServer) -> None:
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


def test_the_tutorial_shows_what_to_do_and_where(chromium: Browser, server: FakeGameServer) -> None:
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


def test_the_end_does_not_lead_to_other_sites(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        start(page, server, kitchen(t=399, **MOMENT))
        server.send(Ended(0, 0, 0.0, False, "https://elsewhere.example/x", "horizon"))
        page.wait_for_selector("#over:visible")
        assert page.inner_text("#over-title") == "The round has ended"
        assert page.get_attribute("#over-next", "href") == "/"


def test_sound_is_off_until_it_is_wanted_and_the_choice_is_kept(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server, viewport=DESKTOP) as page:
        start(page, server, kitchen(t=195, **MOMENT))
        assert page.get_attribute("#sound", "aria-pressed") == "false"
        page.click("#sound")
        assert page.evaluate("document.activeElement.className") == "stage", "the game has the keys again"
        page.reload()
        expect(page.locator("#sound")).to_have_attribute("aria-pressed", "true")


@pytest.mark.parametrize(
    "broken",
    mostly_slow(
        [
            "delete window.AudioContext",
            "window.AudioContext = function () { throw new DOMException('no device', 'NotSupportedError'); }",
            "AudioContext.prototype.createOscillator ="
            " () => { throw new DOMException('closed', 'InvalidStateError'); }",
        ]
    ),
    ids=["no WebAudio", "no device", "closed"],
)
def test_a_browser_that_cannot_make_sound_plays_on(chromium: Browser, server: FakeGameServer, broken: str) -> None:
    with opened(chromium, server, viewport=DESKTOP) as page:
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.evaluate(f"() => {{ {broken}; }}")
        page.wait_for_selector("#start:visible")
        page.evaluate("document.querySelector('#sound').click()")
        page.click("#start-button")
        server.wait_for(lambda server: bool(server.of(Ready)))
        server.send(Countdown(1.0))
        page.wait_for_selector("#count:visible")
        server.send(tick(kitchen(t=195, **MOMENT)))
        page.wait_for_selector("#count", state="hidden")
        assert page.get_attribute("#sound", "aria-pressed") == "true"
        assert errors == []


def test_the_page_is_available_in_chinese(chromium: Browser, server: FakeGameServer) -> None:
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


@pytest.mark.parametrize(("width", "height"), mostly_slow([(844, 390), (568, 320), (390, 844)]))
def test_a_practice_that_may_be_skipped_has_its_button_on_every_phone(
    chromium: Browser, server: FakeGameServer, width: int, height: int
) -> None:
    lesson_page(server, skip="tutorial")
    size: Any = {"width": width, "height": height}
    with opened(chromium, server, viewport=size, has_touch=True, is_mobile=True) as page:
        start(page, server, kitchen(t=1, players=((2, 2, 3, 0), (5, 3, 0, 0))))
        page.click("#skip", trial=True)


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
