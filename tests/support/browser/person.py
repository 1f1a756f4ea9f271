"""A participant in a real browser: walks the pages of a small study."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, BrowserContext, Locator, Page

from server.store import participants
from server.store.participants import Participant
from tests.support.browser.game_page import draw_less_often, screenshot
from tests.support.page_site import SMALL_STUDY, PageSite

DESK = {"width": 1366, "height": 768}


PHONE = {"width": 390, "height": 844}


NARROW = {"width": 320, "height": 640}


LONGER = SMALL_STUDY.replace("name: small", "name: strict", 1).replace(
    "seed: 11\n", "seed: 11\nentry: {width: 2000, height: 2000}\nrecruitment: {screened_out: {code: KM-DEVICE}}\n"
)


HIRED = SMALL_STUDY.replace("name: small", "name: hired", 1).replace(
    "seed: 11\n", "seed: 11\nrecruitment: {source: mturk, required: true, screened_out: {code: KM-OUT}}\n"
)


HIRED = HIRED.replace("predictor: none}", "predictor: none, quota: 1}").replace(
    "predictor: tom}", "predictor: tom, quota: 1}"
)


ACCEPTED = "assignmentId=A1&hitId=H1&turkSubmitTo=https%3A%2F%2Fwww.mturk.com"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageSite]:
    with PageSite(tmp_path_factory.mktemp("pages"), SMALL_STUDY, LONGER, HIRED) as running:
        yield running


class BrowserPerson:
    """Somebody at a browser, whose console and requests are recorded."""

    def __init__(self, site: PageSite, context: BrowserContext) -> None:
        self.site, self.page = site, context.new_page()
        self.errors: list[str] = []
        self.asked: list[str] = []
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("console", lambda line: self._heard(line.type, line.text))
        self.page.on("request", lambda request: self.asked.append(request.url))

    def _heard(self, kind: str, words: str) -> None:
        if kind in ("error", "warning") and "status of 4" not in words:
            self.errors.append(words)

    @property
    def me(self) -> Participant:
        return self.site.everybody("small")[-1]

    def consent(self, query: str = "") -> "BrowserPerson":
        self.page.goto(f"{self.site.url}/s/small{query}")
        self.page.locator(".check input").check()
        self.page.click("#agree")
        self.page.wait_for_url("**/now")
        return self

    def jump(self, key: str) -> "BrowserPerson":
        """Go to a step as if everything before it had been done."""
        keys = [step.key for step in self.site.studies.steps_of(self.me)]
        self.site.database.write_now(participants.advance, self.me.id, self.me.position, keys.index(key))
        self.page.goto(f"{self.site.url}/s/small/now")
        return self

    def shot(self, name: str) -> None:
        screenshot(self.page, f"page-{name}", full_page=True)


@pytest.fixture
def person(site: PageSite, chromium: Browser) -> Iterator[BrowserPerson]:
    context = draw_less_often(chromium.new_context(viewport=DESK, locale="en-GB"))
    somebody = BrowserPerson(site, context)
    yield somebody
    context.close()
    assert somebody.errors == []
    assert [url for url in somebody.asked if not url.startswith((site.url, "blob:", "data:"))] == []


def answer_everything(page: Page) -> None:
    page.locator("[name=mood][value='4']").check(force=True)
    page.locator("[name=check][value='2']").check(force=True)
    page.check("[name=pick][value=tea]")
    page.check("[name=many][value=a]")
    page.check("[name=many][value=c]")
    page.fill("[name=words]", "fine")
    page.fill("[name=years]", "30")
    for option, place in (("x", "3"), ("y", "1"), ("z", "2")):
        page.select_option(f"[name='rank.{option}']", place)


STEPS = ("everything", "introduction", "quiz", "ready-02", "after-01", "break-02", "goodbye")


def heading(page: Page) -> Locator:
    return page.locator(".slide:visible :is(h1, h2)")
