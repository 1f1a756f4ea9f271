"""The introduction in a real browser: slides by keyboard and swipe, controls of the device, kitchens drawn."""

from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from tests.support.browser.person import DESK, PHONE, BrowserPerson, answer_everything, heading
from tests.support.page_site import SMALL_STUDY, PageSite


@pytest.mark.slow
def test_introduction_returns_to_its_slide_and_continues_by_keyboard(person: BrowserPerson) -> None:
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


@pytest.mark.slow
def test_arrow_keys_turn_the_slides_and_stop_at_both_ends(person: BrowserPerson) -> None:
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


@pytest.mark.slow
def test_swipes_turn_the_slides_and_scrolling_does_not(person: BrowserPerson) -> None:
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


@pytest.mark.slow
def test_kitchens_are_named_and_drawn(person: BrowserPerson) -> None:
    page = person.consent().jump("ready-02").page
    name = page.locator("p.kitchen").bounding_box()
    assert name is not None
    assert name["height"] < 50, "as high as its line, not as the pictures of kitchens"
    expect(page.locator("#scene")).to_have_attribute(
        "aria-label", "The kitchen called Ring with both chefs at their starting places"
    )
    page.wait_for_function("document.getElementById('scene').width > 448")
    colours = page.evaluate(COLOURS)
    assert colours > 30


GREEN = """() => {
    const canvas = document.getElementById('scene');
    const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
    let green = 0;
    for (let i = 0; i < data.length; i += 4) green += data[i + 1] > data[i] + 60 && data[i + 1] > data[i + 2] + 40;
    return green;
}"""


@pytest.mark.slow
def test_the_scene_draws_as_many_steps_as_the_rounds(chromium: Browser, tmp_path: Path) -> None:
    greens = []
    arms = "  - {name: without, predictor: none}\n  - {name: with, predictor: tom}\n"
    studies = [
        SMALL_STUDY.replace("name: small", f"name: steps{steps}", 1)
        .replace(arms, f"  - {{name: with, predictor: tom, steps_shown: {steps}}}\n")
        .replace("flow: [everything, introduction", "flow: [introduction, everything")
        for steps in (1, 2, 3)
    ]
    with PageSite(tmp_path, *studies) as running:
        for steps in (1, 2, 3):
            context = chromium.new_context(viewport=DESK, reduced_motion="reduce", bypass_csp=True)
            page = context.new_page()
            page.goto(f"{running.url}/s/steps{steps}")
            page.locator(".check input").check()
            page.click("#agree")
            page.locator("#dots button").last.click()
            expect(page.locator("#slide-marks")).to_be_visible()
            page.wait_for_function("document.getElementById('scene').width > 448")
            greens.append(page.evaluate(GREEN))
            context.close()
    assert greens[0] < greens[1] < greens[2], "the last moment of the scene, with one to three marks"


def test_the_introduction_teaches_the_controls_of_the_device(chromium: Browser, site: PageSite) -> None:
    for touch, words in ((True, "tap Use"), (False, "press space")):
        context = chromium.new_context(viewport=PHONE if touch else DESK, has_touch=touch, is_mobile=touch)
        page = BrowserPerson(site, context).consent().page
        answer_everything(page)
        page.click("#go")
        for slide in ("fetch", "fill", "deliver"):
            text = page.locator(f"#slide-{slide} .text")
            expect(text).to_contain_text(words)
            if touch:
                expect(text).not_to_contain_text("space")
        context.close()
