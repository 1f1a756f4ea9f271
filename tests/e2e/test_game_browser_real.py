"""The game's page against the real server: a participant in a real browser, from the first page to the code."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect

from server.store.database import Database
from server.store.tables import episodes, events, ticks
from tests.support import command_line
from tests.support.browser.browser_cook import BrowserCook
from tests.support.browser.game_page import DESKTOP, draw_less_often, screenshot
from tests.support.live_server import LiveServer
from tests.support.real_server import SHORT_STUDY, RealServer

pytestmark = [pytest.mark.browser, pytest.mark.timeout(240)]
# A thousand strokes within some seconds, quicker than any hand, as the server's clock runs quicker too.
HAMMER = """async () => {
  for (let stroke = 0; stroke < 1000; stroke++) {
    const code = ['ArrowLeft', 'ArrowUp', 'Space'][stroke % 3];
    for (const kind of ['keydown', 'keyup']) document.dispatchEvent(new KeyboardEvent(kind, {code, bubbles: true}));
    await new Promise((done) => setTimeout(done, 1));
  }
}"""
AWAY = {"hidden", "blur", "lost", "other_tab"}


def study(horizon: int, *changes: tuple[str, str]) -> str:
    """One kitchen, one arm, one question; the tutorial only where the flow has it."""
    arms = SHORT_STUDY.partition("conditions: ")[2].partition("\n")[0]
    text = SHORT_STUDY.replace(arms, "[{name: tom, predictor: tom}]")
    text = text.replace(", {name: matrix, title: {en: Matrix}}", "")
    # The pause limits run on the quick clock too.
    game = f"horizon: {horizon}, pause: {{each_s: 300, episode_s: 3600}}"
    text = text.replace("horizon: 60", game)
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RealServer]:
    with RealServer(tmp_path_factory.mktemp("quick"), speed=4.0, study=study(60)) as running:
        yield running


@pytest.fixture
def visitor(chromium: Browser) -> Iterator[BrowserContext]:
    context = chromium.new_context(viewport=DESKTOP)
    context.set_default_timeout(30_000)
    yield draw_less_often(context)
    context.close()


def in_order(timesteps: list[int]) -> bool:
    """Never back. A state may be shown again after a pause, and a slow reader is spared states that are old already."""
    return timesteps == sorted(timesteps)


def fill_and_leave(page: Page) -> None:
    """Press the one button that leads on from a page that is not a game, everything filled in."""
    for box in page.locator("main input[type=checkbox]").all():
        box.check()
    for choice in page.locator("main input[type=radio][value='4']").all():
        choice.check(force=True)
    with page.expect_navigation():
        if page.locator("#next").count():
            while page.is_visible("#next"):
                page.click("#next")
            page.click("#finish")
        else:
            page.locator("main .btn:not(.quiet):visible").first.click()


def go_to_game(page: Page, server: RealServer | LiveServer) -> None:
    """From the consent page to the next game."""
    if page.url == "about:blank":
        page.goto(f"{server.url}/s/short")
    while not page.locator("#game-config").count():
        fill_and_leave(page)
    page.wait_for_selector("[data-link=open]")


def test_a_person_learns_the_game_plays_a_round_and_gets_the_code(visitor: BrowserContext, server: RealServer) -> None:
    page = visitor.new_page()
    cook = BrowserCook(page)
    go_to_game(page, server)
    page.click("#start-button")
    cook.play(until_timestep=40)
    screenshot(page, "real-tutorial")
    cook.play()
    assert cook.ended[-1].passed
    shown = [step for step in cook.predictions if step[0][0] < 6]
    assert shown, "the guide's marks were shown"
    page.wait_for_selector("#over:visible")
    assert page.locator(".todo .done").count() == page.locator(".todo li").count()
    page.wait_for_function("() => document.activeElement.id === 'over-next'")
    with page.expect_navigation():
        page.keyboard.press("Enter")
    go_to_game(page, server)
    cook.play()
    assert in_order(cook.timesteps)
    assert cook.timesteps[-1] == 60, "it started by itself: start was pressed before"
    assert page.inner_text("#time") == "0:00"
    assert page.inner_text("#over-score") == str(cook.ended[-1].score)
    page.wait_for_function("() => document.activeElement.id === 'over-next'")
    page.click("#over-next")
    while not page.locator("output#code").count():
        fill_and_leave(page)
    assert not set(cook.paused) & AWAY


@pytest.mark.slow
def test_rapid_key_presses_do_not_disconnect_a_participant(visitor: BrowserContext, server: RealServer) -> None:
    page = visitor.new_page()
    go_to_game(page, server)
    page.click("#start-button")
    page.wait_for_selector("[data-phase=playing]")
    before = int(page.get_attribute(".game", "data-timestep") or 0)
    page.evaluate(HAMMER)
    assert page.get_attribute(".game", "data-link") == "open"
    page.wait_for_function("(t) => Number(document.querySelector('.game').dataset.timestep) > t", arg=before)
    assert page.is_visible(".game"), "the game continues"


def test_a_reload_and_a_second_tab_continue_at_the_same_timestep(visitor: BrowserContext, server: RealServer) -> None:
    page = visitor.new_page()
    cook = BrowserCook(page)
    go_to_game(page, server)
    page.click("#start-button")
    cook.play(until_timestep=12)
    page.reload()
    page.wait_for_selector("#start:visible")
    assert page.inner_text("#start-title") == "Welcome back"
    reached = int(page.get_attribute(".game", "data-timestep") or 0)
    assert reached >= 12
    page.click("#start-button")
    cook.play(until_timestep=reached + 6)

    second = visitor.new_page()
    cook_there = BrowserCook(second)
    second.goto(f"{server.url}/s/short/now")
    page.wait_for_selector("#other:visible")
    second.wait_for_selector("#pause:visible")
    assert cook_there.paused[0] == "other_tab"
    second.click("#pause-button")
    cook_there.play(until_timestep=reached + 20)
    together = cook.timesteps + cook_there.timesteps
    assert in_order(together), "the game continues where it stood, in whichever tab"
    second.close()
    page.click("#other-here")
    expect(page.locator(".game")).to_have_attribute("data-phase", "playing")


def test_leaving_the_page_pauses_and_returning_resumes(visitor: BrowserContext, server: RealServer) -> None:
    page = visitor.new_page()
    cook = BrowserCook(page)
    go_to_game(page, server)
    page.click("#start-button")
    cook.play(until_timestep=8)
    page.evaluate("window.dispatchEvent(new Event('blur'))")
    page.wait_for_selector("#pause:visible")
    assert cook.paused == ["blur"]
    stood = cook.timesteps[-1]
    page.wait_for_timeout(200)  # four timesteps of this server: none may come
    assert cook.timesteps[-1] == stood
    page.click("#pause-button")
    page.wait_for_selector("#count:visible")
    cook.play(until_timestep=stood + 5)
    assert in_order(cook.timesteps)
    assert stood in cook.timesteps[:-1]


def test_an_error_on_the_page_is_kept_for_the_researcher(visitor: BrowserContext, server: RealServer) -> None:
    page = visitor.new_page()
    go_to_game(page, server)
    page.evaluate(
        "dispatchEvent(new ErrorEvent('error', {message: 'smoke', error: new Error('smoke in the kitchen')}))"
    )
    for _ in range(100):
        with Database(server.database, read_only=True) as database:
            rows = database.read_now(lambda connection: connection.execute(events.select()).all())
        if any("smoke in the kitchen" in str(row.detail) for row in rows):
            return
        page.wait_for_timeout(50)
    raise AssertionError("the problem did not reach the database")


@pytest.mark.slow
@pytest.mark.parametrize("horizon", [40, 400])
def test_a_round_at_five_ticks_a_second(
    visitor: BrowserContext, tmp_path_factory: pytest.TempPathFactory, horizon: int
) -> None:
    text = study(horizon, ("flow: [introduction, tutorial, episodes, thanks]", "flow: [episodes, thanks]"))
    kind = RealServer if horizon == 400 else LiveServer
    with kind(tmp_path_factory.mktemp("full"), speed=1.0, study=text) as server:
        page = visitor.new_page()
        cook = BrowserCook(page)
        go_to_game(page, server)
        cook.play(until_timestep=horizon // 2, seconds=100)
        screenshot(page, "real-round")
        cook.play(seconds=100)
        assert in_order(cook.timesteps)
        assert cook.timesteps[-1] == horizon
        assert not set(cook.paused) & AWAY
        assert cook.ended[-1].score >= (20 if horizon == 400 else 0)
        page.wait_for_selector("#over:visible")
        screenshot(page, "real-round-over")
        with Database(server.database, read_only=True) as database:
            (row,) = database.read_now(lambda connection: connection.execute(episodes.select()).all())
            stored = database.read_now(lambda connection: len(connection.execute(ticks.select()).all()))
        assert (row.status, row.score) == ("done", cook.ended[-1].score)
        assert stored == horizon + 1
        assert command_line.run("verify", "--database", server.database).returncode == 0


def test_a_page_whose_cookie_does_not_count_any_more_leads_to_the_first_page(
    visitor: BrowserContext, server: RealServer
) -> None:
    """As after the recruiter's link was opened on another device."""
    page = visitor.new_page()
    go_to_game(page, server)
    visitor.clear_cookies()
    page.evaluate("window.dispatchEvent(new Event('offline')); window.dispatchEvent(new Event('online'))")
    page.wait_for_url(server.url + "/s/short")
