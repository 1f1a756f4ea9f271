"""A real headless Chromium for every end-to-end test."""

import shutil
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, sync_playwright

from tests.support.browser.chromium import CHROMIUM_ARGUMENTS
from tests.support.browser.fake_game_server import FakeGameServer


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    """The installed Chromium. Its absence is a failure: `make setup` says how to install it.

    Once a module: while Playwright is open its event loop counts as running, and asynchronous tests could not follow.
    """
    executable = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    assert executable, "no Chromium is installed: run `make setup`, or install the package `chromium`"
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=CHROMIUM_ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def game_address(chromium: Browser) -> Iterator[FakeGameServer]:
    """One address a module, so that what its browser has loaded from there need not be loaded again."""
    server = FakeGameServer()
    yield server
    if server.visitor is not None:
        server.visitor.close()
    server.close()


@pytest.fixture
def server(game_address: FakeGameServer) -> FakeGameServer:
    """A game's server that a test plays itself. Modules with a real one name theirs the same."""
    game_address.reset()
    return game_address
