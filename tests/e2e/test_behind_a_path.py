"""The whole product behind a path of a server that serves other things too: no request goes outside of it."""

from collections.abc import Iterator
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Browser, BrowserContext, Page

from server.store import admins
from server.web.passwords import hashed
from tests.support.browser.game_page import DESKTOP, draw_less_often
from tests.support.browser.single_input import KeyboardOnly, take_part
from tests.support.guide_machine import free_port
from tests.support.live_server import LiveServer
from tests.support.real_server import SHORT_STUDY

pytestmark = [pytest.mark.browser, pytest.mark.timeout(280)]
ROOT = "/kitchen"
PASSWORD = "a password of this test"
STUDY = SHORT_STUDY.replace("horizon: 60", "horizon: 25")


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    port = free_port()
    address = f"http://127.0.0.1:{port}{ROOT}"
    with LiveServer(tmp_path_factory.mktemp("path"), 4.0, STUDY, port=port, public_url=address) as running:
        yield running


class WatchedPaths:
    """A browser that records its requests."""

    def __init__(self, chromium: Browser) -> None:
        self.context: BrowserContext = draw_less_often(
            chromium.new_context(viewport=DESKTOP, locale="en-GB", reduced_motion="reduce")
        )
        self.asked: list[str] = []
        self.failed: list[str] = []
        self.context.on("request", lambda request: self.asked.append(request.url))
        self.context.on("response", lambda answer: self._look(answer.status, answer.url))

    def page(self) -> Page:
        page = self.context.new_page()
        page.on("websocket", lambda socket: self.asked.append(socket.url))
        page.on("pageerror", lambda error: self.failed.append(str(error)))
        return page

    def _look(self, status: int, url: str) -> None:
        if status >= 400:
            self.failed.append(f"{status} {url}")

    @property
    def outside(self) -> list[str]:
        """What was asked for outside of the path."""
        ours = [urlsplit(url) for url in self.asked if not url.startswith(("data:", "blob:"))]
        assert ours
        return [url.geturl() for url in ours if not url.path.startswith(f"{ROOT}/") and url.path != ROOT]


@pytest.mark.slow
def test_participants_stay_below_the_path_and_cookies_go_nowhere_else(chromium: Browser, server: LiveServer) -> None:
    browser = WatchedPaths(chromium)
    page = browser.page()
    page.goto(f"{server.url}{ROOT}")
    page.click(f"a[href^='{ROOT}/s/short']")
    titles = take_part(KeyboardOnly(page), page.url)
    assert titles[-1] == "Thank you for cooking with us"
    assert {cookie.get("path") for cookie in browser.context.cookies()} == {f"{ROOT}/s/short"}
    assert browser.failed == []
    assert browser.outside == []
    assert any(urlsplit(url).scheme == "ws" for url in browser.asked)
    browser.context.close()


@pytest.mark.slow
def test_researchers_stay_below_the_path(chromium: Browser, server: LiveServer) -> None:
    database = server.app.state.services.web.database
    database.write_now(admins.create, "mara", hashed(PASSWORD), "own")
    browser = WatchedPaths(chromium)
    page = browser.page()
    page.goto(f"{server.url}{ROOT}/admin/s/short")
    page.fill("[name=name]", "mara")
    page.fill("[name=password]", PASSWORD)
    page.click("form button")
    page.wait_for_url(f"**{ROOT}/admin/s/short")
    page.wait_for_selector("#board, main")
    page.click("nav a:text-is('Audit')")
    page.click("a.brand")
    page.click(f"a[href='{ROOT}/admin/s/short']")
    page.click("nav a:text-is('Games')")
    page.click(f"a[href^='{ROOT}/admin/s/short/game/']")
    page.wait_for_selector("#kitchen")
    page.click("text=Sign out")
    page.wait_for_url(f"**{ROOT}/admin/login")
    assert browser.failed == []
    assert browser.outside == []
    browser.context.close()


@pytest.mark.slow
def test_viewers_stay_below_the_path(chromium: Browser, server: LiveServer) -> None:
    browser = WatchedPaths(chromium)
    page = browser.page()
    page.goto(f"{server.url}{ROOT}/watch")
    page.wait_for_load_state("networkidle")
    assert browser.failed == []
    assert browser.outside == []
    browser.context.close()
