"""A browser that cannot run the game shows this before consent; one that only lacks optional features plays."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from server.play.messages import Lesson
from server.settings import ROOT
from server.store import arrivals
from tests.support.browser.fake_game_server import NONE, PRACTICE, FakeGameServer, kitchen, tick, welcome
from tests.support.browser.game_page import DESKTOP, opened, screenshot, start
from tests.support.page_site import SMALL_STUDY, PageSite

pytestmark = [pytest.mark.browser, pytest.mark.timeout(180)]
STATIC = ROOT / "static" / "js"
STUDY = SMALL_STUDY.replace("seed: 11\n", "seed: 11\nrecruitment: {screened_out: {code: KM-DEVICE}}\n")
# The study file turns these checks off, but the game needs them anyway.
UNCHECKED = STUDY.replace("name: small", "name: unchecked").replace(
    "seed: 11\n", "seed: 11\nentry: {websocket: false, latency_ms: }\n"
)

# Features that the game needs.
NEEDED = (
    "window.ResizeObserver",
    "window.Path2D",
    "window.PointerEvent",
    "HTMLDialogElement.prototype.showModal",
    "HTMLImageElement.prototype.decode",
    "Element.prototype.replaceChildren",
    "Array.prototype.flatMap",
    "Object.fromEntries",
    "CanvasRenderingContext2D.prototype.arcTo",
    "Crypto.prototype.getRandomValues",
    "window.matchMedia",
    "window.URLSearchParams",
    "window.WebSocket",
    "Element.prototype.closest",
    "Array.from",
    "DOMTokenList.prototype.toggle",
    "Document.prototype.hasFocus",
)
# Features of browsers after 2021.
YOUNG = (
    *(f"Array.prototype.{name}" for name in ("findLast", "findLastIndex", "toSorted", "toReversed", "with", "at")),
    *("String.prototype.replaceAll", "String.prototype.at", "Object.hasOwn", "Object.groupBy", "Map.groupBy"),
    *("window.structuredClone", "URLSearchParams.prototype.size", "CanvasRenderingContext2D.prototype.roundRect"),
    *("Navigator.prototype.keyboard", "Navigator.prototype.userActivation", "Element.prototype.checkVisibility"),
    *("Promise.withResolvers", "AbortSignal.timeout", "Set.prototype.union", "Crypto.prototype.randomUUID"),
)


def without(*names: str) -> str:
    return "".join(f"delete {name};" for name in names)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageSite]:
    with PageSite(tmp_path_factory.mktemp("old"), STUDY, UNCHECKED) as running:
        yield running


@pytest.fixture
def page(chromium: Browser) -> Iterator[Page]:
    context = chromium.new_context(viewport=DESKTOP, locale="en-GB")  # type: ignore[arg-type]
    yield context.new_page()
    context.close()


def turned_away(site: PageSite) -> int:
    return counted(site, ("unsuitable", "browser"))


def counted(site: PageSite, kind: tuple[str, str]) -> int:
    found = site.studies.open("small")
    assert found is not None
    return site.database.read_now(arrivals.of_study, [found[0]]).get(kind, 0)


def is_refused(page: Page, words: str) -> None:
    expect(page.locator("#entry")).to_have_attribute("data-state", "bad")
    expect(page.locator("#entry-faults")).to_contain_text(words)
    expect(page.locator("#agree")).to_be_hidden()
    expect(page.locator("#unsuitable")).to_be_visible()


def test_a_browser_without_what_the_game_needs_is_turned_away_before_consent(site: PageSite, chromium: Browser) -> None:
    context = chromium.new_context(viewport=DESKTOP, locale="en-GB")  # type: ignore[arg-type]
    page = context.new_page()
    lost = ", ".join(f"'{missing}': () => delete {missing}" for missing in NEEDED)
    page.add_init_script(f"({{{lost}}})[window.name]?.()")  # a reload keeps the name
    page.goto(f"{site.url}/s/unchecked")
    for missing in NEEDED:
        page.evaluate("name => { window.name = name; }", missing)
        page.reload()
        is_refused(page, "This browser is too old for the game")
        if missing == NEEDED[0]:
            screenshot(page, "entry-old-browser")
    context.close()
    assert site.everybody("unchecked") == []


def test_a_browser_that_refuses_beacons_is_checked_and_counted_all_the_same(site: PageSite, page: Page) -> None:
    before = counted(site, ("opened", ""))
    page.add_init_script(without("Navigator.prototype.sendBeacon"))  # Firefox with `beacon.enabled` off
    with page.expect_response("**/arrivals"):
        page.goto(f"{site.url}/s/small")
    expect(page.locator("#agree")).to_be_enabled()
    assert counted(site, ("opened", "")) == before + 1


def test_a_browser_without_cookies_is_turned_away_before_consent(site: PageSite, page: Page) -> None:
    page.add_init_script("Object.defineProperty(Navigator.prototype, 'cookieEnabled', { get: () => false })")
    page.goto(f"{site.url}/s/small")
    is_refused(page, "does not keep cookies")


def test_a_browser_that_cannot_read_the_scripts_is_counted_and_shows_why(site: PageSite, page: Page) -> None:
    before = turned_away(site)
    page.route(
        "**/device-check.js", lambda route: route.fulfill(body="syntax of tomorrow", content_type="text/javascript")
    )
    with page.expect_response(lambda answer: "kind=unsuitable" in str(answer.request.post_data)):
        page.goto(f"{site.url}/s/small")
    expect(page.locator("#cannot-run")).to_contain_text("This browser is too old for the game")
    expect(page.locator("#agree")).to_be_hidden()
    expect(page.locator("#unsuitable")).to_be_visible()
    assert turned_away(site) == before + 1


def test_a_game_that_cannot_be_read_is_reported(chromium: Browser, server: FakeGameServer) -> None:
    context = chromium.new_context(viewport=DESKTOP)  # type: ignore[arg-type]
    page = context.new_page()
    page.route("**/game.js", lambda route: route.fulfill(body="syntax of tomorrow", content_type="text/javascript"))
    page.goto(server.url)
    expect(page.locator("#cannot-run")).to_contain_text("The game cannot start in this browser.")
    context.close()


def test_a_game_whose_drawings_do_not_load_shows_a_message(chromium: Browser, server: FakeGameServer) -> None:
    context = chromium.new_context(viewport=DESKTOP)  # type: ignore[arg-type]
    page = context.new_page()
    page.route("**/item-soup.svg", lambda route: route.abort())
    page.goto(server.url)
    expect(page.locator("#cannot-run")).to_be_visible()
    screenshot(page, "game-cannot-run")
    context.close()


def test_a_browser_of_2022_passes_the_check(site: PageSite, page: Page) -> None:
    page.add_init_script(without(*YOUNG))
    page.goto(f"{site.url}/s/small")
    expect(page.locator("#agree")).to_be_enabled()


@pytest.mark.slow
def test_a_browser_of_2022_plays(chromium: Browser, server: FakeGameServer) -> None:
    server.welcome = welcome(kind="tutorial", endless=True, horizon=0, grid=PRACTICE)
    with opened(chromium, server, viewport=DESKTOP) as page:
        page.add_init_script(without(*YOUNG))
        page.reload()
        start(page, server)
        for number, lesson in enumerate(("walk", "fetch", "fill", "wait", "plate", "deliver", "marks")):
            server.send(Lesson(lesson, number, 7, False), tick(kitchen(t=2 + number), NONE))
            page.wait_for_selector(f"[data-timestep='{2 + number}']")
        page.keyboard.down("ArrowUp")
        page.keyboard.up("ArrowUp")
        server.wait_for(lambda server: len(server.inputs()) >= 2)
        assert [(each.held, each.tap) for each in server.inputs()] == [(0, 0), (None, None)]


def test_the_self_test_loads_every_module_of_the_game() -> None:
    def imported(file: Path, seen: set[Path]) -> set[Path]:
        for other in re.findall(r"from '(\.{1,2}/[\w./-]+\.js)'", file.read_text(encoding="utf-8")):
            module = (file.parent / other).resolve()
            if module not in seen:
                seen.add(module)
                imported(module, seen)
        return seen

    of_the_game = imported(STATIC / "game" / "game.js", set())
    assert STATIC / "board" / "renderer.js" in of_the_game
    assert of_the_game <= imported(STATIC / "pages" / "game-self-test.js", set())
