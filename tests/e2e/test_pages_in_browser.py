"""The participant's pages in a real Chromium: looks, keys, drafts, languages, small screens, and what axe finds."""

from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, BrowserContext, Locator, Page, expect
from sqlalchemy import Connection

from server.store import attempts, participants
from server.store.participants import Participant
from server.store.tables import participants as table
from tests.support.browser.game_page import draw_less_often, screenshot, violations
from tests.support.page_site import SMALL_STUDY, Site

pytestmark = pytest.mark.browser
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
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    with Site(tmp_path_factory.mktemp("pages"), SMALL_STUDY, LONGER, HIRED) as running:
        yield running


class Person:
    """Somebody at a browser, with an eye on its console and on where it asks."""

    def __init__(self, site: Site, context: BrowserContext) -> None:
        self.site, self.page = site, context.new_page()
        self.troubles: list[str] = []
        self.asked: list[str] = []
        self.page.on("pageerror", lambda error: self.troubles.append(str(error)))
        self.page.on("console", lambda line: self._heard(line.type, line.text))
        self.page.on("request", lambda request: self.asked.append(request.url))

    def _heard(self, kind: str, words: str) -> None:
        if kind in ("error", "warning") and "status of 4" not in words:
            self.troubles.append(words)

    @property
    def me(self) -> Participant:
        return self.site.everybody("small")[-1]

    def consent(self, query: str = "") -> "Person":
        self.page.goto(f"{self.site.url}/s/small{query}")
        self.page.locator(".check input").check()
        self.page.click("#agree")
        self.page.wait_for_url("**/now")
        return self

    def jump(self, key: str) -> "Person":
        """Go to a step as if everything before it had been done."""
        keys = [step.key for step in self.site.studies.way(self.me)]
        self.site.database.write_now(participants.advance, self.me.id, self.me.position, keys.index(key))
        self.page.goto(f"{self.site.url}/s/small/now")
        return self

    def shot(self, name: str) -> None:
        screenshot(self.page, f"page-{name}", full_page=True)


@pytest.fixture
def person(site: Site, chromium: Browser) -> Iterator[Person]:
    context = draw_less_often(chromium.new_context(viewport=DESK, locale="en-GB"))
    somebody = Person(site, context)
    yield somebody
    context.close()
    assert somebody.troubles == []
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


@pytest.mark.parametrize(("size", "language"), [(DESK, "en"), (PHONE, "zh")], ids=["desk-en", "phone-zh"])
def test_axe_finds_nothing_on_any_page(
    site: Site, chromium: Browser, size: dict[str, int], language: str, request: pytest.FixtureRequest
) -> None:
    context = chromium.new_context(viewport=size, has_touch=size is PHONE, locale=language, reduced_motion="reduce")  # type: ignore[arg-type]
    person, name = Person(site, draw_less_often(context)), request.node.callspec.id
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
    assert person.troubles == []
    assert {place: problems for place, problems in found.items() if problems} == {}


def test_axe_finds_nothing_where_the_way_ends_early(person: Person) -> None:
    """Who only looks, comes twice, finds the study full, fails the quiz, was away too long, or guesses codes."""
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
    first, second = site.everybody("hired")
    keys = [step.key for step in site.studies.way(first)]
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


def test_the_next_person_in_this_browser_starts_as_a_new_participant(person: Person) -> None:
    page = person.page
    person.consent().jump("goodbye")
    page.evaluate("localStorage.setItem('keys', 'of the first person')")
    page.click("main .btn")
    code = page.inner_text("#code")
    first = person.me
    page.goto(f"{person.site.url}/s/small")
    assert code not in page.content()
    assert violations(page) == []
    person.shot("next-person")
    page.get_by_role("link", name="Show my completion code").click()
    expect(page.locator("#code")).to_have_text(code)
    page.get_by_role("link", name="Play again as a new participant").click()
    page.get_by_role("button", name="Start as a new participant").click()
    page.locator(".check input").check()
    assert page.evaluate("localStorage.getItem('keys')") is None, "nothing of the first person is left in the browser"
    page.click("#agree")
    page.wait_for_url("**/now")
    assert (person.me.number, person.me.status) == (first.number + 1, "active")


def test_a_refused_quiz_that_is_loaded_again_costs_no_attempt(person: Person) -> None:
    page = person.page
    page.route_web_socket("**/s/small/socket", lambda _: None)  # these pages have no live game behind them
    person.consent().jump("quiz")
    page.get_by_label("2", exact=True).check()
    page.click("#go")
    page.get_by_text("That is not right").wait_for()
    for _ in range(4):
        page.reload()
        page.get_by_text("That is not right").wait_for()
    assert person.me.status == "active"
    page.get_by_label("3", exact=True).check()
    page.click("#go")
    expect(page.locator(".game")).to_be_visible()


def set_status(connection: Connection, participant_id: str, status: str) -> None:
    connection.execute(table.update().where(table.c.id == participant_id).values(status=status))


def test_the_assignment_is_sent_to_mturk_and_nowhere_else(person: Person) -> None:
    page, sent = person.page, []
    page.route("https://www.mturk.com/**", lambda route: (sent.append(route.request), route.fulfill(body="done")))
    page.goto(f"{person.site.url}/s/hired?workerId=AFRESH&{ACCEPTED}")
    page.locator(".check input").check()
    page.click("#agree")
    page.wait_for_url("**/now")
    me = person.site.everybody("hired")[-1]
    keys = [step.key for step in person.site.studies.way(me)]
    person.site.database.write_now(participants.advance, me.id, 0, keys.index("goodbye"))
    page.reload()
    page.click("main .btn")
    page.get_by_role("button", name="Submit the assignment").click()
    page.wait_for_url("https://www.mturk.com/**")
    code = person.site.everybody("hired")[-1].completion_code
    assert [(one.method, one.url) for one in sent] == [("POST", "https://www.mturk.com/mturk/externalSubmit")]
    assert sent[0].post_data == f"assignmentId=A1&code={code}"
    person.asked.clear()


def test_start_page_is_light_and_quick(person: Person) -> None:
    sizes: list[int] = []
    person.page.on("response", lambda response: sizes.append(len(response.body())))
    person.page.goto(person.site.url)
    person.page.wait_for_load_state("networkidle")
    assert 0 < sum(sizes) <= 500_000


def test_device_is_checked_before_anybody_may_agree(person: Person) -> None:
    page = person.page
    page.goto(f"{person.site.url}/s/small")
    expect(page.locator("#entry")).to_have_attribute("data-state", "good")
    expect(page.locator("#agree")).to_be_enabled()


def test_unsuitable_device_is_told_why_and_led_to_its_code(person: Person) -> None:
    page = person.page
    page.goto(f"{person.site.url}/s/strict")
    expect(page.locator("#entry")).to_have_attribute("data-state", "bad")
    expect(page.locator("#entry-faults")).to_contain_text("2000 × 2000")
    expect(page.locator("#agree")).to_be_hidden()
    person.shot("entry-refused")
    page.click("#unsuitable")
    expect(page.locator("#code")).to_have_text("KM-DEVICE")
    assert person.site.everybody("strict") == []


def test_blocked_websocket_is_told_before_consent(site: Site, chromium: Browser) -> None:
    context = chromium.new_context(viewport=DESK)  # type: ignore[arg-type]
    page = context.new_page()
    page.route_web_socket("**/check", lambda socket: socket.close(code=1011))
    page.goto(f"{site.url}/s/small")
    expect(page.locator("#entry")).to_have_attribute("data-state", "bad", timeout=12_000)
    expect(page.locator("#entry-faults")).to_contain_text("live connection")
    context.close()


def test_digits_answer_the_scales_one_after_the_other_and_enter_goes_on(person: Person) -> None:
    page = person.consent().jump("after-01").page
    scales = page.locator(".q").count()
    expect(page.locator(".scale input:checked")).to_have_count(0)
    for digit in "63"[:scales]:
        page.keyboard.press(digit)
    assert page.locator("[name=partner]:checked").get_attribute("value") == "6"
    expect(page.locator("#go")).to_be_focused()
    page.keyboard.press("Enter")
    page.wait_for_selector("#scene")
    stored = person.site.step(person.me)
    assert stored.key == "ready-02"


def test_open_question_gets_the_focus_and_its_mark_goes_when_answered(person: Person) -> None:
    page = person.consent().page
    answer_everything(page)
    page.fill("[name=years]", "12")
    page.click("#go")
    expect(page.locator("[name=years]")).to_be_focused()
    expect(page.locator("#q-years .msg")).to_be_visible()
    expect(page.locator(".alert")).to_contain_text("One answer needs a change: question 6")
    person.shot("question-open")
    page.fill("[name=years]", "30")
    expect(page.locator("#q-years .msg")).to_be_hidden()
    expect(page.locator(".alert")).to_be_hidden()
    page.click("#go")
    expect(page.locator("#slides")).to_be_visible()


def test_reload_brings_the_answers_back_and_the_next_person_does_not_get_them(person: Person) -> None:
    page = person.consent().page
    answer_everything(page)
    page.reload()
    expect(page.locator("#left")).to_have_text("7 of 7 answered")
    assert page.locator("[name=mood]:checked").get_attribute("value") == "4"
    assert page.locator("[name='rank.y']").input_value() == "1"
    page.context.clear_cookies()
    person.consent()
    expect(page.locator("#left")).to_have_text("0 of 7 answered")


def test_introduction_comes_back_to_its_slide_and_goes_on_by_keyboard(person: Person) -> None:
    page = person.consent().jump("introduction").page
    page.locator("#next").focus()
    page.keyboard.press("Enter")
    page.keyboard.press("Enter")
    expect(page.locator(".slide:visible h2")).to_have_text("Put three onions in the pot")
    page.reload()
    expect(page.locator(".slide:visible h2")).to_have_text("Put three onions in the pot")
    page.locator("#next").focus()
    for _ in range(page.locator(".slide").count() - 3):
        page.keyboard.press("Enter")
    expect(page.locator("#finish")).to_be_focused()
    page.keyboard.press("Enter")
    expect(page.locator("#questions")).to_be_visible()


def heading(page: Page) -> Locator:
    return page.locator(".slide:visible :is(h1, h2)")


def test_arrow_keys_turn_the_slides_and_stop_at_both_ends(person: Person) -> None:
    page = person.consent().jump("introduction").page
    first = heading(page).inner_text()
    page.keyboard.press("ArrowLeft")
    expect(heading(page)).to_have_text(first)
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    expect(heading(page)).to_have_text("Put three onions in the pot")
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("ArrowLeft")
    expect(heading(page)).to_have_text(first)
    for _ in range(page.locator(".slide").count() + 2):
        page.keyboard.press("ArrowRight")
    expect(page.locator("#finish")).to_be_focused()


SWIPE = """([x, y]) => {
    const form = document.getElementById('slides');
    const touch = (clientX, clientY) => new Touch({ identifier: 1, target: form, clientX, clientY });
    form.dispatchEvent(new TouchEvent('touchstart', { touches: [touch(200, 200)], bubbles: true }));
    form.dispatchEvent(new TouchEvent('touchend', { changedTouches: [touch(200 + x, 200 + y)], bubbles: true }));
}"""


def test_swipes_turn_the_slides_and_scrolling_does_not(person: Person) -> None:
    page = person.consent().jump("introduction").page
    first = heading(page).inner_text()
    for scrolling in ([-60, 200], [-20, 0], [0, -300]):
        page.evaluate(SWIPE, scrolling)
        expect(heading(page)).to_have_text(first)
    page.evaluate(SWIPE, [-120, 20])
    expect(heading(page)).not_to_have_text(first)
    page.evaluate(SWIPE, [120, -20])
    expect(heading(page)).to_have_text(first)


COLOURS = """() => {
    const canvas = document.getElementById('scene');
    const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
    const colours = new Set();
    for (let i = 0; i < data.length; i += 400) colours.add(data.slice(i, i + 3).join());
    return colours.size;
}"""


def test_kitchens_are_drawn(person: Person) -> None:
    page = person.consent().jump("ready-02").page
    expect(page.locator("#scene")).to_have_attribute(
        "aria-label", "The kitchen called Ring with both chefs at their starting places"
    )
    page.wait_for_function("document.getElementById('scene').width > 448")
    colours = page.evaluate(COLOURS)
    assert colours > 30


def test_code_is_copied(person: Person) -> None:
    person.page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    page = person.consent().jump("goodbye").page
    page.click("main .btn")
    page.click("#copy")
    expect(page.locator("#code-note")).to_have_text("Copied. Now paste it where you signed up.")
    assert page.evaluate("navigator.clipboard.readText()") == person.me.completion_code


def test_markdown_of_a_study_is_shown_and_its_html_is_not_run(person: Person) -> None:
    page = person.consent().jump("goodbye").page
    expect(page.locator(".prose strong")).to_have_text("you")
    expect(page.locator(".prose")).to_contain_text("<script>alert(1)</script>")


def test_language_can_be_changed_on_every_page_without_losing_the_place(person: Person) -> None:
    page = person.consent().jump("after-01").page
    page.get_by_role("button", name="中文").click()
    expect(page.locator("html")).to_have_attribute("lang", "zh")
    expect(page.locator("h1")).to_have_text("怎么样")
    page.get_by_role("button", name="English").click()
    expect(page.locator("h1")).to_have_text("How was it")


def test_pages_fit_into_320_pixels_and_200_percent(person: Person) -> None:
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


def test_buttons_and_scales_are_large_enough_for_a_thumb(site: Site, chromium: Browser) -> None:
    context = chromium.new_context(viewport=PHONE, has_touch=True)  # type: ignore[arg-type]
    page = Person(site, context).consent().jump("after-01").page
    sides = "(all) => all.map((each) => each.getBoundingClientRect()).map((box) => [box.width, box.height])"
    boxes = page.eval_on_selector_all(".scale label, .btn", sides)
    links = page.eval_on_selector_all(".foot .link", sides)
    context.close()
    assert len(boxes) > 7
    assert all(width >= 36 and height >= 44 for width, height in boxes)
    assert all(width >= 24 and height >= 24 for width, height in links)


def test_without_scripts_the_page_says_what_is_needed(site: Site, chromium: Browser) -> None:
    context = chromium.new_context(viewport=DESK, java_script_enabled=False)  # type: ignore[arg-type]
    page = context.new_page()
    page.goto(f"{site.url}/s/small")
    assert "<noscript><p" in page.content()  # what is in it is not drawn when a debugger turns scripts off
    assert "This study needs JavaScript." in page.content()
    expect(page.locator("#agree")).to_be_disabled()
    context.close()


def test_person_who_left_something_wrong_finds_it_again(person: Person) -> None:
    """What only the server can know comes back with the page: the quiz."""
    page = person.consent().jump("quiz").page
    page.check("[name=onions][value=two]")
    page.click("#go")
    expect(page.locator("#q-onions .msg")).to_have_text("That is not right. Please try again.")
    assert page.locator("[name=onions]:checked").get_attribute("value") == "two"
    expect(page.locator("[name=onions][value=two]")).to_be_focused()


def test_the_introduction_teaches_the_controls_of_the_device(chromium: Browser, site: Site) -> None:
    for touch, words in ((True, "tap Use"), (False, "press space")):
        context = chromium.new_context(viewport=PHONE if touch else DESK, has_touch=touch, is_mobile=touch)
        page = Person(site, context).consent().page
        answer_everything(page)
        page.click("#go")
        for slide in ("fetch", "fill", "deliver"):
            text = page.locator(f"#slide-{slide} .text")
            expect(text).to_contain_text(words)
            if touch:
                expect(text).not_to_contain_text("space")
        context.close()
