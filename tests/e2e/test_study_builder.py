"""A researcher makes a study in the browser: from a template to an open study, without writing YAML."""

import os
import re
import signal
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, Route, expect

from server.study.loader import parse_study
from tests.support.browser.chromium import CHROMIUM_ARGUMENTS, installed_chromium
from tests.support.browser.study_builder import (
    NewPage,
    at,
    begin,
    is_accessible,
    rows,
    signed_in,
    stored,
    yaml_of,
)
from tests.support.browser.study_builder import new_page as new_page
from tests.support.browser.study_builder import password as password
from tests.support.browser.study_builder import server as server
from tests.support.browser.study_builder import session as session
from tests.support.live_server import LiveServer
from tests.support.real_server import ROOT


def test_a_study_of_two_conditions_is_made_opened_and_taken_part_in_without_yaml(
    new_page: NewPage, server: LiveServer
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
    expect(page.locator(".outcome")).to_have_text("The study is open: participants can join.")
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
    expect(page.get_by_role("button", name=f"Line {line}", exact=True)).to_be_visible()
    expect(page.get_by_role("button", name=re.compile("^duration_min: 'soon' is not"))).to_be_visible()
    minutes.fill("24")
    expect(page.locator("#problems")).to_contain_text("No problems: the study can be opened")
    yaml_of(page).fill(f"{text}order: {{rule: paper}}\n")
    page.get_by_role("button", name=re.compile(r"^order\.rule: ")).click()
    expect(at(page, "order", "rule").locator("select")).to_be_focused()  # its section was closed
    expect(at(page, "order", "rule").locator(".wrong code")).to_have_text("latin_square")
    page.get_by_role("button", name=re.compile(r"^Line \d+$")).click()
    expect(yaml_of(page)).to_be_focused()
    yaml_of(page).fill("name: [")
    expect(page.locator("#problems")).to_contain_text("this is not YAML")
    expect(page.locator("#form")).to_have_attribute("inert", "")
    for _ in range(3):
        page.click("#undo")
    expect(minutes).to_be_visible()
    expect(page.locator("#form")).not_to_have_attribute("inert", "")


def test_of_two_sessions_the_second_chooses_and_no_text_is_lost(new_page: NewPage, server: LiveServer) -> None:
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
    expect(mara.locator("#undo")).to_be_disabled()  # it would undo what the other one has changed
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
    chromium: Browser, server: LiveServer, password: str, tmp_path: Path
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


def test_without_a_connection_the_text_is_kept_in_the_browser(new_page: NewPage, server: LiveServer) -> None:
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


def test_saved_is_not_shown_while_a_change_of_the_form_is_on_its_way(new_page: NewPage) -> None:
    page = new_page()
    begin(page, "on-its-way")
    saves: list[Route] = []
    looks: list[Route] = []
    page.route("**/save", lambda route: route.continue_() if saves else saves.append(route))
    with page.expect_request("**/save"), page.expect_response("**/look"):
        yaml_of(page).press_sequentially("# typed\n")
    page.route("**/look", lambda route: route.continue_() if looks else looks.append(route))
    with page.expect_request("**/look"):
        at(page, "title").locator("input").first.fill("A title on its way")
    with page.expect_response("**/save"):
        saves[0].continue_()
    page.wait_for_timeout(100)  # the page has read the answer
    expect(page.locator("#save-state")).to_have_text("Saving …")
    looks[0].continue_()
    expect(page.locator("#save-state")).to_have_text("Saved")
    expect(yaml_of(page)).to_have_value(re.compile("A title on its way"))


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


CROSSED = ROOT / "studies" / "examples" / "two_factors.yaml"


def test_a_study_with_every_setting_goes_through_the_form_byte_for_byte(new_page: NewPage) -> None:
    go_through_the_form(new_page(), "whole", [ROOT / "tests" / "data" / "every_setting.yaml", CROSSED])


@pytest.mark.slow
def test_every_bundled_study_goes_through_the_form_byte_for_byte(new_page: NewPage) -> None:
    go_through_the_form(new_page(), "bundled", sorted((ROOT / "studies").glob("*.yaml")))


def go_through_the_form(page: Page, name: str, files: list[Path]) -> None:
    """Open each text in the form and change some of its fields to what they are."""
    begin(page, name)
    for file in files:
        text = file.read_text("utf-8")
        yaml_of(page).fill(text)
        name = re.findall(r"^name: (\S+)", text, re.MULTILINE)[0]
        expect(at(page, "name").locator("input")).to_have_value(name)
        expect(page.locator("#form")).not_to_contain_text("The form cannot show")
        bound = "[data-control]"  # to a value of the text; the others name what is added or renamed
        for control in page.locator(f"#form input[type=text]{bound}, #form textarea{bound}").all()[:200:23]:
            with page.expect_response("**/look"):
                control.dispatch_event("input")
        expect(page.locator("#save-state")).to_have_text("Saved")  # or the last change is made in the next file's text
        assert yaml_of(page).input_value() == text, file.name
