"""The participant's pages in a real Chromium: looks, keys, drafts, languages, small screens, and what axe finds."""

import pytest
from playwright.sync_api import Browser, WebSocketRoute, expect

from server.store import participants
from tests.support.browser.game_page import violations
from tests.support.browser.person import ACCEPTED, DESK, BrowserPerson, answer_everything
from tests.support.page_site import PageSite

pytestmark = pytest.mark.browser


def test_the_next_person_in_this_browser_starts_as_a_new_participant(person: BrowserPerson) -> None:
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


def test_a_refused_quiz_that_is_loaded_again_costs_no_attempt(person: BrowserPerson) -> None:
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


def test_the_assignment_is_sent_to_mturk_and_nowhere_else(person: BrowserPerson) -> None:
    page, sent = person.page, []
    page.route("https://www.mturk.com/**", lambda route: (sent.append(route.request), route.fulfill(body="done")))
    page.goto(f"{person.site.url}/s/hired?workerId=AFRESH&{ACCEPTED}")
    page.locator(".check input").check()
    page.click("#agree")
    page.wait_for_url("**/now")
    me = person.site.everybody("hired")[-1]
    keys = [step.key for step in person.site.studies.steps_of(me)]
    person.site.database.write_now(participants.advance, me.id, 0, keys.index("goodbye"))
    page.reload()
    page.click("main .btn")
    page.get_by_role("button", name="Submit the assignment").click()
    page.wait_for_url("https://www.mturk.com/**")
    code = person.site.everybody("hired")[-1].completion_code
    assert [(one.method, one.url) for one in sent] == [("POST", "https://www.mturk.com/mturk/externalSubmit")]
    assert sent[0].post_data == f"assignmentId=A1&code={code}"
    person.asked.clear()


def test_start_page_is_light_and_quick(person: BrowserPerson) -> None:
    sizes: list[int] = []
    person.page.on("response", lambda response: sizes.append(len(response.body())))
    person.page.goto(person.site.url)
    person.page.wait_for_load_state("networkidle")
    assert 0 < sum(sizes) <= 500_000


def test_device_is_checked_before_anybody_may_agree(person: BrowserPerson) -> None:
    page = person.page
    page.goto(f"{person.site.url}/s/small")
    expect(page.locator("#entry")).to_have_attribute("data-state", "good")
    expect(page.locator("#agree")).to_be_enabled()


def test_unsuitable_device_gets_the_reason_and_its_code(person: BrowserPerson) -> None:
    page = person.page
    page.goto(f"{person.site.url}/s/strict")
    expect(page.locator("#entry")).to_have_attribute("data-state", "bad")
    expect(page.locator("#entry-faults")).to_contain_text("2000 × 2000")
    expect(page.locator("#agree")).to_be_hidden()
    person.shot("entry-refused")
    page.click("#unsuitable")
    expect(page.locator("#code")).to_have_text("KM-DEVICE")
    assert person.site.everybody("strict") == []


def test_a_blocked_websocket_is_reported_before_consent(site: PageSite, chromium: Browser) -> None:
    context = chromium.new_context(viewport=DESK)  # type: ignore[arg-type]
    page = context.new_page()
    page.route_web_socket("**/check", lambda socket: socket.close(code=1011))
    page.goto(f"{site.url}/s/small")
    expect(page.locator("#entry")).to_have_attribute("data-state", "bad", timeout=12_000)
    expect(page.locator("#entry-faults")).to_contain_text("live connection")
    context.close()


def test_a_connection_that_stalls_is_called_slow_and_not_blocked(site: PageSite, chromium: Browser) -> None:
    context = chromium.new_context(viewport=DESK)  # type: ignore[arg-type]
    page = context.new_page()
    echoed: list[str | bytes] = []

    def echo_once(socket: WebSocketRoute) -> None:
        socket.on_message(lambda words: None if echoed else (echoed.append(words), socket.send(words))[1])

    page.route_web_socket("**/check", echo_once)
    page.clock.install()
    page.goto(f"{site.url}/s/small")
    while not echoed:
        page.wait_for_timeout(20)
    page.clock.run_for(9000)
    expect(page.locator("#entry-faults")).to_contain_text("too slow for the game")
    expect(page.locator("#entry-faults")).not_to_contain_text("live connection")
    context.close()


def test_digits_answer_the_scales_in_order_and_enter_continues(person: BrowserPerson) -> None:
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


def test_open_question_gets_the_focus_and_its_mark_goes_when_answered(person: BrowserPerson) -> None:
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


def test_reload_brings_the_answers_back_and_the_next_person_does_not_get_them(person: BrowserPerson) -> None:
    page = person.consent().page
    answer_everything(page)
    page.reload()
    expect(page.locator("#left")).to_have_text("7 of 7 answered")
    assert page.locator("[name=mood]:checked").get_attribute("value") == "4"
    assert page.locator("[name='rank.y']").input_value() == "1"
    page.context.clear_cookies()
    person.consent()
    expect(page.locator("#left")).to_have_text("0 of 7 answered")


def test_code_is_copied(person: BrowserPerson) -> None:
    person.page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    page = person.consent().jump("goodbye").page
    page.click("main .btn")
    page.click("#copy")
    expect(page.locator("#code-note")).to_have_text("Copied. Now paste it where you signed up.")
    assert page.evaluate("navigator.clipboard.readText()") == person.me.completion_code


def test_markdown_of_a_study_is_shown_and_its_html_is_not_run(person: BrowserPerson) -> None:
    page = person.consent().jump("goodbye").page
    expect(page.locator(".prose strong")).to_have_text("you")
    expect(page.locator(".prose")).to_contain_text("<script>alert(1)</script>")


def test_language_can_be_changed_on_every_page_without_losing_the_place(person: BrowserPerson) -> None:
    page = person.consent().jump("after-01").page
    page.get_by_role("button", name="中文").click()
    expect(page.locator("html")).to_have_attribute("lang", "zh")
    expect(page.locator("h1")).to_have_text("怎么样")
    page.get_by_role("button", name="English").click()
    expect(page.locator("h1")).to_have_text("How was it")


def test_without_scripts_the_page_explains_what_is_needed(site: PageSite, chromium: Browser) -> None:
    context = chromium.new_context(viewport=DESK, java_script_enabled=False)  # type: ignore[arg-type]
    page = context.new_page()
    page.goto(f"{site.url}/s/small")
    assert "<noscript><p" in page.content()  # what is in it is not drawn when a debugger turns scripts off
    assert "This study needs JavaScript." in page.content()
    expect(page.locator("#agree")).to_be_disabled()
    context.close()


def test_person_who_left_something_wrong_finds_it_again(person: BrowserPerson) -> None:
    """Faults that only the server can find are shown with the page: the quiz."""
    page = person.consent().jump("quiz").page
    page.check("[name=onions][value=two]")
    page.click("#go")
    expect(page.locator("#q-onions .msg")).to_have_text("That is not right. Please try again.")
    assert page.locator("[name=onions]:checked").get_attribute("value") == "two"
    expect(page.locator("[name=onions][value=two]")).to_be_focused()
