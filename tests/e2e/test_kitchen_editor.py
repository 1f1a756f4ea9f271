"""A kitchen is drawn in a real browser, corrected and saved, and a bot plays in it in a study that names it."""

import asyncio
import re
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
from PIL import Image
from playwright.sync_api import Browser, Page, expect

from server.bots.participant import Bot
from server.store import kitchens
from server.store.database import Database
from server.store.tables import episodes
from tests.support import command_line
from tests.support.browser.game_page import DESKTOP, draw_less_often, violations
from tests.support.live_server import LiveServer
from tests.support.real_server import SHORT_STUDY

PATIENCE_MS = 60_000
STUDY = SHORT_STUDY.replace("predictor: sp_predictor_stream", "predictor: random").replace(
    ", {name: matrix, title: {en: Matrix}}", ""
)
DICTIONARY = '{"grid": """XXPXX\n              O1 2O\n              XDXSX""", "start_order_list": None}'


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    with LiveServer(tmp_path_factory.mktemp("editor"), study=STUDY) as running:
        yield running


@pytest.fixture(scope="module")
def password(server: LiveServer) -> str:
    made = command_line.run("admin", "--database", server.database, "create", "mara", "--role", "own")
    found = re.search(r"password: (\S+)", made.stdout)
    assert found, made.stdout + made.stderr
    return found.group(1)


@pytest.fixture(scope="module")
def session(chromium: Browser, server: LiveServer, password: str) -> Any:
    """What a browser keeps of a researcher who has signed in."""
    context = chromium.new_context()
    opened = context.new_page()
    opened.goto(f"{server.url}/admin")
    opened.fill("[name=name]", "mara")
    opened.fill("[name=password]", password)
    opened.click("form button")
    opened.wait_for_url("**/admin")
    kept = context.storage_state()
    context.close()
    return kept


@pytest.fixture
def page(chromium: Browser, server: LiveServer, session: Any) -> Iterator[Page]:
    """Signed in, at an empty kitchen; errors on the console fail the test."""
    context = draw_less_often(chromium.new_context(viewport=DESKTOP, storage_state=session))
    opened = context.new_page()
    opened.set_default_timeout(PATIENCE_MS)
    expect.set_options(timeout=PATIENCE_MS)
    errors: list[str] = []
    opened.on("pageerror", lambda error: errors.append(str(error)))
    open_editor(opened, f"{server.url}/admin/kitchens/new")
    yield opened
    context.close()
    assert errors == []


def open_editor(page: Page, url: str) -> None:
    page.goto(url)
    page.wait_for_selector("#editor[data-ready=yes]", state="attached")


def press(page: Page, *keys: str) -> None:
    for key in keys:
        page.keyboard.press(key)


def grid(page: Page) -> list[str]:
    """What the page would save as a file."""
    with page.expect_download() as saved:
        page.click("#export")
    return saved.value.path().read_text("utf-8").splitlines()


def is_accessible(page: Page) -> None:
    assert violations(page) == []


@pytest.mark.slow
def test_a_kitchen_is_drawn_by_keyboard_mended_saved_and_played(page: Page, server: LiveServer) -> None:
    expect(page.locator("#problems")).to_contain_text("There is no pot.")
    page.focus("#drawing")
    press(page, "ArrowUp", "p", "ArrowRight", "o", "ArrowRight", "d", "ArrowRight", "Space")  # opens the border
    expect(page.locator("#problems")).to_contain_text("Row 1, column 5: The border is open here.")
    expect(page.locator("#at")).to_contain_text("Row 1, column 5: floor. The border is open here.")
    expect(page.locator("#overlay .problem")).to_have_count(1)
    is_accessible(page)
    press(page, "s")
    expect(page.locator("#problems")).to_contain_text("No errors")
    expect(page.locator("#reach")).to_contain_text("Each chef can serve soups alone.")
    expect(page.locator("#overlay .chef-1")).to_have_count(4)
    expect(page.locator("#trial")).to_contain_text("on average")
    press(page, "ArrowDown", "ArrowDown", "2")  # the green chef has moved: it starts once
    expect(page.locator("#at")).to_have_text("Row 3, column 5: start of the green chef")
    assert grid(page) == ["XPODSXX", "X1    X", "X   2 X", "X     X", "XXXXXXX"]
    press(page, "Control+z", "Control+z", "Control+y")
    page.fill("#name", "nook")
    expect(page.locator("#models")).to_contain_text("Save the kitchen: then the commands that train for it are here.")
    expect(page.locator("#models")).to_contain_text("No agent and no predictor is trained for this kitchen yet")
    page.click("#save")
    page.wait_for_url("**/admin/kitchen/nook")
    expect(page.locator("#saved")).to_have_text("Version 1")
    expect(page.locator("#models pre")).to_contain_text("/kitchens/nook.layout --out ")
    is_accessible(page)
    serve_with_nook(page, server)
    with ThreadPoolExecutor(1) as other:  # the browser's event loop runs in this thread
        other.submit(asyncio.run, Bot(server.url, "short", 1).take_part()).result()
    with Database(server.database, read_only=True) as database:
        layouts = database.read_now(lambda connection: connection.execute(episodes.select()).mappings().all())
        saved = database.read_now(kitchens.grids)["nook"]
    assert {row["layout"] for row in layouts if row["kind"] == "episode"} == {"nook"}
    assert saved.splitlines()[0] == "XPODSXX"
    open_editor(page, f"{server.url}/admin/kitchen/nook")
    page.focus("#drawing")
    press(page, "ArrowDown", "ArrowDown", "ArrowRight", "x")
    page.click("#save")
    expect(page.locator("#note")).to_contain_text("The study short is served with the kitchen nook.")


def serve_with_nook(page: Page, server: LiveServer) -> None:
    """Name the kitchen in the study file and serve that version."""
    (file,) = server.settings.studies
    text = file.read_text("utf-8")
    file.write_text(text.replace("name: coordination_ring, title: {en: Ring}", "name: nook, title: {en: Nook}"))
    page.goto(f"{server.url}/admin/s/short")
    for _ in range(60):  # the server looks at its files every few seconds
        if page.locator("[data-ask=version]").count():
            break
        page.wait_for_timeout(500)
        page.reload()
    page.click("[data-ask=version]")
    page.fill("dialog[open] [name=note]", "an own kitchen")
    page.click("dialog[open] .main")
    expect(page.locator(".outcome")).to_contain_text("The new version is served")


def test_a_kitchen_is_drawn_by_pointer_and_touch_and_one_stroke_is_taken_back_at_once(page: Page) -> None:
    before = grid(page)
    page.click("[data-tile=O]")
    box = page.locator("#kitchen").bounding_box()
    assert box is not None
    cell = box["width"] / 7
    page.mouse.move(box["x"] + 1.5 * cell, box["y"] + 2.5 * cell)
    page.mouse.down()
    page.mouse.move(box["x"] + 4.5 * cell, box["y"] + 2.5 * cell, steps=2)
    page.mouse.up()
    assert grid(page)[2] == "XOOOO X"
    page.click("#undo")
    assert grid(page) == before
    page.click("#redo")
    assert grid(page)[2] == "XOOOO X"
    page.fill("#columns", "9")
    page.locator("#columns").blur()
    assert grid(page)[2] == "XOOOO   X"
    assert {len(row) for row in grid(page)} == {9}


def test_what_was_not_saved_comes_back_and_a_file_is_imported(page: Page, server: LiveServer, tmp_path: Path) -> None:
    file = tmp_path / "attic.layout"
    file.write_text(DICTIONARY, encoding="utf-8")
    page.click("summary")
    page.set_input_files("#file", file)
    expect(page.locator("#problems")).to_contain_text("No errors")
    expect(page.locator("#name")).to_have_value("attic")
    expect(page.locator("#trial")).to_contain_text("on average")
    open_editor(page, f"{server.url}/admin/kitchens/new")
    expect(page.locator("#note")).to_contain_text("did not save")
    assert grid(page) == ["XXPXX", "O1 2O", "XDXSX"]
    with page.expect_download() as picture:
        page.click("#picture")
    image = Image.open(BytesIO(picture.value.path().read_bytes()))
    assert (image.format, image.size) == ("PNG", (5 * 128, 3 * 128))
    page.click("summary")
    page.fill("#pasted", DICTIONARY.replace('"start_order_list": None', '"cook_time": 5'))
    page.click("#import")
    expect(page.locator("#note")).to_contain_text("Cook_time = 5 is not supported")
    expect(page.locator("#note")).to_be_in_viewport()
    page.fill("#pasted", DICTIONARY)
    page.click("#import")
    expect(page.locator("#drawing")).to_be_in_viewport(ratio=0.9)


@pytest.mark.slow
@pytest.mark.parametrize(("width", "height"), [(390, 844), (844, 390)])
def test_the_editor_fits_small_screens(page: Page, width: int, height: int) -> None:
    page.set_viewport_size({"width": width, "height": height})
    page.reload()
    page.wait_for_selector("#editor[data-ready=yes]", state="attached")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
