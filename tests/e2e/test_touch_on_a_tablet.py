"""A researcher with a tablet: the study builder and the kitchen editor by finger alone."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Frame, Locator, Page, expect

from server.store import admins
from tests.support.live_server import LiveServer
from tests.support.researcher_site import HASH, PASSWORD

FINGER_PX = 44
PATIENCE_MS = 30_000
# What can be pressed and is smaller than a finger. A box is pressed by its label, too; the link to the content is for
# keyboards.
SMALL = f"""() => [...document.querySelectorAll('button, a[href], input:not([type=hidden]), select, summary, textarea')]
  .filter((one) => one.offsetParent && !one.disabled && !one.matches('.skip'))
  .map((one) => one.matches('[type=checkbox], [type=radio]') ? one.labels[0] : one)
  .map((one) => [one.outerHTML.slice(0, 120), one.getBoundingClientRect()])
  .filter(([, box]) => box.height < {FINGER_PX} || box.width < {FINGER_PX} - 1).map(([html]) => html)"""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    with LiveServer(tmp_path_factory.mktemp("tablet")) as running:
        running.app.state.services.web.database.write_now(admins.create, "mara", HASH, "own")
        yield running


@pytest.fixture(params=[(820, 1180), pytest.param((1180, 820), marks=pytest.mark.slow)], ids=["upright", "across"])
def page(request: pytest.FixtureRequest, chromium: Browser, server: LiveServer) -> Iterator[Page]:
    """A new draft on a tablet that is held so; errors of a script fail the test."""
    width, height = request.param
    screen = {"width": width, "height": height}
    context = chromium.new_context(viewport=screen, screen=screen, has_touch=True, is_mobile=True)  # type: ignore[arg-type]
    opened = context.new_page()
    opened.set_default_timeout(PATIENCE_MS)
    expect.set_options(timeout=PATIENCE_MS)
    errors: list[str] = []
    opened.on("pageerror", lambda error: errors.append(str(error)))
    opened.goto(f"{server.url}/admin/drafts/new")
    opened.fill("[name=name]", "mara")
    opened.fill("[name=password]", PASSWORD)
    opened.tap("form button")
    opened.tap("text=A quick look")
    opened.fill("[name=name]", f"tablet_{width}")
    opened.fill("[name=title]", "On a tablet")
    opened.tap("text=Make the draft")
    expect(opened.locator("body[data-checked=yes]")).to_be_attached()
    yield opened
    context.close()
    assert errors == []


def all_fits(page: Page | Frame) -> None:
    assert page.evaluate(SMALL) == []
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def drag(page: Page, drawing: Locator, cells: list[tuple[int, int]], columns: int) -> None:
    """Move a finger over cells of the grid."""
    box = drawing.bounding_box()
    assert box is not None
    side = box["width"] / columns
    points = [{"x": box["x"] + (x + 0.5) * side, "y": box["y"] + (y + 0.5) * side} for x, y in cells]
    touch = page.context.new_cdp_session(page)
    for kind, at in zip(["touchStart"] + ["touchMove"] * (len(points) - 1), points, strict=True):
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [at]})
    page.wait_for_timeout(150)  # a finger that is lifted in full motion is a fling, and the tap after it ends the fling
    touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    touch.detach()


@pytest.mark.slow
def test_a_study_and_its_kitchen_are_made_with_a_finger(page: Page) -> None:
    for title in ("Steps and pages", "Questionnaires", "Kitchens and order"):
        page.tap(f"#form > details > summary:has-text('{title}')")
    all_fits(page)
    page.tap("[aria-label='Move Flow 2 up']")
    expect(page.locator("#yaml")).to_have_value(re.compile(r"flow: \[tutorial, introduction"))
    page.tap("text=Draw a new kitchen…")
    editor = page.frame_locator("#kitchen-dialog iframe")
    expect(editor.locator("#editor[data-ready=yes]")).to_be_attached()
    all_fits(page.frames[-1])
    scrolled = page.evaluate("scrollY")
    for tile, cells in (("O", [(2, 0), (3, 0), (4, 0)]), ("D", [(1, 4)]), ("P", [(3, 4), (4, 4)]), ("S", [(5, 4)])):
        editor.locator(f"[data-tile={tile}]").tap()
        drag(page, editor.locator("#kitchen"), cells, columns=7)
    expect(editor.locator("#problems")).to_contain_text("No errors")
    expect(editor.locator("#reach")).to_contain_text("3 of 3")
    assert page.evaluate("scrollY") == scrolled, "a finger that draws does not scroll"
    editor.locator("#picture").scroll_into_view_if_needed()
    editor.locator("#name").fill(page.locator("#draft-name").inner_text())
    editor.locator("#save").tap()
    expect(page.locator("#kitchen-dialog")).to_be_hidden()
    expect(page.locator("#save-state")).to_have_text("Saved")


@pytest.mark.slow
def test_with_a_keyboard_on_the_screen_a_dialog_s_buttons_can_be_reached(page: Page) -> None:
    """A keyboard leaves half of the height: what is in the dialog scrolls."""
    screen = page.viewport_size
    assert screen is not None
    page.set_viewport_size({"width": screen["width"], "height": screen["height"] // 2 - 60})
    page.tap("[data-ask=open]")
    page.locator("#ask-open .main").scroll_into_view_if_needed()
    expect(page.locator("#ask-open .main")).to_be_in_viewport(ratio=1)
    page.tap("#ask-open [data-close]")
    page.tap("#form > details > summary:has-text('Kitchens and order')")
    page.tap("text=Draw a new kitchen…")
    editor = page.frame_locator("#kitchen-dialog iframe")
    expect(editor.locator("#editor[data-ready=yes]")).to_be_attached()
    editor.locator("#columns").tap()
    expect(editor.locator("#columns")).to_be_in_viewport(ratio=1)
    expect(page.locator("#kitchen-close")).to_be_in_viewport(ratio=1)
