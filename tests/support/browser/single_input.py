"""Two people at a real study's pages: one with a keyboard only, one with a touch screen only."""

import time
from typing import Any

from playwright.sync_api import Locator, Page

from tests.support.browser.browser_cook import BUTTON_MS, BrowserCook

MAX_TABS = 120
# What has the focus, and whether it shows: by a ring round it, or round the label or number that stands for it.
FOCUS = """() => {
  const e = document.activeElement, box = e.getBoundingClientRect();
  const style = (one) => getComputedStyle(one);
  const ringed = (one) => one && (style(one).outlineStyle !== 'none' || style(one).boxShadow !== 'none');
  return { tag: e.tagName, type: e.type || '', name: e.name || '', id: e.id, main: Boolean(e.closest('main, dialog')),
    quiet: e.classList.contains('quiet'), seen: box.bottom > 0 && box.top < innerHeight,
    ring: [e, e.closest('label'), e.nextElementSibling].some(ringed) };
}"""


class KeyboardOnly:
    """Tab, space, enter, digits and letters. Whatever has the focus must show it."""

    def __init__(self, page: Page) -> None:
        self.page, self.cook = page, KeyCook(page)
        self.unseen: list[str] = []

    def fill_and_leave(self) -> None:
        """Fill in what the page asks and press what leads on."""
        done: set[str] = set()
        with self.page.expect_navigation():
            for _ in range(MAX_TABS):
                self.page.keyboard.press("Tab")
                here = self._focus()
                if here["main"] and self._answer(here, done):
                    return
        raise AssertionError(f"no way on from {self.page.url} by keyboard")

    def _focus(self) -> dict[str, Any]:
        here: dict[str, Any] = self.page.evaluate(FOCUS)
        if here["tag"] != "BODY" and not (here["ring"] and here["seen"]):
            self.unseen.append(f"{self.page.title()}: {here['tag']} {here['name'] or here['id']}")
        return here

    def _answer(self, here: dict[str, Any], done: set[str]) -> bool:
        """Deal with what has the focus (one answer a question); True when that leads to another page."""
        keys = self.page.keyboard
        if here["type"] in ("checkbox", "radio"):
            if here["name"] not in done:
                keys.press("Space")
        elif here["tag"] == "SELECT":
            keys.press(str(1 + sum(one.partition(".")[0] == here["name"].partition(".")[0] for one in done)))
        elif here["tag"] == "TEXTAREA" or here["type"] == "text":
            keys.type("30")
        elif here["id"] == "next" or here["id"] == "agree":
            keys.press("Enter")
            return here["id"] == "agree"
        elif here["type"] == "submit" and not here["quiet"]:
            keys.press("Enter")
            return True
        done.add(here["name"])
        return False

    def play(self) -> None:
        """The game of this page to its end, and on."""
        self.cook.play()
        self.page.wait_for_selector("#over-next:visible")
        with self.page.expect_navigation():
            enter(self.page, "over-next")


def enter(page: Page, wanted: str) -> None:
    """Press Enter on an element, coming to it by Tab where it has not the focus."""
    for _ in range(MAX_TABS):
        if page.evaluate("document.activeElement.id") == wanted:
            break
        page.keyboard.press("Tab")
    page.keyboard.press("Enter")


class KeyCook(BrowserCook):
    """A cook without a mouse."""

    def _push(self, button: str) -> None:
        enter(self.page, button)


class TouchOnly:
    """Taps, and the letters of the keyboard that the screen shows when a field is tapped."""

    def __init__(self, page: Page) -> None:
        self.page, self.cook = page, FingerCook(page)
        self.small: list[str] = []

    def fill_and_leave(self) -> None:
        page = self.page
        boxes = page.locator("main input[type=checkbox], main input[type=radio]").all()
        for question in dict.fromkeys(box.get_attribute("name") for box in boxes):
            self._tap(page.locator("main label").filter(has=page.locator(f"input[name={question}]")).first)
        for field in page.locator("main input[type=text], main textarea").all():
            self._tap(field)
            page.keyboard.type("30")
        for place, choice in enumerate(page.locator("main select").all(), start=1):
            self._tap(choice)  # the screen's own list follows, which no page can see
            choice.select_option(str(place))
        if page.locator("#next").count():
            while page.is_visible("#next"):
                self._tap(page.locator("#next"))
        with page.expect_navigation():
            self._tap(page.locator("#agree:enabled, main button.btn:not(.quiet):not([disabled]):visible").last)

    def _tap(self, what: Locator) -> None:
        what.scroll_into_view_if_needed()
        box = what.bounding_box()
        assert box is not None
        label = what.locator("xpath=ancestor::label")
        whole = label.bounding_box() if label.count() else box
        if whole is not None and min(whole["width"], whole["height"]) < 24:
            self.small.append(f"{self.page.title()}: {what}")
        what.tap()

    def play(self) -> None:
        self.cook.play()
        with self.page.expect_navigation():
            self.page.locator("#over-next").tap()


class FingerCook(BrowserCook):
    """A cook whose keys are the buttons on the screen."""

    def _press(self, action: int) -> None:
        box = self.page.locator(f".touch [data-action='{action}']").bounding_box()
        if box is not None:
            self.page.touchscreen.tap(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)

    def _push(self, button: str) -> None:
        self.page.tap(f"#{button}", timeout=BUTTON_MS)


def take_part(person: "KeyboardOnly | TouchOnly", url: str, seconds: float = 150.0) -> list[str]:
    """Take part from the link to the completion code; return the titles of the pages."""
    page, titles, deadline = person.page, [], time.monotonic() + seconds
    page.set_default_timeout(60_000)
    page.goto(url)
    page.wait_for_selector("#agree:enabled")
    while not page.locator("output#code").count():
        assert time.monotonic() < deadline, titles[-8:]
        if page.locator("#game-config").count():
            page.wait_for_selector("[data-link=open]")
            titles.append("game")
            person.play()
        else:
            titles.append(page.title())
            person.fill_and_leave()
    return [*titles, page.title()]
