"""The introduction says how to ask for the marks and how far one sees, for the device in use."""

from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, expect

from tests.support.browser.game_page import DESKTOP, PHONE, screenshot
from tests.support.page_site import SMALL_STUDY, PageSite
from tests.support.parameters import mostly_slow

pytestmark = [pytest.mark.browser, pytest.mark.timeout(90)]
SETTINGS = {"hold": "on_key", "switch": "toggle"}
LANDSCAPE = {"width": 844, "height": 390}


def study(name: str, show: str) -> str:
    text = SMALL_STUDY.replace("name: small", f"name: {name}", 1)
    text = text.replace("  - {name: without, predictor: none}\n", "")
    text = text.replace("{name: with, predictor: tom}", f"{{name: with, predictor: tom, show: {show}, view_radius: 2}}")
    flow = text.partition("\nflow: ")[2].partition("\n")[0]
    return text.replace(flow, "[introduction, everything, quiz, tutorial, episodes, goodbye, thanks]")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageSite]:
    with PageSite(tmp_path_factory.mktemp("shows"), *(study(*one) for one in SETTINGS.items())) as running:
        yield running


@pytest.mark.parametrize(
    ("name", "size", "words"),
    mostly_slow(
        [
            ("hold", DESKTOP, "only while you hold the Q key"),
            ("hold", PHONE, "only while you hold the “Next steps” button"),
            ("switch", LANDSCAPE, "Tap the “Next steps” button to show them"),
        ]
    ),
)
def test_the_introduction_explains_how_to_ask_for_the_marks(
    chromium: Browser, site: PageSite, name: str, size: dict[str, int], words: str
) -> None:
    touch: dict[str, Any] = {} if size == DESKTOP else {"has_touch": True, "is_mobile": True}
    context = chromium.new_context(viewport=size, locale="en", **touch)
    page = context.new_page()
    page.set_default_timeout(30_000)
    page.goto(f"{site.url}/s/{name}")
    for box in page.locator("main input[type=checkbox]").all():
        box.check()
    with page.expect_navigation():
        page.locator("main .btn:not(.quiet):visible").first.click()
    expect(page.locator("#slide-team .view")).to_contain_text("You can see up to 2 cells away from your chef")
    screenshot(page, f"introduction-view-{size['width']}x{size['height']}")
    while page.is_visible("#next"):
        page.click("#next")
    expect(page.locator("#slide-marks .ask")).to_contain_text(words)
    screenshot(page, f"introduction-{name}-{size['width']}x{size['height']}")
    context.close()
