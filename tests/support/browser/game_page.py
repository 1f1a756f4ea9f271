"""The game's page in a browser, as the tests handle it: open, start, look at pixels."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, BrowserContext, Page

from server.play.messages import ClientError, Countdown, KitchenState, Ready
from tests.support.browser.fake_game_server import FakeGameServer, kitchen, tick

SCREENSHOTS = Path(__file__).resolve().parents[3] / "screenshots"
WANTS_PICTURES = bool(os.environ.get("SCREENSHOTS"))  # for people to look at: they take a tenth of the browser's time
DESKTOP = {"width": 1366, "height": 768}
PHONE = {"width": 390, "height": 844}


@contextmanager
def opened(chromium: Browser, server: FakeGameServer, in_full: bool = False, **context: Any) -> Iterator[Page]:
    """The game's page, opened again: for a visitor of its own where `context` says something of them, else for the one
    whom the tests of a module share. It draws less often unless `in_full`. Errors on the page fail the test."""
    if in_full or context:
        visitor = chromium.new_context(**{"viewport": DESKTOP, **context})
        if not in_full:
            draw_less_often(visitor)
    else:
        visitor = shared(chromium, server)
    page = visitor.new_page()
    page.set_default_timeout(30_000)
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", lambda message: errors.append(message.text) if "Content Security" in message.text else None)
    try:
        page.goto(server.url)
        yield page
        assert not errors, errors
    finally:
        if in_full or context:
            visitor.close()
        else:
            page.close()


def shared(chromium: Browser, server: FakeGameServer) -> BrowserContext:
    """The visitor who has the scripts and drawings already."""
    if server.visitor is None:
        server.visitor = draw_less_often(chromium.new_context(viewport=DESKTOP))
    visitor: BrowserContext = server.visitor
    return visitor


def draw_less_often(context: BrowserContext) -> BrowserContext:
    """Let the pages of this context draw some 15 times a second and not 60; return the context.

    For tests that look at what a participant reaches and not at how it moves: without a graphics card a picture takes
    20 to 40 ms of a processor, so one running game takes all of it.
    """
    context.add_init_script(
        """(() => {
          const soon = window.requestAnimationFrame.bind(window);
          window.requestAnimationFrame = (callback) => setTimeout(() => soon(callback), 50);
        })();"""
    )
    return context


def start(page: Page, server: FakeGameServer, state: KitchenState | None = None, **more: Any) -> None:
    """Press start; the game runs from `state` on."""
    page.wait_for_selector("[data-phase=ready]")
    page.click("#start-button")
    server.wait_for(lambda server: bool(server.of(Ready)))
    server.send(Countdown(0), tick(state or kitchen(t=1), **more))
    page.wait_for_selector("[data-phase=playing]")


def settled(page: Page, server: FakeGameServer) -> None:
    """Return when the server has received everything that the page has sent so far: what it sends last comes last."""
    words = f"settled {len(server.of(ClientError))}"
    page.evaluate("(message) => dispatchEvent(new ErrorEvent('error', { message }))", words)
    server.wait_for(lambda server: any(each.text.startswith(words) for each in server.of(ClientError)))


def drawn(page: Page, after_ms: float) -> None:
    """Return when the page has drawn a picture that is `after_ms` younger than now, however slowly it draws."""
    page.evaluate(
        """(afterMs) => new Promise((done) => {
          const from = performance.now();
          const look = (now) => requestAnimationFrame(now - from > afterMs ? () => done() : look);
          requestAnimationFrame(look);
        })""",
        after_ms,
    )


def at_rest(page: Page) -> None:
    """Return when no animation with an end is running."""
    page.wait_for_function(
        """() => document.getAnimations().every(
          (each) => each.playState !== 'running' || each.effect.getComputedTiming().iterations === Infinity)"""
    )


def screenshot(page: Page, name: str, full_page: bool = False) -> None:
    """Keep a picture if `SCREENSHOTS=1` asks for them."""
    if WANTS_PICTURES:
        SCREENSHOTS.mkdir(exist_ok=True)
        page.screenshot(path=SCREENSHOTS / f"{name}.png", full_page=full_page)


def violations(page: Page) -> list[tuple[str, list[str]]]:
    """What axe finds against WCAG 2.2 AA and good practice: the rule, and where. A dialog that fades in would have
    too little contrast."""
    page.wait_for_function(
        """() => document.getAnimations().every(
          (one) => one.playState !== 'running' || one.effect.getComputedTiming().endTime === Infinity)"""
    )
    rules = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]
    options = {"runOnly": {"type": "tag", "values": rules}, "resultTypes": ["violations"]}
    found = Axe().run(page, options=options).response["violations"]
    return [(one["id"], [node["html"][:200] for node in one["nodes"]]) for one in found]


def pixel(page: Page, column: float, row: float) -> tuple[int, int, int]:
    """The board's colour at a place counted in cells: (2.5, 1.5) is the middle of the cell [2, 1]."""
    script = """([x, y]) => {
      const canvas = document.querySelector('canvas.board');
      const cell = canvas.width / Number(canvas.dataset.columns);
      return [...canvas.getContext('2d').getImageData(Math.floor(x * cell), Math.floor(y * cell), 1, 1).data];
    }"""
    red, green, blue, _ = page.evaluate(script, [column, row])
    return red, green, blue


def is_green(colour: tuple[int, int, int]) -> bool:
    """The partner's green, paler or not (#5fd38d)."""
    red, green, blue = colour
    return green > 190 and green - red > 40 and green - blue > 25


def is_blue(colour: tuple[int, int, int]) -> bool:
    red, green, blue = colour
    return blue > 110 and blue - red > 60 and blue - green > 40


def picture(page: Page) -> str:
    """The board as it is drawn now."""
    return str(page.evaluate("document.querySelector('canvas.board').toDataURL()"))
