"""Buttons of the study builder that solve a problem, on a desktop and on a phone."""

import re

import pytest
from playwright.sync_api import Page, expect

from server.study.loader import parse_study
from tests.support.browser.game_page import DESKTOP
from tests.support.browser.study_builder import NewPage, at, begin, is_accessible, stored, yaml_of
from tests.support.browser.study_builder import new_page as new_page
from tests.support.browser.study_builder import password as password
from tests.support.browser.study_builder import server as server
from tests.support.browser.study_builder import session as session
from tests.support.live_server import LiveServer


@pytest.mark.slow
def test_kitchens_are_taken_out_of_the_published_study_without_correcting_anything_by_hand(
    new_page: NewPage, server: LiveServer
) -> None:
    page = new_page()
    draft = begin(page, "fewer", "external_predictor")
    page.locator("#form > details > summary", has_text="Kitchens and order").click()
    for number in (5, 4, 3, 2):
        page.get_by_role("button", name=f"Remove Layouts {number}").click()
        expect(page.get_by_role("button", name=f"Remove Layouts {number}")).to_have_count(0)
    page.get_by_role("button", name="Remove Agents 2").click()
    lists_fit_a_phone(page)
    page.locator("#problems").get_by_role("button", name="Use latin_square", exact=True).click()
    expect(at(page, "order", "rule").locator(".fix")).to_be_hidden()
    expect(at(page, "breaks", "after").locator(".fix")).to_have_text("Leave these breaks out")
    page.locator("#problems").get_by_role("button", name="Leave these breaks out").first.click()
    expect(page.locator("#problems")).to_contain_text("No problems: the study can be opened.")
    expect(page.locator("#save-state")).to_have_text("Saved")
    study = parse_study(stored(server, draft)).study
    assert (study.order.rule, study.breaks.after) == ("latin_square", ())
    assert "# Between subjects: each participant" in stored(server, draft), "comments stay"
    is_accessible(page)


@pytest.mark.slow
def test_a_new_questionnaire_needs_only_its_texts_and_one_click_to_be_asked(new_page: NewPage) -> None:
    page = new_page()
    begin(page, "asking")
    page.locator("#form > details > summary", has_text="Questionnaires").click()
    add = at(page, "questionnaires").locator(":scope > .add")
    add.get_by_role("textbox").fill("about_you")
    add.get_by_role("button").click()
    texts = at(page, "questionnaires", "about_you").locator(".missing [data-control]")
    expect(texts).not_to_have_count(0)
    expect(page.locator("#problems")).not_to_contain_text("is not possible here")
    page.evaluate("for (const one of document.querySelectorAll('#form details')) one.open = true")
    for control in texts.evaluate_all("all => all.map(one => one.dataset.control)"):
        page.locator(f"[data-control='{control}']").fill("Words")
    page.locator("#problems").get_by_role("button", name="Put about_you before the last page").click()
    expect(page.locator("#problems")).to_contain_text("No problems: the study can be opened.")
    expect(yaml_of(page)).to_have_value(re.compile("episodes, about_you, thanks"))


def lists_fit_a_phone(page: Page) -> None:
    """The problems with their buttons, and the history of the draft."""
    desktop, draft = page.viewport_size, page.url
    page.set_viewport_size({"width": 390, "height": 844})
    page.get_by_role("button", name="Problems").first.click()
    fix = page.locator("#problems .fix").first
    assert fix.evaluate("button => button.scrollWidth <= button.clientWidth + 1"), "its words are inside the button"
    expect(page.locator("#save-state")).to_have_text("Saved")
    page.goto(f"{draft}/history")
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    page.goto(draft)
    page.set_viewport_size(desktop or DESKTOP)
    expect(page.locator("body[data-checked=yes]")).to_be_attached()
    page.locator("#form > details > summary", has_text="Kitchens and order").click()
