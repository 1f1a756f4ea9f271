"""Leaving in the middle of a game: no data of the person remain, and nothing keeps running."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser
from sqlalchemy import text as sql

from server.store.database import Database
from server.store.tables import metadata
from tests.e2e.test_game_browser_real import go_to_game, study
from tests.support.browser.browser_cook import BrowserCook
from tests.support.browser.game_page import DESKTOP, PHONE, draw_less_often, screenshot
from tests.support.live_server import LiveServer

pytestmark = [pytest.mark.browser, pytest.mark.timeout(240)]
# Tables without personal data: arrivals count opened links, a tombstone is the salted hash of a random id, the audit
# log and its head name researchers only.
KEPT = {"studies", "withdrawals", "tombstones", "audit", "audit_head", "arrivals"}


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    text = study(400, ("flow: [introduction, tutorial, episodes, thanks]", "flow: [episodes, thanks]"))
    with LiveServer(tmp_path_factory.mktemp("left"), speed=4.0, study=text) as running:
        yield running


def rows(server: LiveServer) -> dict[str, int]:
    def count(connection):  # type: ignore[no-untyped-def]
        tables = [table.name for table in metadata.sorted_tables]
        return {name: connection.execute(sql(f"select count(*) from {name}")).scalar() for name in tables}

    with Database(server.database, read_only=True) as database:
        return {name: number for name, number in database.read_now(count).items() if number and name not in KEPT}


def test_leaving_in_the_middle_of_a_game_leaves_no_data_behind(
    chromium: Browser, server: LiveServer, caplog: pytest.LogCaptureFixture
) -> None:
    context = chromium.new_context(viewport=PHONE, has_touch=True, reduced_motion="reduce")
    page = draw_less_often(context).new_page()
    cook = BrowserCook(page)
    go_to_game(page, server)
    cook.play(until_timestep=10)
    second = context.new_page()
    second.goto(f"{server.url}/s/short/withdraw")
    screenshot(second, "withdraw-phone")
    page.bring_to_front()
    assert rows(server)["ticks"] > 5
    second.click(".danger")
    assert second.locator("h1").inner_text() == "Your data have been deleted"
    page.wait_for_selector("#over:visible, #closed:visible")
    assert rows(server) == {}
    second.goto(f"{server.url}/s/short/now")
    assert second.url.endswith("/s/short"), "a new visitor again"
    context.close()
    assert "Traceback" not in caplog.text
    assert "could not be stored" not in caplog.text


def test_leaving_the_study_is_possible_from_the_game_and_needs_confirmation(
    chromium: Browser, server: LiveServer
) -> None:
    page = draw_less_often(chromium.new_context(viewport=DESKTOP, reduced_motion="reduce")).new_page()
    cook = BrowserCook(page)
    go_to_game(page, server)
    cook.play(until_timestep=6)
    page.click("#leave")
    page.get_by_role("link", name="No, go back to the study").click()
    page.wait_for_selector("#start:visible")
    assert page.inner_text("#start-title") == "Welcome back"
    assert int(page.get_attribute(".game", "data-timestep") or 0) >= 6
    page.context.close()
