"""Fields, kitchens and previews of the study builder in the browser."""

import os
import re
import shutil

import pytest
from playwright.sync_api import Page, expect

from server.required_models import WEIGHTS
from server.study.loader import parse_study
from tests.support.browser.study_builder import (
    NewPage,
    at,
    begin,
    is_accessible,
    place_of,
    rows,
    stored,
    yaml_of,
)
from tests.support.browser.study_builder import new_page as new_page
from tests.support.browser.study_builder import password as password
from tests.support.browser.study_builder import server as server
from tests.support.browser.study_builder import session as session
from tests.support.live_server import LiveServer
from tests.support.real_server import ROOT


def teamwork_questionnaire(new_page: NewPage, name: str) -> Page:
    """A new draft with this questionnaire open in the form."""
    page = new_page()
    begin(page, name)
    page.locator("#form > details > summary", has_text="Questionnaires").click()
    at(page, "questionnaires", "teamwork").locator("summary").first.click()
    return page


@pytest.mark.slow
def test_a_number_says_what_it_takes_and_each_section_leads_to_its_keys(new_page: NewPage) -> None:
    page = new_page()
    begin(page, "types")
    expect(at(page, "duration_min").locator(".help")).to_contain_text("Whole number from 1 to 600.")
    expect(at(page, "seed").locator(".help")).to_contain_text("Whole number, at least 0.")
    expect(at(page, "languages").locator(".help")).to_contain_text("Names, separated by commas.")
    page.locator("#form > details > summary", has_text="Kitchens and order").click()
    with page.expect_popup() as opened:
        page.get_by_role("link", name="All keys of “Kitchens and order”").click()
    expect(opened.value.get_by_role("heading", name="Study keys: Kitchens and order")).to_be_visible()
    opened.value.get_by_role("link", name="block").nth(1).click()
    assert opened.value.url.endswith("/admin/study-keys/kitchens#order")
    is_accessible(opened.value)
    opened.value.set_viewport_size({"width": 390, "height": 844})
    assert opened.value.evaluate("document.documentElement.scrollWidth") <= 390


@pytest.mark.slow
def test_questions_are_put_in_order_by_keyboard_and_by_drag(new_page: NewPage) -> None:
    page = teamwork_questionnaire(new_page, "order")
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
    page = teamwork_questionnaire(new_page, "scales")
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
    page.get_by_label("Name of a new factor").fill("prediction")
    page.get_by_role("button", name="Add a factor").click()
    for level in ("none", "guided", "tom"):
        page.get_by_label("Name of a new level of Prediction").fill(level)
        page.locator(place_of("factors", "prediction")).get_by_role("button", name="Add a level").last.click()
        expect(at(page, "factors", "prediction", level)).to_be_attached()
    made = parse_study(yaml_of(page).input_value()).study.factors["prediction"]
    assert {name: level.predictor for name, level in made.items()} == {"none": "none", "guided": None, "tom": "tom"}


@pytest.mark.slow
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
    page.get_by_role("button", name=re.compile("^summary: no words in 'zh'")).click()
    expect(chinese).to_be_focused()
    expect(chinese).to_have_attribute("aria-invalid", "true")
    expect(at(page, "conditions", 0, "view_radius").locator(".help")).to_contain_text("For example 2.")
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


def test_every_page_of_a_preview_is_shown_and_nothing_is_stored(new_page: NewPage, server: LiveServer) -> None:
    page = new_page()
    draft = begin(page, "previewed")
    page.goto(f"{page.url}/preview")
    is_accessible(page)
    with page.expect_navigation():
        page.get_by_role("link", name="Begin (en)").first.click()
    seen = []
    while page.locator(".preview a", has_text="Next").count():
        seen.append(page.locator("h1").first.inner_text())
        with page.expect_navigation():  # or the page before, or none, would be looked at
            page.locator(".preview a", has_text="Next").click()
    assert len(seen) >= 6
    assert len(set(seen)) >= 5
    expect(page.locator(".preview")).to_contain_text("Nothing is stored")
    page.goto(f"{server.url}/admin/drafts/{draft}/preview")
    with page.expect_navigation():
        page.get_by_role("link", name="Begin (en)").first.click()
    for box in page.locator("main [type=checkbox]").all():
        box.check()
    page.click("#agree")
    expect(page.locator(".preview")).to_contain_text("page 2 of")
    assert rows(server, "select id from participants where ? > 0 and study_id = 0", draft) == []
    assert rows(server, "select key from studies where ? > 0 and key = 'previewed'", draft) == []


@pytest.mark.slow
def test_a_kitchen_is_drawn_by_keyboard_inside_the_form(new_page: NewPage, server: LiveServer) -> None:
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
    page.get_by_role("button", name="Add to layouts").click()
    at(page, "layouts", 2).get_by_role("button", name="nook", exact=True).click()
    expect(at(page, "layouts", 2, "title").locator("input").last).to_have_value("nook")
    page.get_by_role("button", name="Remove Layouts 3").click()
    expect(at(page, "layouts", 2)).to_have_count(0)
    page.get_by_role("button", name="Add to agents").click()
    at(page, "agents", 1).get_by_role("button", name="planner", exact=True).click()
    expect(at(page, "agents", 1, "name").locator("input")).to_have_value("planner")
    page.get_by_role("button", name="Remove Agents 2").click()
    expect(at(page, "agents", 1)).to_have_count(0)
    page.locator("""[data-control='add ["flow"]']""").evaluate("one => one.click()")  # its section is closed
    expect(yaml_of(page)).to_have_value(re.compile(r"flow: \[introduction, tutorial, episodes, (''|\"\"), thanks\]"))
    page.click("#undo")
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


def test_a_round_of_a_preview_is_played_and_nothing_of_it_is_stored(new_page: NewPage, server: LiveServer) -> None:
    page = new_page()
    draft = begin(page, "tried")
    before = rows(server, STORED, draft)
    text = stored(server, draft)
    by_chance = text.replace("- {name: sp_strong}", "- {name: planner, predictor: random}")
    yaml_of(page).fill(by_chance + "\ngame: {horizon: 15}\n")
    expect(page.locator("#problem-count")).to_have_text("0 to correct, 1 warning")
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
    expect(page.locator("#problem-count")).to_have_text("1 to correct, 3 warnings")
    expect(page.locator("#problems")).to_contain_text(
        "layouts.0.name: 'coordination_ring' is another kitchen in another"
    )
    expect(page.locator("#save-state")).to_have_text("Saved")
    page.goto(f"{server.url}/admin/drafts/{draft}/preview")
    page.locator("li", has_text="episode: coordination_ring").first.get_by_role("link", name="en").click()
    page.get_by_role("link", name="Play").click()
    expect(page.locator("#over")).to_be_visible()
    assert rows(server, STORED, draft) == before
    outsider = page.context.browser.new_context().new_page()  # type: ignore[union-attr]
    refused = outsider.request.get(f"{server.url}/admin/drafts/{draft}/preview/none/en/3/play", max_redirects=0)
    assert refused.status in (303, 401, 403)
    outsider.context.close()


@pytest.mark.slow
def test_models_that_were_trained_here_are_chosen_by_name(new_page: NewPage, server: LiveServer) -> None:
    ring, own = WEIGHTS / "coordination_ring", server.settings.own_models / "coordination_ring"
    page = new_page()
    begin(page, "trained")
    expect(page.locator(".own-models:visible")).to_have_count(0)
    shutil.copytree(ring / "sp", own / "mine")
    shutil.copytree(ring / "sp_predictor_stream", own / "mine_predictor_stream")
    yaml_of(page).press("Control+End")
    yaml_of(page).type("# looked at again\n")
    at(page, "agents", 0).locator("summary").first.click()
    choice = page.get_by_role("group", name="Agents that were trained here").get_by_role("button", name="mine")
    choice.first.press("Enter")
    expect(yaml_of(page)).to_have_value(re.compile(r"- \{name: sp_strong, model: mine\}"))
    expect(choice.first).to_have_attribute("aria-pressed", "true")
    expect(page.locator("#problems")).to_contain_text("No problems: the study can be opened")
    is_accessible(page)
