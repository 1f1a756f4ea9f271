"""Keys pressed on the game's page, and the messages that the server received."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, Page

from tests.support.browser.fake_game_server import FakeGameServer
from tests.support.browser.game_page import opened, settled, start


@pytest.fixture
def page(chromium: Browser, server: FakeGameServer) -> Iterator[Page]:
    with opened(chromium, server) as page:
        start(page, server)
        yield page


def were_sent(
    page: Page, server: FakeGameServer, what: Callable[[FakeGameServer], list[Any]], wanted: list[Any]
) -> None:
    """Wait until so much has come and nothing more is on its way: then it must be what is wanted."""
    server.wait_for(lambda server: len(what(server)) >= len(wanted))
    settled(page, server)
    assert what(server) == wanted


def moves(server: FakeGameServer) -> list[tuple[int | None, int | None]]:
    return [(each.held, each.tap) for each in server.inputs()]


def press_raw(page: Page, kind: str, **about: object) -> None:
    """A key event as a browser would make it that Playwright cannot play: from a keyboard of another kind."""
    script = """([kind, about]) => (document.querySelector('dialog[open]') ?? document.activeElement).dispatchEvent(
      new KeyboardEvent(kind, { bubbles: true, cancelable: true, ...about }))"""
    page.evaluate(script, [kind, about])


def taps(server: FakeGameServer) -> list[int]:
    return [each.tap for each in server.inputs() if each.tap is not None]
