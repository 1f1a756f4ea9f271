"""Published scales in a real Chromium: answered by keyboard and by touch, on wide and narrow screens."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect

from server.store import answers
from tests.support.browser.game_page import screenshot, violations
from tests.support.page_site import PageSite
from tests.support.study_text import study_head

pytestmark = [pytest.mark.browser, pytest.mark.timeout(180)]
STUDY = (
    study_head("scales", "Scales")
    + """
conditions: [{name: none, predictor: none}]
agents: [{name: planner, predictor: random}]
layouts: [{name: coordination_ring, title: {en: Ring}}]
questionnaires:
  work: {title: {en: Work}, questions: [{type: published, scale: nasa_tlx_raw}]}
  trust: {title: {en: Trust}, questions: [{type: published, scale: trust_in_automation, subscales: [trust]}]}
flow: [work, trust, introduction, thanks]
"""
)
TLX = ("mental_demand", "physical_demand", "temporal_demand", "performance", "effort", "frustration")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageSite]:
    with PageSite(tmp_path_factory.mktemp("scales"), STUDY) as running:
        yield running


@pytest.fixture
def contexts(chromium: Browser) -> Iterator[list[BrowserContext]]:
    opened: list[BrowserContext] = []
    yield opened
    for context in opened:
        context.close()


@pytest.mark.parametrize(
    ("width", "height"),
    [(390, 844), *(pytest.param(*size, marks=pytest.mark.slow) for size in ((1366, 768), (844, 390), (320, 568)))],
)
def test_scales_are_answered_and_fit_the_screen(
    site: PageSite, chromium: Browser, contexts: list[BrowserContext], width: int, height: int
) -> None:
    contexts.append(chromium.new_context(viewport={"width": width, "height": height}, locale="en-GB"))
    page = contexts[-1].new_page()
    page.goto(f"{site.url}/s/scales")
    page.locator(".check input").check()
    page.click("#agree:enabled")
    expect(page.locator("#left")).to_have_text("0 of 6 answered")
    page.keyboard.press("5")  # a digit is not a whole answer here
    expect(page.locator("#left")).to_have_text("0 of 6 answered")
    looks_right(page, f"tlx-{width}")
    for place, name in enumerate(TLX):
        page.check(f"[name=tlx_{name}][value='{5 * place}']", force=True)
    page.locator("[name=tlx_frustration]:checked").focus()
    page.keyboard.press("ArrowRight")
    page.click("#go")
    expect(page.locator("#left")).to_have_text("0 of 2 answered")
    looks_right(page, f"tia-{width}")
    expect(page.get_by_role("radio", name="2, Rather disagree").first).to_be_attached()
    page.keyboard.press("4")
    page.keyboard.press("2")
    page.click("#go")
    expect(page.locator("#questions")).to_have_count(0)
    stored = site.database.read_now(answers.of_participant, site.everybody("scales")[-1].id)
    assert stored["work"] == {f"tlx_{name}": 5 * place for place, name in enumerate(TLX)} | {"tlx_frustration": 30}
    assert stored["trust"] == {"tia_t1": 4, "tia_t2": 2}


def looks_right(page: Page, name: str) -> None:
    screenshot(page, f"scale-{name}", full_page=True)
    assert violations(page) == []
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), "nothing runs off the side"
    small = "[...document.querySelectorAll('.scale label')].filter((one) => one.offsetWidth < 24)"
    assert page.evaluate(f"{small}.length") == 0, "every point is large enough to be touched"
