"""The study builder in a browser: a server, researchers who are signed in, and what they see of a draft."""

import re
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from typing import Any

import pytest
from playwright.sync_api import Browser, BrowserContext, Locator, Page, expect

from tests.support import command_line
from tests.support.browser.game_page import DESKTOP, draw_less_often, violations
from tests.support.live_server import LiveServer

PATIENCE_MS = 60_000
NewPage = Callable[[], Page]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    with LiveServer(tmp_path_factory.mktemp("builder")) as running:
        yield running


@pytest.fixture(scope="module")
def password(server: LiveServer) -> str:
    made = command_line.run("admin", "--database", server.database, "create", "mara", "--role", "own")
    found = re.search(r"password: (\S+)", made.stdout)
    assert found, made.stdout
    return found.group(1)


@pytest.fixture(scope="module")
def session(chromium: Browser, server: LiveServer, password: str) -> Any:
    """What a browser keeps of a researcher who has signed in: doing it again for every page takes half a second."""
    context = chromium.new_context()
    signed_in(context, server, password, [])
    kept = context.storage_state()
    context.close()
    return kept


def signed_in(context: BrowserContext, server: LiveServer, password: str, errors: list[str]) -> Page:
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    expect.set_options(timeout=PATIENCE_MS)
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(f"{server.url}/admin/drafts")
    if page.locator("[name=password]").count():
        page.fill("[name=name]", "mara")
        page.fill("[name=password]", password)
        page.click("form button")
    page.wait_for_url("**/admin/drafts")
    return page


@pytest.fixture
def new_page(chromium: Browser, server: LiveServer, password: str, session: Any) -> Iterator[NewPage]:
    """Each page has its own browser; errors of a script fail the test."""
    contexts: list[BrowserContext] = []
    errors: list[str] = []

    def opened() -> Page:
        contexts.append(draw_less_often(chromium.new_context(viewport=DESKTOP, storage_state=session)))
        return signed_in(contexts[-1], server, password, errors)

    yield opened
    for context in contexts:
        context.close()
    assert errors == []


def begin(page: Page, name: str, template: str = "quick_look") -> int:
    """A new draft; its number."""
    page.click("text=New study…")
    page.check(f"[name=template][value={template}]")
    page.fill("[name=name]", name)
    page.fill("[name=title]", f"The study {name}")
    page.click("text=Make the draft")
    expect(page.locator("body[data-checked=yes]")).to_be_attached()
    return int(page.url.rpartition("/")[2])


def at(page: Page, *path: str | int) -> Locator:
    """The field or block at a place of the study."""
    words = ",".join(f'"{piece}"' if isinstance(piece, str) else str(piece) for piece in path)
    return page.locator(f"[data-path='[{words}]']")


def place_of(*path: str) -> str:
    return f"[data-path='[{','.join(f'{chr(34)}{piece}{chr(34)}' for piece in path)}]']"


def yaml_of(page: Page) -> Locator:
    return page.locator("#yaml")


def is_accessible(page: Page) -> None:
    assert violations(page) == []


def stored(server: LiveServer, draft: int) -> str:
    (text,) = rows(server, "select source from study_drafts where id = ?", draft)
    return text


def rows(server: LiveServer, query: str, draft: int) -> list[str]:
    """Texts in the database, which the server has open."""
    with closing(sqlite3.connect(server.database.removeprefix("sqlite:///"))) as connection:
        return [text for (text,) in connection.execute(query, (draft,))]
