"""Messages during a game do not cover what matters: the researcher's messages and the tutorial's bubble."""

from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from server.play.messages import Lesson, Notice
from tests.e2e.test_game_browser_looks import lesson_page
from tests.support.browser.fake_game_server import FakeGameServer, kitchen, tick
from tests.support.browser.game_page import DESKTOP, opened, screenshot, start, violations
from tests.support.parameters import mostly_slow

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]
TOUCH = {"has_touch": True, "is_mobile": True}
SCREENS: dict[str, dict[str, Any]] = {
    "laptop": {"viewport": {"width": 1366, "height": 768}},
    "portrait": {"viewport": {"width": 390, "height": 844}, **TOUCH},
    "landscape": {"viewport": {"width": 844, "height": 390}, **TOUCH},
}
LONG = "Please finish this round. Then wait in the room: somebody comes to you and starts the second part. " * 3


def box(page: Page, what: str) -> dict[str, float]:
    found = page.locator(what).bounding_box()
    assert found is not None
    return dict(found)


def overlap(one: dict[str, float], other: dict[str, float]) -> bool:
    across = one["x"] < other["x"] + other["width"] and other["x"] < one["x"] + one["width"]
    return across and one["y"] < other["y"] + other["height"] and other["y"] < one["y"] + one["height"]


@pytest.mark.parametrize("screen", mostly_slow(SCREENS))
def test_a_message_of_the_researcher_covers_no_station(chromium: Browser, server: FakeGameServer, screen: str) -> None:
    with opened(chromium, server, **SCREENS[screen]) as page:
        start(page, server)
        for words in ("Lunch at noon.", LONG):
            server.send(Notice(words))
            expect(page.locator("#urgent")).to_have_text(words.strip())
            page.wait_for_selector("#notice:visible")
            screenshot(page, f"notice-{screen}-{len(words)}")
            notice = box(page, "#notice")
            assert not overlap(notice, box(page, "canvas.board")), words
            assert notice["y"] >= 0
            assert notice["height"] >= 30
            assert overlap(box(page, "#notice button"), notice), "it can be closed"
            assert violations(page) == []
            page.click("#notice button")
            page.wait_for_selector("#notice", state="hidden")


def test_without_room_above_the_board_a_message_goes_to_its_side(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server, viewport={"width": 1000, "height": 540}) as page:
        start(page, server)
        page.evaluate("document.querySelector('canvas.board').style.cssText += 'position: fixed; top: 0; left: 0'")
        server.send(Notice(LONG))
        page.wait_for_selector("#notice.at-side:visible")
        notice = box(page, "#notice")
        assert not overlap(notice, box(page, "canvas.board"))
        assert notice["x"] + notice["width"] <= 1000
        assert overlap(box(page, "#notice button"), notice), "it can be closed"


NOTICE_ALONE = """async () => {
  document.body.innerHTML = '<main tabindex="-1"></main><div id="notice" hidden><p></p><button>Close</button></div>';
  const { ResearcherNotice } = await import(location.href);
  const [stage, box] = [document.querySelector('main'), document.querySelector('#notice')];
  new ResearcherNotice(box, stage, () => {}, () => {}).show('Lunch.');
}"""


def test_a_message_leaves_by_itself_once_it_was_read(chromium: Browser, server: FakeGameServer) -> None:
    """By itself, without a game: one that hears nothing for so long connects again, and its dialog takes the focus."""
    with opened(chromium, server, viewport=DESKTOP) as page:
        game = page.evaluate("[...document.scripts].find((one) => one.src.includes('game.js')).src")
        page.goto(game.replace("game.js", "notice.js"))
        reading = "async (words) => (await import(location.href)).readingMs(words)"
        short, longer, chinese = (page.evaluate(reading, words) for words in ("Lunch.", "a" * 400, "请" * 100))
        assert (short, longer, chinese) == (10_000, 41_000, 40_000)
        page.clock.install(time=0)
        page.clock.pause_at(60_000)  # from here on time passes only as the test says
        page.evaluate(NOTICE_ALONE)
        page.clock.run_for(short - 100)
        assert page.is_visible("#notice")
        page.focus("#notice button")  # somebody who is about to close it is not hurried
        page.clock.run_for(5000)
        assert page.is_visible("#notice")
        page.focus("main")
        page.clock.run_for(5000)
        assert page.is_hidden("#notice")


@pytest.mark.parametrize("screen", mostly_slow(SCREENS))
def test_the_lesson_on_marks_leaves_the_marks_in_sight(chromium: Browser, server: FakeGameServer, screen: str) -> None:
    lesson_page(server)
    with opened(chromium, server, **SCREENS[screen]) as page:
        state = kitchen(t=1, players=((2, 2, 3, 0), (5, 3, 0, 0)))
        start(page, server, state)
        server.send(Lesson("marks", 6, 7, False), tick(state, ((0, 95), (0, 80), (0, 60))))
        expect(page.locator("#lessons .now")).to_contain_text("Read a green mark")
        gliding = "document.querySelector('#coach').getAnimations().length"
        page.wait_for_function(
            f"() => document.querySelector('#coach').dataset.side && {gliding} === 0 || innerWidth < 500"
        )
        screenshot(page, f"lesson-marks-{screen}")
        if screen == "portrait":
            assert page.is_hidden("#coach"), "the explanation stands below the board"
            return
        board, bubble = box(page, "canvas.board"), box(page, "#coach")
        side = board["width"] / 7
        for column, row in ((5, 1), (5, 2), (5, 3)):  # the marks lead up from the chef
            cell = {"x": board["x"] + column * side, "y": board["y"] + row * side, "width": side, "height": side}
            assert not overlap(bubble, cell), (column, row)


@pytest.mark.parametrize("language", mostly_slow(["en", "zh"]))
@pytest.mark.parametrize("size", [(1366, 768), (1024, 600), (844, 390), (667, 375)], ids=lambda size: str(size[0]))
def test_no_lesson_covers_a_pot_or_the_own_chef(
    chromium: Browser, server: FakeGameServer, size: tuple[int, int], language: str
) -> None:
    lesson_page(server, language=language)
    touch = TOUCH if size[0] < 1000 else {}
    at_once: dict[str, Any] = {"reduced_motion": "reduce"}  # a bubble that glides ends up in the same place
    with opened(chromium, server, viewport={"width": size[0], "height": size[1]}, **touch, **at_once) as page:
        start(page, server, kitchen(t=1, players=((2, 2, 3, 0), (5, 3, 0, 0))))
        for number, lesson in enumerate(server.page["lessons"]):
            server.send(Lesson(lesson, number, 7, False))
            page.wait_for_function(f"() => document.querySelectorAll('.todo .done').length === {number}")
            page.wait_for_function("() => document.querySelector('#coach').getAnimations().length === 0")
            board, bubble = box(page, "canvas.board"), box(page, "#coach")
            side = board["width"] / 7
            for column, row in ((2, 0), (2, 2)):
                cell = {"x": board["x"] + column * side, "y": board["y"] + row * side, "width": side, "height": side}
                assert not overlap(bubble, cell), (lesson, column, row)
