"""Rewarding details of the game: flying points, the result with bowls and a curve, the marks in slow motion."""

import itertools
from typing import Any

import pytest
from playwright.sync_api import Browser, Page

from server.play.messages import Ended, Paused
from tests.support.browser.double_rings import MOMENT, rings
from tests.support.browser.fake_game_server import NONE, RINGS, FakeGameServer, kitchen, tick
from tests.support.browser.game_page import opened, start, violations
from tests.support.parameters import mostly_slow

pytestmark = [pytest.mark.browser, pytest.mark.timeout(90)]

AT_HATCH = {**MOMENT, "players": ((3, 3, 2, 1), (7, 2, 2, 3))}
SERVED = {**MOMENT, "players": ((3, 3, 2, 1), (7, 2, 2, 0)), "score": 60, "soups": 3}
# Notes what flies: it is gone again within a second.
NOTE_POINTS = """() => { window.flown = []; new MutationObserver((list) => list.forEach((each) => window.flown.push(
  ...[...each.addedNodes].filter((one) => one.className === 'points').map((one) => one.textContent))))
  .observe(document.querySelector('.game'), { childList: true }); }"""


@pytest.fixture
def server(server: FakeGameServer) -> FakeGameServer:
    server.welcome = rings(number=3)
    return server


def serve(page: Page, server: FakeGameServer) -> None:
    start(page, server, kitchen(t=195, **AT_HATCH))
    page.evaluate(NOTE_POINTS)
    server.send(tick(kitchen(t=196, **SERVED), NONE, actions=(4, 5)))
    page.wait_for_selector("[data-timestep='196']")


def test_points_of_a_soup_fly_to_the_score_and_leave_nothing_behind(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        serve(page, server)
        assert page.evaluate("window.flown") == ["+20"]
        page.wait_for_function("() => !document.querySelector('.points')")
        assert page.inner_text("#score") == "60"


def test_nothing_flies_when_motion_is_reduced(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server, reduced_motion="reduce") as page:
        serve(page, server)
        assert page.evaluate("window.flown") == []


@pytest.mark.parametrize("hatch", mostly_slow([[8, 2], [0, 2], [4, 0], [4, 4], [1, 4]]))
def test_points_fly_around_the_board_and_not_over_it(
    chromium: Browser, server: FakeGameServer, hatch: tuple[int, int]
) -> None:
    board = {"left": 100, "top": 200, "right": 1000, "bottom": 700}
    with opened(chromium, server) as page:
        way: list[list[float]] = page.evaluate(
            "async (a) => (await import('/static/js/game/flying-points.js')).flight(...a)",
            [{"x": hatch[0], "y": hatch[1]}, RINGS, board, [900, 50]],
        )
    assert way[-1] == [900, 50]
    inside = [
        (x, y)
        for (ax, ay), (bx, by) in itertools.pairwise(way)
        for part in range(101)
        for x, y in [(ax + (bx - ax) * part / 100, ay + (by - ay) * part / 100)]
        if board["left"] < x < board["right"] and board["top"] < y < board["bottom"]
    ]
    assert not inside


def test_the_result_has_a_bowl_for_each_soup_and_the_own_curve(chromium: Browser, server: FakeGameServer) -> None:
    server.page["rounds"] = [{"number": 1, "score": 20}, {"number": 2, "score": 60}]
    with opened(chromium, server) as page:
        start(page, server, kitchen(t=399, **MOMENT))
        server.send(Ended(40, 2, 9.0, True, "/blank", "horizon"))
        page.wait_for_selector("#over:visible")
        assert page.locator("#over-bowls img").count() == 2
        said = "Round 1: 20 points. Round 2: 60 points. Round 3: 40 points."
        assert page.get_attribute("#over-curve svg", "aria-label") == said
        assert violations(page) == []


def test_a_first_round_without_soups_has_neither_bowls_nor_curve(chromium: Browser, server: FakeGameServer) -> None:
    server.welcome = rings(number=1)
    with opened(chromium, server) as page:
        start(page, server, kitchen(t=399, **{**MOMENT, "score": 0, "soups": 0}))
        server.send(Ended(0, 0, 0.0, True, "/blank", "horizon"))
        page.wait_for_selector("#over:visible")
        assert page.is_hidden("#over-bowls")
        assert page.is_hidden("#over-curve")


def open_help(page: Page) -> None:
    page.keyboard.press("?")
    page.wait_for_selector("#marks-help[open]")


def help_text(page: Page) -> str:
    return page.inner_text("#marks-help-text")


@pytest.mark.slow
def test_one_key_explains_the_marks_before_a_round_and_in_a_pause_but_not_while_it_runs(
    chromium: Browser, server: FakeGameServer
) -> None:
    with opened(chromium, server) as page:
        page.wait_for_selector("[data-phase=ready]")
        open_help(page)
        assert help_text(page) == "The largest mark shows the first step: Walk."
        page.wait_for_function(
            "() => document.querySelector('#marks-help-text').textContent.startsWith('The chef did')"
        )
        assert violations(page) == []
        page.keyboard.press("Escape")
        start(page, server, kitchen(t=195, **MOMENT))
        assert page.is_disabled(".tools .marks-help-open")
        page.keyboard.press("?")
        assert page.locator("#marks-help[open]").count() == 0
        server.send(Paused("researcher", 20))
        page.wait_for_selector("[data-phase=paused]")
        open_help(page)
        page.keyboard.press("Escape")
        page.click("#pause .marks-help-open")  # the panel lies over the button at the top
        page.wait_for_selector("#marks-help[open]")


@pytest.mark.slow
def test_with_reduced_motion_a_button_goes_through_the_example(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server, reduced_motion="reduce") as page:
        page.wait_for_selector("[data-phase=ready]")
        open_help(page)
        assert page.is_hidden("#marks-help-play")
        words = [help_text(page)]
        for _ in range(6):
            page.keyboard.press("Enter")  # the button for the next step has the focus
            words.append(help_text(page))
        steps: list[Any] = [text.rpartition(": ")[2] for text in words[:-1]]
        assert steps == ["Walk.", "Walk.", "Walk.", "Turn.", "Use.", "Wait."]
        assert words[-1] == "The chef did all the steps that its marks showed."


@pytest.mark.slow
def test_if_intentions_are_shown_the_example_shows_one_in_words(chromium: Browser, server: FakeGameServer) -> None:
    server.welcome = rings(display="intention")
    with opened(chromium, server, reduced_motion="reduce") as page:
        page.wait_for_selector("[data-phase=ready]")
        open_help(page)
        assert page.inner_text("#marks-help-lead").startswith("The icon shows the station")
        words = [help_text(page)]
        for _ in range(5):
            page.keyboard.press("Enter")
            words.append(help_text(page))
        assert words[0] == "The prediction: onion to the pot."
        assert words[1:5] == ["The chef is on its way. The prediction is still: onion to the pot."] * 4
        assert words[5] == "The chef did what the icon showed."


def test_without_marks_there_is_nothing_to_explain(chromium: Browser, server: FakeGameServer) -> None:
    server.welcome = rings(shows_predictions=False)
    with opened(chromium, server) as page:
        page.wait_for_selector("[data-phase=ready]")
        assert page.locator(".marks-help-open:visible").count() == 0
