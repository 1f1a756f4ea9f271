"""Faults as seen by a participant in a real browser: the page recovers by itself, and foreign pages are refused."""

import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, Page

from tests.support.browser.game_page import DESKTOP, draw_less_often, screenshot
from tests.support.faults.group import LONG_STUDY
from tests.support.live_server import LiveServer
from tests.support.real_server import RealServer

pytestmark = [pytest.mark.browser, pytest.mark.timeout(240)]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RealServer]:
    with RealServer(tmp_path_factory.mktemp("faults"), speed=4.0, study=LONG_STUDY) as running:
        yield running


@pytest.fixture
def live(tmp_path: Path) -> Iterator[LiveServer]:
    """For a test that does not stop it."""
    with LiveServer(tmp_path, speed=4.0, study=LONG_STUDY) as running:
        yield running


@pytest.fixture
def visitor(chromium: Browser) -> Iterator[BrowserContext]:
    context = chromium.new_context(viewport=DESKTOP)
    context.set_default_timeout(60_000)
    yield draw_less_often(context)
    context.close()


def playing(visitor: BrowserContext, server: RealServer | LiveServer) -> Page:
    """A page whose game runs."""
    page = visitor.new_page()
    page.goto(f"{server.url}/s/short")
    for box in page.locator("main input[type=checkbox]").all():
        box.check()
    while not page.locator("#game-config").count():
        with page.expect_navigation():
            while page.locator("#next:visible").count():
                page.click("#next")
            page.locator("main .btn:not(.quiet):visible").first.click()
    page.wait_for_selector("#start-button:visible, [data-phase=playing]")
    if page.locator("#start-button:visible").count():
        page.click("#start-button")
    page.wait_for_selector("[data-phase=playing]")
    return page


def timestep(page: Page) -> int:
    return int(page.get_attribute(".game", "data-timestep") or 0)


def wait_until_past(page: Page, reached: int) -> None:
    page.wait_for_function(
        "reached => Number(document.querySelector('.game').dataset.timestep) > reached", arg=reached, timeout=60_000
    )


@pytest.mark.slow
def test_a_killed_server_is_noticed_and_the_page_continues_without_a_reload(
    visitor: BrowserContext, server: RealServer
) -> None:
    page = playing(visitor, server)
    wait_until_past(page, 10)
    page.evaluate("window.notReloaded = true")
    server.end(signal.SIGKILL)
    page.wait_for_selector("[data-link=lost]")
    screenshot(page, "fault-server-killed")
    reached = timestep(page)
    server.start()
    began = time.monotonic()
    page.wait_for_selector("[data-link=open]")
    page.wait_for_selector("[data-phase=countdown], [data-phase=playing]")
    print(f"back {time.monotonic() - began:.2f} s after pages could be opened")
    wait_until_past(page, reached)
    assert page.evaluate("window.notReloaded") is True
    page.close()


@pytest.mark.slow
def test_the_back_button_and_a_suspended_page_lead_to_the_same_timestep(
    visitor: BrowserContext, server: RealServer
) -> None:
    page = playing(visitor, server)
    wait_until_past(page, 5)
    page.go_back()
    page.goto(f"{server.url}/s/short/now")
    page.wait_for_selector("#start:visible")
    reached = timestep(page)
    assert reached > 5
    page.click("#start-button")
    wait_until_past(page, reached)
    devtools = visitor.new_cdp_session(page)
    devtools.send("Page.setWebLifecycleState", {"state": "frozen"})
    time.sleep(1.0)
    devtools.send("Page.setWebLifecycleState", {"state": "active"})
    wait_until_past(page, timestep(page))
    page.close()


def test_a_foreign_page_reaches_neither_the_socket_nor_a_form(visitor: BrowserContext, live: LiveServer) -> None:
    """Another name of this machine is another site to a browser."""
    page = playing(visitor, live)
    foreign = visitor.new_page()
    foreign.goto(live.url.replace("127.0.0.1", "localhost") + "/nowhere")
    address = live.url.replace("http", "ws") + "/s/short/socket"
    opened = foreign.evaluate(
        """address => new Promise((done) => {
          let socket;
          try { socket = new WebSocket(address); } catch { done('refused'); return; }
          socket.onopen = () => done('opened');
          socket.onerror = () => done('refused');
        })""",
        address,
    )
    assert opened == "refused"
    answer = foreign.request.post(f"{live.url}/s/short/now", form={"step": "x"}, headers={"origin": "http://localhost"})
    assert answer.status == 403
    wait_until_past(page, timestep(page))
    foreign.close()
    page.close()
