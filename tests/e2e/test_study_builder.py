"""A researcher makes a study in the browser: from a template to an open study, without writing YAML."""

import os
import re
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, BrowserContext, Locator, Page, expect

from server.study.loader import parse_study
from tests.support.browser.chromium import CHROMIUM_ARGUMENTS, installed_chromium
from tests.support.real_server import ROOT, RealServer

PATIENCE_MS = 60_000
NewPage = Callable[[], Page]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RealServer]:
    with RealServer(tmp_path_factory.mktemp("builder")) as running:
        yield running


@pytest.fixture(scope="module")
def password(server: RealServer) -> str:
    words = ["admin", "--database", server.database, "create", "mara", "--role", "own"]
    line = [sys.executable, str(ROOT / "kitchenmind"), *words]
    made = subprocess.run(line, capture_output=True, text=True, check=True, stdin=subprocess.DEVNULL)
    found = re.search(r"password: (\S+)", made.stdout)
    assert found, made.stdout
    return found.group(1)


def signed_in(context: BrowserContext, server: RealServer, password: str, errors: list[str]) -> Page:
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    expect.set_options(timeout=PATIENCE_MS)
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(f"{server.url}/admin/drafts")
    if page.locator("[name=password]").count():
        page.fill("[name=name]", "mara")
        page.fill("[name=password]", password)
        page.click("form button")
    page.wait_for_url("**/admin/drafts")
    return page


@pytest.fixture
def new_page(chromium: Browser, server: RealServer, password: str) -> Iterator[NewPage]:
    """Each page is of a browser of its own; errors of a script fail the test."""
    contexts: list[BrowserContext] = []
    errors: list[str] = []

    def opened() -> Page:
        contexts.append(chromium.new_context(viewport={"width": 1366, "height": 768}))
        return signed_in(contexts[-1], server, password, errors)

    yield opened
    for context in contexts:
        context.close()
    assert errors == []


def begin(page: Page, name: str, template: str = "quick_look") -> int:
    """A new draft; its number."""
    page.click("text=New study…")
    page.check(f"[name=template][value={template}]")
    page.fill("[name=name]", name)
    page.fill("[name=title]", f"The study {name}")
    page.click("text=Make the draft")
    expect(page.locator("body[data-checked=yes]")).to_be_attached()
    return int(page.url.rpartition("/")[2])


def at(page: Page, *path: str | int) -> Locator:
    """The field or block at a place of the study."""
    words = ",".join(f'"{piece}"' if isinstance(piece, str) else str(piece) for piece in path)
    return page.locator(f"[data-path='[{words}]']")


def place_of(*path: str) -> str:
    return f"[data-path='[{','.join(f'{chr(34)}{piece}{chr(34)}' for piece in path)}]']"


def yaml_of(page: Page) -> Locator:
    return page.locator("#yaml")


def is_accessible(page: Page) -> None:
    found = Axe().run(page).response["violations"]
    assert [(one["id"], [node["html"][:200] for node in one["nodes"]]) for one in found] == []


def stored(server: RealServer, draft: int) -> str:
    (text,) = rows(server, "select source from study_drafts where id = ?", draft)
    return text


def rows(server: RealServer, query: str, draft: int) -> list[str]:
    """Texts in the database, which the server has open."""
    with closing(sqlite3.connect(server.database.removeprefix("sqlite:///"))) as connection:
        return [text for (text,) in connection.execute(query, (draft,))]


def test_a_study_of_two_conditions_is_made_opened_and_taken_part_in_without_yaml(
    new_page: NewPage, server: RealServer
) -> None:
    page = new_page()
    draft = begin(page, "pilot")
    conditions = parse_study(stored(server, draft)).study.conditions
    for index in reversed(range(1, len(conditions))):
        page.get_by_role("button", name=f"Remove Conditions {index + 1}").click()
        expect(page.get_by_role("button", name=f"Remove Conditions {index + 1}")).to_have_count(0)
    page.get_by_role("button", name="Add to conditions").click()
    second = at(page, "conditions", 1)
    expect(second).to_have_attribute("open", "")
    at(page, "conditions", 1, "name").locator("input").fill("with_marks")
    at(page, "conditions", 1, "predictor").locator("select").select_option("random")
    page.get_by_role("button", name="Move Conditions 2 up").click()
    expect(page.get_by_role("button", name="Move Conditions 1 up")).to_be_disabled()
    expect(at(page, "conditions", 0).locator("summary").first).to_contain_text("with_marks")
    at(page, "title").locator("input").first.fill("Cooking: a pilot")
    expect(yaml_of(page)).to_have_value(re.compile("Cooking: a pilot"))
    expect(page.locator("#problems")).to_contain_text("No problems: the study can be opened")
    expect(page.locator("#save-state")).to_have_text("Saved")
    is_accessible(page)
    study = parse_study(stored(server, draft)).study
    assert [one.name for one in study.conditions] == ["with_marks", conditions[0].name]
    page.click("#open")
    page.click("dialog[open] .main")
    expect(page.locator(".said")).to_have_text("The study is open: participants are let in.")
    participant = new_page()
    participant.goto(f"{server.url}/s/pilot")
    expect(participant.locator("h1").first).to_be_visible()
    for box in participant.locator("[type=checkbox]").all():
        box.check()
    participant.click("#agree")
    participant.wait_for_url("**/s/pilot/now")
    page.goto(f"{server.url}/admin")
    expect(page.locator(".pick")).to_contain_text("pilot")


def test_both_sides_follow_each_other_and_say_what_is_wrong_at_the_field_and_at_the_line(new_page: NewPage) -> None:
    page = new_page()
    begin(page, "sides")
    text = yaml_of(page).input_value()
    minutes = at(page, "duration_min").locator("input")
    yaml_of(page).fill(re.sub(r"duration_min: \d+", "duration_min: 23", text))
    expect(minutes).to_have_value("23")
    minutes.fill("soon")
    expect(yaml_of(page)).to_have_value(re.compile("duration_min: soon"))
    expect(at(page, "duration_min").locator(".wrong")).to_contain_text("not a whole number")
    line = yaml_of(page).input_value().splitlines().index("duration_min: soon") + 1
    expect(page.locator("#gutter .bad")).to_have_text(str(line))
    expect(page.locator("#problems")).to_contain_text(f"Line {line}, duration_min")
    minutes.fill("24")
    expect(page.locator("#problems")).to_contain_text("No problems: the study can be opened")
    yaml_of(page).fill("name: [")
    expect(page.locator("#problems")).to_contain_text("this is no YAML")
    expect(page.locator("#form")).to_have_attribute("inert", "")
    for _ in range(3):
        page.click("#undo")
    expect(minutes).to_be_visible()
    expect(page.locator("#form")).not_to_have_attribute("inert", "")


def test_of_two_sessions_the_second_chooses_and_no_text_is_lost(new_page: NewPage, server: RealServer) -> None:
    mara, ben = new_page(), new_page()
    draft = begin(mara, "shared")
    ben.goto(mara.url)
    expect(ben.locator("body[data-checked=yes]")).to_be_attached()
    at(mara, "duration_min").locator("input").fill("31")
    expect(yaml_of(mara)).to_have_value(re.compile("duration_min: 31"))
    expect(mara.locator("#save-state")).to_have_text("Saved")
    at(ben, "duration_min").locator("input").fill("32")
    expect(ben.locator("#conflict")).to_be_visible()
    expect(ben.locator("#conflict .theirs")).to_have_value("duration_min: 31\n")
    expect(ben.locator("#conflict .mine")).to_have_value("duration_min: 32\n")
    is_accessible(ben)
    if os.environ.get("KITCHENMIND_PICTURES"):
        ben.screenshot(path=os.environ["KITCHENMIND_PICTURES"])
    ben.locator("#conflict .mine").fill("duration_min: 33")
    ben.click("#take-mine")
    expect(ben.locator("#save-state")).to_have_text("Saved")
    expect(at(ben, "duration_min").locator("input")).to_have_value("33")
    assert "duration_min: 33" in stored(server, draft)
    history = rows(server, "select source from study_draft_versions where draft_id = ?", draft)
    for minutes in (31, 32, 33):
        assert any(f"duration_min: {minutes}" in text for text in history), minutes
    at(mara, "duration_min").locator("input").fill("34")
    expect(mara.locator("#conflict")).to_be_visible()
    mara.click("#take-theirs")
    expect(at(mara, "duration_min").locator("input")).to_have_value("33")
    at(ben, "duration_min").locator("input").fill("35")
    expect(ben.locator("#save-state")).to_have_text("Saved")
    at(mara, "title").locator("input").first.fill("Both at once")
    expect(mara.locator("#save-state")).to_have_text("Saved, with changes that somebody else has made")
    expect(at(mara, "duration_min").locator("input")).to_have_value("35")
    assert re.search("Both at once(.|\n)*duration_min: 35", stored(server, draft))
    mara.goto(f"{mara.url}/history")
    expect(mara.locator("table")).to_contain_text("set aside")
    is_accessible(mara)


def chromium_pids(profile: Path) -> list[int]:
    """The processes of the browser with this profile."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if str(profile) in (folder / "cmdline").read_text():
                found.append(int(folder.name))
        except OSError:
            continue
    return found


def test_what_was_typed_is_there_after_the_browser_was_killed(
    chromium: Browser, server: RealServer, password: str, tmp_path: Path
) -> None:
    kind, errors = chromium.browser_type, []  # type: ignore[var-annotated]
    profile = tmp_path / "profile"
    context = kind.launch_persistent_context(profile, executable_path=installed_chromium(), args=CHROMIUM_ARGUMENTS)
    page = signed_in(context, server, password, errors)
    draft = begin(page, "killed")
    field = at(page, "title").locator("input").first
    field.press("End")
    field.press_sequentially(" and more words")
    expect(yaml_of(page)).to_have_value(re.compile("The study killed and more words"))
    expect(page.locator("#save-state")).to_have_text("Saved")
    for pid in chromium_pids(profile):
        os.kill(pid, signal.SIGKILL)
    assert "The study killed and more words" in stored(server, draft)
    assert errors == []


def test_without_a_connection_the_text_is_kept_in_the_browser(new_page: NewPage, server: RealServer) -> None:
    page = new_page()
    draft = begin(page, "offline")
    page.route("**/save", lambda route: route.abort())
    yaml_of(page).press_sequentially("# typed without a connection\n")
    expect(page.locator("#save-state")).to_contain_text("no connection")
    page.reload()
    expect(yaml_of(page)).to_have_value(re.compile("# typed without a connection"))
    page.unroute("**/save")
    expect(page.locator("#save-state")).to_have_text("Saved")
    assert "# typed without a connection" in stored(server, draft)


@pytest.mark.slow
def test_the_builder_fits_a_phone(new_page: NewPage) -> None:
    page = new_page()
    begin(page, "phone", "external_predictor")
    page.set_viewport_size({"width": 390, "height": 844})
    for pane in ("YAML", "Problems", "Form"):
        page.get_by_role("button", name=pane).first.click()
        width = page.evaluate("document.documentElement.scrollWidth")
        assert width <= 390, f"{pane} is {width} px wide"
    is_accessible(page)


@pytest.mark.slow
def test_questions_are_put_in_order_by_keyboard_and_by_drag(new_page: NewPage) -> None:
    page = new_page()
    begin(page, "order")
    page.locator("#form > details > summary", has_text="Questionnaires").click()
    at(page, "questionnaires", "teamwork").locator("summary").first.click()
    place = ("questionnaires", "teamwork", "questions")
    titles = [at(page, *place, index).locator("summary .title").first for index in range(4)]
    first, second, third, fourth = (title.inner_text() for title in titles)
    at(page, *place, 0).locator("summary").first.focus()
    page.keyboard.press("Alt+ArrowDown")
    expect(titles[0]).to_have_text(second)
    expect(titles[1]).to_have_text(first)
    expect(page.get_by_role("button", name="Move Questions 2 down")).to_be_focused()
    page.keyboard.press("Enter")
    expect(titles[2]).to_have_text(first)
    expect(titles[1]).to_have_text(third)
    grips = at(page, *place).locator("> ol > li > .moves > .grip")
    grips.nth(3).drag_to(grips.nth(0))
    for title, words in zip(titles, (fourth, second, third, first), strict=True):
        expect(title).to_have_text(words)
    keys = re.findall(r"- key: (\w+)", yaml_of(page).input_value())
    assert keys == [words.partition(",")[0] for words in (fourth, second, third, first)]
    page.get_by_label("Type of the new one").last.select_option("number")
    expect(page.locator("#problems")).to_contain_text("No problems: the study can be opened")


@pytest.mark.slow
def test_a_published_scale_is_added_from_the_list(new_page: NewPage) -> None:
    page = new_page()
    begin(page, "scales")
    page.locator("#form > details > summary", has_text="Questionnaires").click()
    at(page, "questionnaires", "teamwork").locator("summary").first.click()
    page.get_by_label("Type of the new one").first.select_option("published")
    page.get_by_role("button", name="Add to questions").first.click()
    entry = at(page, "questionnaires", "teamwork", "questions", 4)
    scale = entry.get_by_label("Scale", exact=True)
    expect(scale.locator("option")).to_have_text(["nasa_tlx_raw", "trust_in_automation"])
    scale.select_option("trust_in_automation")
    expect(yaml_of(page)).to_have_value(re.compile("scale: trust_in_automation"))
    expect(page.locator("#problems")).to_contain_text("No problems: the study can be opened")
    asked = parse_study(yaml_of(page).input_value()).study.questions("teamwork")
    assert [one.key for one in asked[-2:]] == ["tia_pro3", "tia_rc6"]


def test_a_study_that_says_everything_goes_through_the_form_byte_for_byte(new_page: NewPage) -> None:
    page = new_page()
    begin(page, "whole")
    crossed = ROOT / "studies" / "examples" / "two_factors.yaml"
    for file in (ROOT / "tests" / "data" / "every_setting.yaml", crossed, *sorted((ROOT / "studies").glob("*.yaml"))):
        text = file.read_text("utf-8")
        yaml_of(page).fill(text)
        name = re.search(r"^name: (\S+)", text, re.MULTILINE)
        assert name
        expect(at(page, "name").locator("input")).to_have_value(name.group(1))
        expect(page.locator("#form")).not_to_contain_text("The form cannot show")
        bound = "[data-control]"  # to a value of the text; the others name what is added or renamed
        for control in page.locator(f"#form input[type=text]{bound}, #form textarea{bound}").all()[:200:23]:
            with page.expect_response("**/look"):
                control.dispatch_event("input")
        assert yaml_of(page).input_value() == text, file.name


@pytest.mark.slow
def test_levels_of_factors_are_changed_in_the_form_and_their_mistakes_shown_at_the_field(new_page: NewPage) -> None:
    page = new_page()
    begin(page, "crossed")
    text = (ROOT / "studies" / "examples" / "two_factors.yaml").read_text("utf-8")
    yaml_of(page).fill(text)
    expect(page.locator("#problems")).to_contain_text("No problems: the study can be opened")
    expect(at(page, "factors", "opacity").locator("input[data-control]")).to_have_value("off, on")
    for part in (("factors",), ("factors", "steps"), ("factors", "steps", "one")):
        block = page.locator(f"details{place_of(*part)}, {place_of(*part)} > details").first
        if block.count() and not block.evaluate("one => one.open"):
            block.locator("summary").first.click()
    at(page, "factors", "steps", "one", "steps_shown").locator("input").fill("2")
    changed = text.replace("one: {steps_shown: 1}", "one: {steps_shown: 2}")
    expect(yaml_of(page)).to_have_value(changed)
    yaml_of(page).fill(changed.replace("steps_shown: 2", "steps_shown: 9"))
    expect(at(page, "factors", "steps", "one", "steps_shown")).to_contain_text("9 is too large")
    yaml_of(page).fill(changed.replace('["off", "on"]', "{plain: {}, faded: {confidence_opacity: true}}"))
    expect(page.locator("#problems")).to_contain_text("No problems: the study can be opened")
    expect(at(page, "factors", "opacity", "faded", "confidence_opacity")).to_be_attached()


def test_every_page_of_a_preview_is_shown_and_nothing_is_stored(new_page: NewPage, server: RealServer) -> None:
    page = new_page()
    draft = begin(page, "previewed")
    page.goto(f"{page.url}/preview")
    is_accessible(page)
    page.get_by_role("link", name="Begin (en)").first.click()
    seen = []
    while page.locator(".preview a", has_text="Next").count():
        seen.append(page.locator("h1").first.inner_text())
        page.locator(".preview a", has_text="Next").click()
    assert len(seen) >= 6
    assert len(set(seen)) >= 5
    expect(page.locator(".preview")).to_contain_text("Nothing is stored")
    page.goto(f"{server.url}/admin/drafts/{draft}/preview")
    page.get_by_role("link", name="Begin (en)").first.click()
    for box in page.locator("main [type=checkbox]").all():
        box.check()
    page.click("#agree")
    expect(page.locator(".preview")).to_contain_text("page 2 of")
    assert rows(server, "select id from participants where ? > 0 and study_id = 0", draft) == []
    assert rows(server, "select key from studies where ? > 0 and key = 'previewed'", draft) == []


def test_languages_stand_side_by_side_and_missing_texts_are_found(new_page: NewPage) -> None:
    page = new_page()
    begin(page, "bilingual")
    expect(page.locator("#missing-texts")).to_be_hidden()
    english, chinese = at(page, "summary").locator("input, textarea").all()
    left, right = english.bounding_box(), chinese.bounding_box()
    assert left is not None
    assert right is not None
    assert (left["y"], left["x"] < right["x"]) == (right["y"], True)
    chinese.fill("")
    expect(page.get_by_role("button", name="zh: 1 text is missing. Show the next")).to_be_visible()
    expect(at(page, "summary").locator(".missing .lang")).to_have_text("zh: missing")
    yaml_of(page).fill(yaml_of(page).input_value().replace("languages: [en, zh]", "languages: [en, zh, de]"))
    page.get_by_role("button", name=re.compile("^de: .* are missing")).click()
    expect(page.locator(":focus")).to_have_attribute("aria-label", "Title (de), missing")
    page.get_by_role("button", name=re.compile("^de: .* are missing")).click()
    expect(page.locator(":focus")).to_have_attribute("aria-label", "Summary (de), missing")
    page.get_by_role("button", name=re.compile("^zh: ")).click()
    expect(page.locator(":focus")).to_have_attribute("aria-label", "Summary (zh), missing")
    page.keyboard.type("几分钟")
    expect(page.locator("#missing-texts [data-language=zh]")).to_be_hidden()
    is_accessible(page)
    if os.environ.get("KITCHENMIND_PICTURES"):
        page.screenshot(path=os.environ["KITCHENMIND_PICTURES"])


def test_a_kitchen_is_drawn_by_keyboard_inside_the_form(new_page: NewPage, server: RealServer) -> None:
    page = new_page()
    page.set_viewport_size({"width": 1366, "height": 768})
    draft = begin(page, "drawn")
    at(page, "layouts").locator("xpath=ancestor::details").first.locator("summary").first.click()
    page.get_by_role("button", name="Draw a new kitchen…").press("Enter")
    editor = page.frame_locator("#kitchen-dialog iframe")
    expect(editor.locator("#editor[data-ready=yes]")).to_be_attached()
    page.keyboard.press("Escape")
    expect(page.locator("#kitchen-dialog")).to_be_hidden()
    page.get_by_role("button", name="Draw a new kitchen…").press("Enter")
    editor.locator("#drawing").press("ArrowUp")
    for key in ("p", "ArrowRight", "o", "ArrowRight", "d", "ArrowRight", "s"):
        page.keyboard.press(key)
    expect(editor.locator("#problems")).to_contain_text("No errors")
    editor.locator("#name").fill("nook")
    is_accessible(page)
    if os.environ.get("KITCHENMIND_PICTURES"):
        page.screenshot(path=os.environ["KITCHENMIND_PICTURES"])
    editor.locator("#save").press("Enter")
    expect(page.locator("#kitchen-dialog")).to_be_hidden()
    expect(at(page, "layouts", 1, "name").locator("input")).to_have_value("nook")
    expect(page.locator("#save-state")).to_have_text("Saved")
    assert "name: nook" in stored(server, draft)
    at(page, "layouts", 1).get_by_role("button", name="Draw this kitchen…").click()
    expect(editor.locator("#name")).to_have_value("nook")
    page.click("#kitchen-close")
    yaml_of(page).fill(
        yaml_of(page)
        .input_value()
        .replace("{name: coordination_ring,", '{name: typed, grid: "XPODSXX\\nX1   2X\\nXXXXXXX",')
    )
    expect(at(page, "layouts", 0, "name").locator("input")).to_have_value("typed")
    at(page, "layouts", 0).locator("summary").first.click()
    at(page, "layouts", 0).get_by_role("button", name="Draw this kitchen…").click()
    expect(editor.locator("#name")).to_have_value("typed")
    expect(editor.locator("#problems")).to_contain_text("No errors")
    editor.locator("#save").click()
    expect(yaml_of(page)).not_to_have_value(re.compile("grid:"))
    expect(page.locator("#save-state")).to_have_text("Saved")
    other = page.request.get(f"{server.url}/admin/kitchens/new").headers
    assert "frame-ancestors 'none'" in other["content-security-policy"], "only in the dialog"


STORED = """select (select count(*) from participants) || ' ' || (select count(*) from episodes) || ' ' ||
    (select count(*) from ticks) || ' ' || (select count(*) from studies) where ? > 0"""


def test_a_round_of_a_preview_is_played_and_nothing_of_it_is_stored(new_page: NewPage, server: RealServer) -> None:
    page = new_page()
    draft = begin(page, "tried")
    before = rows(server, STORED, draft)
    text = stored(server, draft)
    yaml_of(page).fill(text.replace("- {name: sp}", "- {name: planner, predictor: random}") + "\ngame: {horizon: 15}\n")
    expect(page.locator("#problems")).to_contain_text("No problems: the study can be opened")
    expect(page.locator("#save-state")).to_have_text("Saved")
    page.goto(f"{server.url}/admin/drafts/{draft}/preview")
    page.locator("li", has_text="episode: coordination_ring").first.get_by_role("link", name="en").click()
    is_accessible(page)
    if os.environ.get("KITCHENMIND_PICTURES"):
        page.screenshot(path=os.environ["KITCHENMIND_PICTURES"])
    page.get_by_role("link", name="Play").click()
    expect(page.locator("#over")).to_be_visible()
    page.click("#over-next")
    expect(page.locator(".preview")).to_contain_text("page ")
    assert rows(server, STORED, draft) == before
    grid = "XXPXX\\nO  2O\\nX1  X\\nXDXSX"  # drawn in the draft, called as the bundled one that the server plays in
    page.goto(f"{server.url}/admin/drafts/{draft}")
    text = yaml_of(page).input_value()
    yaml_of(page).fill(text.replace("{name: coordination_ring, ", f'{{name: coordination_ring, grid: "{grid}", '))
    expect(page.locator("#problem-count")).to_have_text("0 to correct, 2 warnings")
    expect(page.locator("#save-state")).to_have_text("Saved")
    page.goto(f"{server.url}/admin/drafts/{draft}/preview")
    page.locator("li", has_text="episode: coordination_ring").first.get_by_role("link", name="en").click()
    page.get_by_role("link", name="Play").click()
    expect(page.locator("#over")).to_be_visible()
    assert rows(server, STORED, draft) == before
    stranger = page.context.browser.new_context().new_page()  # type: ignore[union-attr]
    refused = stranger.request.get(f"{server.url}/admin/drafts/{draft}/preview/none/en/3/play", max_redirects=0)
    assert refused.status in (303, 401, 403)
    stranger.context.close()
