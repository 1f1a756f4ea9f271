"""Two agents are watched in a real browser, with the marks of either; nothing of it is stored."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser
from sqlalchemy import func, select

from server.store.database import Database
from server.store.tables import episodes, participants
from tests.support.browser.browser_cook import BrowserCook
from tests.support.browser.game_page import DESKTOP, PHONE, draw_less_often, screenshot
from tests.support.live_server import LiveServer
from tests.support.parameters import mostly_slow
from tests.support.real_server import SHORT_STUDY

pytestmark = [pytest.mark.browser, pytest.mark.timeout(240)]


STUDY = SHORT_STUDY.replace("predictor: sp_predictor_stream}", "predictor: random}")


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    with LiveServer(tmp_path_factory.mktemp("watch"), speed=4.0, study=STUDY) as running:
        yield running


@pytest.mark.parametrize(
    ("viewport", "marks"), mostly_slow([(DESKTOP, 1), (PHONE, 0)]), ids=["desktop-green", "phone-blue"]
)
@pytest.mark.slow
def test_two_agents_cook_for_a_viewer(
    chromium: Browser, server: LiveServer, viewport: dict[str, int], marks: int
) -> None:
    context = chromium.new_context(viewport=viewport, reduced_motion="reduce")  # type: ignore[arg-type]
    page = draw_less_often(context).new_page()
    seen = BrowserCook(page)
    page.goto(server.url)
    page.click("a[href^='/watch']")
    screenshot(page, f"watch-choose-{viewport['width']}")
    page.locator("select[name=marks]").first.select_option(str(marks))
    page.locator(".watch .btn").first.click()
    page.click("#start-button")
    page.wait_for_selector("[data-phase=playing]")
    page.wait_for_function("() => Number(document.querySelector('.game').dataset.timestep) >= 30")
    screenshot(page, f"watch-game-{viewport['width']}")
    assert not page.is_visible(".touch")
    assert page.inner_text("#round") == "Two AI chefs are cooking"
    assert any(action != 6 for prediction in seen.predictions for action, _ in prediction)
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    context.close()
    with Database(server.database, read_only=True) as database:
        for table in (episodes, participants):
            count = select(func.count()).select_from(table)
            assert database.read_now(lambda connection, count=count: connection.execute(count).scalar()) == 0
