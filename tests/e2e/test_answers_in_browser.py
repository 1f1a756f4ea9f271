"""What people type into a page of questions: digits, numbers and words, from a real Chromium to the database."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from server.store import answers
from tests.support.browser.game_page import screenshot
from tests.support.page_site import PageSite
from tests.support.study_text import study_head
from tests.support.written_numbers import WRITTEN

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]
STUDY = (
    study_head("asked", "Asked")
    + """
conditions: [{name: none, predictor: none}]
agents: [{name: planner, predictor: random}]
layouts: [{name: coordination_ring, title: {en: Ring}}]
questionnaires:
  first:
    title: {en: First}
    questions:
      - {key: pick, type: choice, text: {en: Pick one}, options: [{value: a, text: A}, {value: b, text: B}]}
      - {key: mood, type: scale, text: {en: Mood}, low: {en: bad}, high: {en: good}}
      - {key: pace, type: scale, text: {en: Pace}, low: {en: slow}, high: {en: fast}}
      - {key: years, type: number, minimum: 0, maximum: 5000, text: {en: Years}}
      - {key: share, type: number, minimum: 0, maximum: 5000, whole: false, text: {en: Share}}
      - {key: word, type: text, lines: 1, text: {en: A word}}
      - {key: words, type: text, lines: 3, text: {en: Words}}
flow: [first, introduction, thanks]
"""
)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageSite]:
    with PageSite(tmp_path_factory.mktemp("asked"), STUDY) as running:
        yield running


@pytest.fixture
def page(site: PageSite, chromium: Browser) -> Iterator[Page]:
    context = chromium.new_context(viewport={"width": 1366, "height": 768}, locale="en-GB")
    page = context.new_page()
    page.goto(f"{site.url}/s/asked")
    page.locator(".check input").check()
    page.click("#agree:enabled")
    expect(page.locator("#left")).to_have_text("0 of 7 answered")  # the page's script runs
    yield page
    context.close()


def chosen(page: Page, question: str) -> str | None:
    found = page.locator(f"[name={question}]:checked")
    return found.get_attribute("value") if found.count() else None


def stored(site: PageSite) -> dict[str, object]:
    return site.database.read_now(answers.of_participant, site.everybody("asked")[-1].id)["first"]


def fill_in(page: Page, **changed: str) -> None:
    page.check("[name=pick][value=a]")
    page.check("[name=mood][value='4']", force=True)
    page.check("[name=pace][value='4']", force=True)
    for name, value in {"years": "30", "share": "1.5", "word": "yes", "words": "fine", **changed}.items():
        page.fill(f"[name={name}]", value)


@pytest.mark.slow
def test_digits_answer_a_scale_though_another_question_is_open_before_it(page: Page) -> None:
    page.keyboard.press("5")
    page.keyboard.press("2")
    assert (chosen(page, "mood"), chosen(page, "pace")) == ("5", "2")
    expect(page.locator("[name=years]")).to_be_focused()


def test_digits_answer_a_scale_while_a_choice_has_the_focus(page: Page) -> None:
    page.focus("[name=pick][value=b]")
    page.keyboard.press("3")
    assert (chosen(page, "mood"), chosen(page, "pick")) == ("3", None)


def unanswered(page: Page) -> None:
    """Take all answers back and let nothing have the focus, as on a page that has just been loaded."""
    page.evaluate("document.querySelector('#questions').reset(), document.activeElement.blur()")
    assert chosen(page, "mood") is None


@pytest.mark.slow
def test_digit_keys_of_every_keyboard_answer(page: Page) -> None:
    keyboards = {
        "azerty": ("Digit3", '"'),
        "arabic": ("Digit3", "٣"),
        "wide": ("Digit3", "３"),
        "pad": ("Numpad3", "3"),
        "phone": ("", "3"),
        "other layout": ("KeyX", "3"),
    }
    event = "new KeyboardEvent('keydown', { bubbles: true, cancelable: true, code, key })"
    for name, (code, key) in keyboards.items():
        unanswered(page)
        page.evaluate(f"([code, key]) => document.body.dispatchEvent({event})", [code, key])
        assert chosen(page, "mood") == "3", name


@pytest.mark.slow
def test_keys_as_the_machine_sends_them_answer(page: Page) -> None:
    keyboards = {
        "azerty 1": ("Digit1", "&", 49),
        "azerty 6": ("Digit6", "-", 54),
        "pad": ("Numpad1", "1", 97),
        "pad without NumLock": ("Numpad1", "End", 35),
    }
    keyboard = page.context.new_cdp_session(page)
    for name, (code, key, virtual) in keyboards.items():
        unanswered(page)
        pressed = {"code": code, "key": key, "windowsVirtualKeyCode": virtual, "isKeypad": code.startswith("Numpad")}
        written = {"text": key} if len(key) == 1 else {}
        keyboard.send("Input.dispatchKeyEvent", {"type": "keyDown", **pressed, **written})
        keyboard.send("Input.dispatchKeyEvent", {"type": "keyUp", **pressed})
        assert chosen(page, "mood") == (None if key == "End" else code[-1]), name
        assert chosen(page, "pace") is None, name


def test_a_digit_that_is_held_down_answers_once(page: Page) -> None:
    for _ in range(3):
        page.keyboard.down("6")
    assert (chosen(page, "mood"), chosen(page, "pace")) == ("6", None)


def test_a_pasted_text_that_is_too_long_is_not_cut_off_silently(site: PageSite, page: Page) -> None:
    fill_in(page, words="")
    page.focus("[name=words]")
    page.keyboard.insert_text("y" * 600)
    assert len(page.input_value("[name=words]")) == 600
    expect(page.locator("#m-words")).to_have_text("Please write at most 500 characters; your answer has 600.")
    page.click("#go")
    expect(page.locator("[name=words]")).to_be_focused()
    page.fill("[name=words]", "👍" * 500)
    expect(page.locator("#m-words")).to_be_hidden()
    page.click("#go")
    page.wait_for_selector("#scene")
    assert stored(site)["words"] == "👍" * 500


def test_digits_are_written_where_something_is_written(page: Page) -> None:
    page.focus("[name=years]")
    page.keyboard.type("34")
    assert page.input_value("[name=years]") == "34"
    assert chosen(page, "mood") is None


def test_page_and_server_read_numbers_alike(page: Page) -> None:
    script = """async (texts) => {
      const { readNumber } = await import('/static/js/pages/read-number.js');
      return texts.map((text) => { const { value, reason } = readNumber(text); return reason ?? value; });
    }"""
    assert dict(zip(WRITTEN, page.evaluate(script, list(WRITTEN)), strict=True)) == WRITTEN


def test_a_number_in_wide_digits_is_stored(site: PageSite, page: Page) -> None:
    fill_in(page, years="２５", share="１，５")
    page.click("#go")
    page.wait_for_selector("#slides")
    assert (stored(site)["years"], stored(site)["share"]) == (25, 1.5)


def test_an_invalid_number_is_explained_before_it_is_sent(page: Page) -> None:
    fill_in(page)
    for field, text, words in (
        ("share", "1,200", "“1,200” can be read in two ways."),
        ("years", "1.200", "“1.200” can be read in two ways."),
        ("years", "1 200", "leave out thousands separators"),
        ("years", "30.5", "Please enter a whole number."),
        ("years", "6000", "Please enter a number from 0 to 5000."),
    ):
        page.focus("[name=word]")
        page.fill(f"[name={field}]", text)
        page.click("#go")
        expect(page.locator(f"#q-{field} .msg")).to_contain_text(words)
        expect(page.locator(f"[name={field}]")).to_be_focused()
        screenshot(page, f"number-{field}")
        page.fill(f"[name={field}]", "12")
        expect(page.locator(f"#q-{field} .msg")).to_be_hidden()
    page.click("#go")
    expect(page.locator("#slides")).to_be_visible()


def test_words_reach_the_database_as_they_were_written(site: PageSite, page: Page) -> None:
    word, words = "\u3000a\u00a0b\U0001fae9", "\u3000\u3000一つ\n\u00a0\u2028二つ \U0001f9d1\u200d\U0001f373"
    fill_in(page, word=word, words=words)
    page.click("#go")
    page.wait_for_selector("#slides")
    assert (stored(site)["word"], stored(site)["words"]) == (word, words)


def test_blanks_around_words_are_kept_also_when_the_page_comes_back(site: PageSite, page: Page) -> None:
    word, words = "  two blanks ", "\n\n  after two lines\t\n"
    fill_in(page, word=word, words=words)
    page.evaluate("document.querySelector('[name=years]').value = ''; document.querySelector('#questions').submit()")
    expect(page.locator("#q-years .msg")).to_be_visible()  # the server sent the page back with what was written
    assert (page.input_value("[name=word]"), page.input_value("[name=words]")) == (word, words)
    page.fill("[name=years]", "30")
    page.click("#go")
    page.wait_for_selector("#slides")
    assert (stored(site)["word"], stored(site)["words"]) == (word, words)


def test_a_control_character_is_shown_and_not_removed(site: PageSite, page: Page) -> None:
    fill_in(page, words="one\x0btwo")
    page.click("#go")
    expect(page.locator("#q-words .msg")).to_contain_text("invisible control character after “one”")
    page.wait_for_function("() => document.querySelector('[name=words]').selectionStart === 3")
    page.keyboard.press("Delete")
    page.click("#go")
    page.wait_for_selector("#slides")
    assert stored(site)["words"] == "onetwo"


def test_no_field_offers_what_somebody_else_wrote(page: Page) -> None:
    fields = page.locator("#questions").locator("input[type=text], textarea, select")
    assert fields.count() == 4
    assert all(field.get_attribute("autocomplete") == "off" for field in fields.all())
    assert page.locator("#questions").get_attribute("autocomplete") == "off", "and no browser restores a choice"
