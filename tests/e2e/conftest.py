"""A real headless Chromium for every end-to-end test."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page

from tests.support.browser.chromium import SharedChromium
from tests.support.browser.fake_game_server import FakeGameServer
from tests.support.browser.person import person as person
from tests.support.browser.person import site as site


@pytest.fixture(scope="session")
def shared_chromium() -> Iterator[SharedChromium]:
    """One for each worker: Playwright and Chromium take several seconds of a processor to start."""
    shared = SharedChromium()
    yield shared
    shared.close()


@pytest.fixture(scope="module")
def chromium(shared_chromium: SharedChromium) -> Iterator[Browser]:
    """The browser of this worker. Each test opens a separate context; none outlives the file."""
    with shared_chromium.in_use() as browser:
        yield browser


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


@pytest.fixture(scope="module")
def blank(chromium: Browser, game_address: FakeGameServer) -> Iterator[Page]:
    """A page with nothing on it, for the game's scripts alone."""
    page = chromium.new_page()
    page.goto(f"{game_address.url}blank")
    yield page
    page.close()
