"""Two people in two real browsers: the waiting room, the round together, and what happens if no partner arrives."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page
from sqlalchemy import select

from server.store.database import Database
from server.store.tables import episodes
from tests.e2e.test_game_browser_real import fill_and_leave
from tests.support.browser.browser_cook import BrowserCook
from tests.support.browser.game_page import DESKTOP, at_rest, draw_less_often, screenshot
from tests.support.live_server import LiveServer
from tests.support.real_server import SHORT_STUDY

pytestmark = [pytest.mark.browser, pytest.mark.timeout(240)]
PHONE = {"width": 390, "height": 844}
STUDY = (
    SHORT_STUDY.replace(
        "[{name: planner, predictor: sp_predictor_stream}]", "[{name: person, human: true, predictor: random}]"
    )
    .replace("horizon: 60", "horizon: 60, pause: {each_s: 60, episode_s: 240}")
    .replace("flow: [introduction, tutorial, episodes, thanks]", "flow: [introduction, episodes, thanks]")
    .replace(", {name: random, predictor: random}, {name: none, predictor: none}", "")
    + "waiting_room: {limit_s: 80}\n"
)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    with LiveServer(tmp_path_factory.mktemp("two"), speed=4.0, study=STUDY) as running:
        yield running


@pytest.fixture
def impatient(tmp_path: Path) -> Iterator[LiveServer]:
    """One where nobody waits for long."""
    with LiveServer(tmp_path, speed=4.0, study=STUDY.replace("limit_s: 80", "limit_s: 12")) as running:
        yield running


@contextmanager
def visitor(chromium: Browser, width_and_height: dict[str, int]) -> Iterator[Page]:
    context = chromium.new_context(
        viewport=width_and_height, has_touch=width_and_height is PHONE, reduced_motion="reduce"
    )  # type: ignore[arg-type]
    context.set_default_timeout(30_000)
    yield draw_less_often(context).new_page()
    context.close()


def to_the_game(page: Page, server: LiveServer) -> None:
    if page.url == "about:blank":
        page.goto(f"{server.url}/s/short")
    while not page.locator("#game-config").count():
        fill_and_leave(page)


def test_two_browsers_wait_meet_cook_and_each_sees_itself_in_blue(chromium: Browser, server: LiveServer) -> None:
    with visitor(chromium, DESKTOP) as one, visitor(chromium, PHONE) as two:
        cooks = BrowserCook(one), BrowserCook(two)
        to_the_game(one, server)
        one.wait_for_selector("#pause:visible")
        assert not one.is_visible("#partner")
        assert one.inner_text("#pause-title") == "Waiting for the other player"
        assert "seconds" in one.inner_text("#pause-left")
        at_rest(one)  # it has faded in
        screenshot(one, "two-waiting-room")
        to_the_game(two, server)
        for page in (one, two):
            page.bring_to_front()
            page.wait_for_selector("[data-link=open]:not([data-phase=room])")
            if page.is_visible("#start-button"):
                page.click("#start-button")
        one.wait_for_selector("[data-phase=playing]")
        two.wait_for_selector("[data-phase=playing]")
        assert one.inner_text("#partner") == "Another participant"
        screenshot(one, "two-playing")
        screenshot(two, "two-playing-phone")
        assert cooks[0].episode == cooks[1].episode


@pytest.mark.slow
def test_without_a_partner_a_participant_is_informed_that_an_agent_replaces_it(
    chromium: Browser, impatient: LiveServer
) -> None:
    with visitor(chromium, DESKTOP) as page:
        to_the_game(page, impatient)
        page.wait_for_selector("#pause:visible")
        page.wait_for_selector("#start:visible")
        assert page.inner_text("#start-title") == "An AI chef steps in"
        screenshot(page, "two-alone")
        page.click("#start-button")
        page.wait_for_selector("[data-phase=playing]")
        assert page.inner_text("#partner") == "AI chef"
    with Database(impatient.database, read_only=True) as database:
        seats = database.read_now(lambda connection: connection.execute(select(episodes.c.agent_1)).scalars().all())
    assert seats == ["planner"]
