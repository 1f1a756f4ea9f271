"""axe finds nothing on any page, nor where the study ends early; everything fits small screens and thumbs."""

from typing import Any

import pytest
from playwright.sync_api import Browser, expect
from sqlalchemy import Connection

from server.store import attempts, participants
from server.store.tables import participants as table
from tests.support.browser.game_page import draw_less_often, violations
from tests.support.browser.person import ACCEPTED, DESK, NARROW, PHONE, STEPS, BrowserPerson
from tests.support.page_site import PageSite


@pytest.mark.parametrize(
    ("size", "language"), [(DESK, "en"), pytest.param(PHONE, "zh", marks=pytest.mark.slow)], ids=["desk-en", "phone-zh"]
)
def test_axe_finds_nothing_on_any_page(
    site: PageSite, chromium: Browser, size: dict[str, int], language: str, request: pytest.FixtureRequest
) -> None:
    context = chromium.new_context(viewport=size, has_touch=size is PHONE, locale=language, reduced_motion="reduce")  # type: ignore[arg-type]
    person, name = BrowserPerson(site, draw_less_often(context)), request.node.callspec.id
    page = person.page
    found: dict[str, list[Any]] = {}

    def look(place: str) -> None:
        found[place] = violations(page)
        person.shot(f"{place}-{name}")
        assert page.locator("html").get_attribute("lang") == language

    for place, path in (("choose", "/"), ("nowhere", "/nowhere"), ("declined", "/s/small/declined"))[
        : 3 if size is DESK else 1
    ]:
        page.goto(site.url + path)
        look(place)
    page.goto(f"{site.url}/s/small/withdraw")
    page.fill("#code-input", "KM-0000-0000")
    page.click(".danger")
    look("withdraw-wrong-code")
    page.goto(f"{site.url}/s/strict/unsuitable")
    look("unsuitable")
    page.goto(f"{site.url}/s/small")
    page.wait_for_selector("#agree:enabled")
    look("consent")
    person.consent()
    for key in STEPS if size is DESK else ("introduction", "after-01"):
        person.jump(key)
        page.wait_for_load_state("networkidle")
        look(key)
        if page.locator("#go").count():
            page.click("#go")
            expect(page.locator(".alert")).to_be_visible()
            look(f"{key}-open")
    if size is PHONE:
        person.jump("goodbye")
    page.click("main .btn")
    expect(page.locator("#code")).to_be_visible()
    look("thanks")
    page.goto(f"{site.url}/s/small/withdraw")
    look("withdraw")
    page.click(".danger")
    look("withdrawn")
    context.close()
    assert person.errors == []
    assert {place: problems for place, problems in found.items() if problems} == {}


@pytest.mark.slow
def test_axe_finds_nothing_on_the_pages_of_an_early_end(person: BrowserPerson) -> None:
    """A preview, a repeated visit, a full study, a failed quiz, a too long absence, guessed codes."""
    page, site = person.page, person.site
    found: dict[str, list[Any]] = {}

    def look(place: str) -> None:
        found[place] = violations(page)
        person.shot(place)

    def come(who: str) -> None:
        page.context.clear_cookies()
        page.goto(f"{site.url}/s/hired?workerId=A{who}&{ACCEPTED}")

    def agree() -> None:
        page.locator(".check input").check()
        page.click("#agree")

    page.goto(f"{site.url}/s/hired?assignmentId=ASSIGNMENT_ID_NOT_AVAILABLE")
    look("mturk-preview")
    page.goto("about:blank")
    page.goto(f"{site.url}/s/hired")
    look("link-needed")
    for who in ("ONE", "TWO"):
        come(who)
        agree()
        page.wait_for_url("**/now")
    come("THREE")
    agree()
    look("full")
    come("ONE")
    assert page.url == f"{site.url}/s/hired", "nobody can read in the address who somebody is"
    page.reload()
    page.get_by_role("heading", name="Welcome back").wait_for()
    look("welcome-back")
    page.click("main .btn")
    page.wait_for_url("**/now")
    first, second = site.everybody("hired")
    keys = [step.key for step in site.studies.steps_of(first)]
    site.database.write_now(participants.advance, first.id, 0, keys.index("goodbye"))
    page.reload()
    page.click("main .btn")
    page.wait_for_selector("#code")
    look("thanks-mturk")
    come("TWO")
    page.click("main .btn")
    page.wait_for_url("**/now")
    for status, place in (("timed_out", "timed-out"), ("screened_out", "screened-out")):
        site.database.write_now(set_status, second.id, status)
        page.reload()
        look(place)
    come("TWO")
    page.get_by_role("heading", name="You have already taken part").wait_for()
    look("finished")
    page.context.clear_cookies()
    page.goto(f"{site.url}/s/small/withdraw")
    for _ in range(6):
        page.fill("#code-input", "KM-0000-0000")
        page.click(".danger")
    look("too-many-codes")
    site.database.write_now(attempts.forget, "")  # those of completion codes
    assert {place: problems for place, problems in found.items() if problems} == {}


def set_status(connection: Connection, participant_id: str, status: str) -> None:
    connection.execute(table.update().where(table.c.id == participant_id).values(status=status))


@pytest.mark.slow
def test_pages_fit_into_320_pixels_and_200_percent(person: BrowserPerson) -> None:
    page, wide = person.page, []

    def check(place: str) -> None:
        for size in (NARROW, {"width": 683, "height": 384}):  # the second is 1366 x 768 at 200 %
            page.set_viewport_size(size)  # type: ignore[arg-type]
            if page.evaluate("document.documentElement.scrollWidth") > size["width"]:
                wide.append((place, size["width"]))

    page.goto(person.site.url)
    check("choose")
    page.goto(f"{person.site.url}/s/small")
    check("consent")
    person.consent()
    for key in STEPS:
        person.jump(key)
        check(key)
    page.click("main .btn")
    check("thanks")
    assert wide == []


def test_buttons_and_scales_are_large_enough_for_a_thumb(site: PageSite, chromium: Browser) -> None:
    context = chromium.new_context(viewport=PHONE, has_touch=True)  # type: ignore[arg-type]
    page = BrowserPerson(site, context).consent().jump("after-01").page
    sides = "(all) => all.map((each) => each.getBoundingClientRect()).map((box) => [box.width, box.height])"
    boxes = page.eval_on_selector_all(".scale label, .btn", sides)
    links = page.eval_on_selector_all(".foot .link", sides)
    context.close()
    assert len(boxes) > 7
    assert all(width >= 36 and height >= 44 for width, height in boxes)
    assert all(width >= 24 and height >= 24 for width, height in links)
