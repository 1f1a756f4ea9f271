"""The connection between page and server: lost, closed, taken over, silent; and errors reported to the researcher."""

from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from server.play.messages import (
    ClientError,
    Countdown,
    Ended,
    Hello,
    Notice,
    Paused,
    Ping,
    Pong,
    Ready,
    Superseded,
    Waiting,
)
from tests.support.browser.fake_game_server import FakeGameServer, kitchen, tick, welcome
from tests.support.browser.game_page import opened, settled, start
from tests.support.parameters import mostly_slow

pytestmark = [pytest.mark.browser, pytest.mark.timeout(90)]


@pytest.mark.parametrize("code", mostly_slow([1011, 1012]))
def test_a_lost_connection_is_restored_at_the_same_timestep(
    chromium: Browser, server: FakeGameServer, code: int
) -> None:
    with opened(chromium, server) as page:
        start(page, server, kitchen(t=120))
        server.refusing = True
        server.drop(code)
        page.wait_for_selector("#banner:visible")
        assert "30" in page.inner_text("#banner-left")
        server.welcome = welcome(state=kitchen(t=120), resumed=True)
        server.refusing = False
        server.wait_for(lambda server: len(server.of(Ready)) == 2)
        first, second = server.of(Hello)
        assert second.tab == first.tab
        assert (first.last_timestep, second.last_timestep) == (-1, 120)
        server.send(Paused("lost", 20.0), Countdown(1))
        page.wait_for_selector("#count:visible")
        server.send(tick(kitchen(t=121)))
        expect(page.locator("[data-timestep='121'][data-view=none]")).to_be_visible()


def test_a_connection_that_was_cut_without_a_close_frame_is_reopened(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        start(page, server)
        server.cut()
        server.wait_for(lambda server: server.hellos == 2)
        expect(page.locator(".game")).to_have_attribute("data-link", "open")


def test_a_reloaded_page_waits_for_the_participant_to_continue(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        start(page, server, kitchen(t=33))
        server.on_hello = lambda _: [welcome(state=kitchen(t=33), resumed=True), Paused("lost", 28.0)]
        page.reload()
        page.wait_for_selector("#start:visible")
        assert page.inner_text("#start-title") == "Welcome back"
        assert page.evaluate("document.activeElement.id") == "start-button"
        assert len({hello.tab for hello in server.of(Hello)}) == 1, "a reload is not another tab"
        page.keyboard.press("Enter")
        server.wait_for(lambda server: len(server.of(Ready)) >= 2)
        settled(page, server)
        assert len(server.of(Ready)) == 2


def test_the_start_pressed_on_the_page_before_counts(chromium: Browser, server: FakeGameServer) -> None:
    server.page["ready_page"] = True
    with opened(chromium, server) as page:
        server.wait_for(lambda server: bool(server.of(Ready)))
        settled(page, server)
        assert len(server.of(Ready)) == 1
        assert page.is_hidden("#start"), "a button that is gone with the server's answer"


def test_the_start_dialog_is_gone_as_soon_as_its_button_is_pressed(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        page.click("#start-button")
        expect(page.locator("#start")).to_be_hidden()
        server.wait_for(lambda server: bool(server.of(Ready)))


def test_another_tab_takes_over_and_this_one_offers_the_choice(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        start(page, server)
        server.send(Superseded())
        server.drop(4001)
        page.wait_for_selector("#other:visible")
        assert page.is_hidden(".game")
        assert server.hellos == 1, "it does not fight for the game"
        page.click("#other-stay")
        assert "close this tab" in page.inner_text("#other-note")
        page.click("#other-here")
        server.wait_for(lambda server: server.hellos == 2)
        expect(page.locator(".game")).to_be_visible()


def test_a_line_closed_for_abuse_is_not_opened_again(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        start(page, server)
        server.drop(1008)
        page.wait_for_selector("#closed:visible")
        page.wait_for_timeout(400)
        assert server.hellos == 1


def test_a_page_whose_game_is_gone_is_loaded_again_once(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        start(page, server)
        server.drop(4004)
        server.wait_for(lambda server: server.hellos == 2)
        page.wait_for_selector("[data-phase=ready]")
        server.drop(4004)
        expect(page.locator("#closed")).to_be_visible()
        assert server.hellos == 2, "it is not loaded a third time"


def test_a_ping_is_answered_at_once(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        page.wait_for_selector("[data-phase=ready]")
        server.send(Ping(77))
        server.wait_for(lambda server: bool(server.of(Pong)))
        assert server.of(Pong) == [Pong(77)]


def test_a_server_that_falls_silent_is_noticed(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        start(page, server)
        page.wait_for_selector("#banner:visible", timeout=4000)
        assert page.inner_text("#banner-title") == "Waiting for the server"
        server.send(tick(kitchen(t=2)))
        expect(page.locator("#banner")).to_be_hidden()


@pytest.mark.parametrize("phase", mostly_slow(["paused", "room", "ready", "countdown"]))
def test_a_dead_line_is_given_up_in_every_phase(chromium: Browser, server: FakeGameServer, phase: str) -> None:
    first = {"room": [Waiting(60.0)], "ready": [], "paused": [Paused("researcher", 0.0)], "countdown": [Countdown(600)]}
    server.on_hello = lambda _: [*([] if phase == "room" else [welcome()]), *first[phase]]
    with opened(chromium, server) as page:
        quick(page)
        page.wait_for_selector(f"[data-phase={phase}]")
        server.mute = True
        page.clock.run_for(8000)
        page.wait_for_selector("#banner:visible")
        expect(page.locator("#banner-text")).to_contain_text("stay on this page" if phase == "room" else "is paused")
        server.mute = False
        server.wait_for(lambda server: server.hellos == 3)  # the page was loaded twice


def test_a_line_that_is_never_let_in_is_given_up(chromium: Browser, server: FakeGameServer) -> None:
    server.mute = True
    with opened(chromium, server) as page:
        quick(page)
        server.wait_for(lambda server: server.hellos == 2)
        page.clock.run_for(8000)
        server.wait_for(lambda server: server.hellos == 3)


def test_a_participant_who_comes_back_to_a_dead_line_need_not_wait(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        quick(page)
        page.wait_for_selector("[data-phase=ready]")
        server.mute = True
        page.clock.fast_forward(5500)
        server.mute = False
        page.evaluate("window.dispatchEvent(new Event('focus'))")
        server.wait_for(lambda server: server.hellos == 3)


def test_a_page_that_stood_still_keeps_its_line(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        quick(page)
        page.wait_for_selector("[data-phase=ready]")
        page.clock.fast_forward(60_000)  # its timers run late, and so do the messages
        pings = page.evaluate("performance.now()")
        page.wait_for_function("(then) => performance.now() > then + 2500", arg=pings)
        assert server.hellos == 2


def test_the_line_of_a_game_that_is_over_may_be_silent(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        quick(page)
        start(page, server)
        server.send(Ended(20, 1, 0.0, True, "/blank", "horizon"))
        page.wait_for_selector("#over:visible")
        server.mute = True
        page.clock.run_for(20_000)
        assert server.hellos == 2


def quick(page: Page) -> None:
    """Load the page again, with a clock that the test can move on."""
    page.wait_for_selector("[data-link=open], [data-link=connecting]")
    page.clock.install()
    page.reload()


@pytest.mark.parametrize(
    ("reason", "part"),
    mostly_slow([("database", "#banner"), ("researcher", "#pause"), ("partner", "#pause"), ("server", "#pause")]),
)
def test_every_pause_shows_its_reason(chromium: Browser, server: FakeGameServer, reason: str, part: str) -> None:
    with opened(chromium, server) as page:
        start(page, server)
        server.send(Paused(reason, 0.0))
        page.wait_for_selector(f"{part}:visible")
        assert page.is_visible("#pause-button") == (reason == "server"), "only who was away says when it continues"
        assert page.inner_text("#urgent")


@pytest.mark.parametrize(
    ("reason", "left_s", "words"),
    mostly_slow(
        [
            ("partner", 30.0, "The round ends if your partner is not back within 30 seconds."),
            ("partner", 1.0, "The round ends if your partner is not back within 1 second."),
            ("blur", 30.0, "Please resume within 30 seconds."),
            ("blur", 0.1, "Please resume within 1 second."),
        ]
    ),
)
def test_a_pause_shows_what_happens_if_it_lasts_too_long(
    chromium: Browser, server: FakeGameServer, reason: Any, left_s: float, words: str
) -> None:
    with opened(chromium, server) as page:
        start(page, server)
        server.send(Paused(reason, left_s))
        expect(page.locator("#pause-left")).to_have_text(words)


def test_a_message_of_the_researcher_is_shown_as_text(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        start(page, server)
        server.send(Notice("<b>Lunch</b> at noon"))
        page.wait_for_selector("#notice:visible")
        assert page.inner_text("#notice-text") == "<b>Lunch</b> at noon"
        notice, board = page.locator("#notice").bounding_box(), page.locator("canvas.board").bounding_box()
        assert notice is not None
        assert board is not None
        assert notice["y"] + notice["height"] <= board["y"], "it hides nothing of the kitchen"
        page.click("#notice button")
        assert page.is_hidden("#notice")
        assert page.evaluate("document.activeElement.classList.contains('stage')"), "dimmed or not"


def test_errors_of_the_page_reach_the_server_once_each_and_a_few_at_most(
    chromium: Browser, server: FakeGameServer
) -> None:
    with opened(chromium, server) as page:
        page.wait_for_selector("[data-phase=ready]")
        for number in [1, 1, 2, 3, 4, 5, 6, 7]:
            page.evaluate(
                "(n) => dispatchEvent(new ErrorEvent('error', {message: 'oven ' + n, error: new Error('oven ' + n)}))",
                number,
            )
        server.wait_for(lambda server: len(server.of(ClientError)) == 5)
        assert all("oven" in error.text for error in server.of(ClientError))


def test_an_invalid_frame_is_reported_and_the_game_continues(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        start(page, server)
        server.send_raw('{"type":"dance"}')
        server.wait_for(lambda server: bool(server.of(ClientError)))
        assert "unknown message dance" in server.of(ClientError)[0].text
        server.send(tick(kitchen(t=2)))
        expect(page.locator(".game")).to_have_attribute("data-timestep", "2")
