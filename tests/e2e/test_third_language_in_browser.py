"""A third language is one more file: here an invented one, in which every text is 40 % longer. Nothing is cut off."""

import math
import re
from collections.abc import Iterator
from typing import Any

import pytest
import yaml
from playwright.sync_api import Browser, Page

from server.play.messages import Countdown, Ended, Lesson, Notice, Paused, Ready
from server.store import participants
from server.study import locale as locales
from server.study.locale import LOCALES
from tests.support.browser.fake_game_server import NONE, RINGS, FakeGameServer, kitchen, tick, welcome
from tests.support.browser.game_page import DESKTOP, PHONE, at_rest
from tests.support.page_site import SMALL_STUDY, PageSite

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]
LANGUAGE = "qps"
ACCENTS = str.maketrans("aceilnorsuyACEINORSUY", "àçëîłñöřšûýÀÇËÎÑÖŘŠÛÝ")
SIZES = pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desk", "phone"])

# Texts that reach out of what clips them, out of the window's sides, or into one another's button.
CUT = """() => {
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT), found = new Set();
  const out = (one, box, sideways) => one.left < box.left - 1 || one.right > box.right + 1
    || (!sideways && (one.top < box.top - 3 || one.bottom > box.bottom + 3));
  while (walker.nextNode()) {
    const text = walker.currentNode, parent = text.parentElement;
    if (!text.textContent.trim() || !parent.checkVisibility({ visibilityProperty: true })) continue;
    if (parent.closest('.hidden, .skip, noscript, script, option, canvas')) continue;
    if (parent.getBoundingClientRect().width <= 1) continue;  // there for screen readers only
    const range = document.createRange();
    range.selectNodeContents(text);
    for (const box of range.getClientRects()) {
      if (box.width < 1) continue;
      if (out(box, { left: 0, right: innerWidth }, true)) found.add(text.textContent.trim());
      for (let up = parent; up && up !== document.body; up = up.parentElement) {
        const style = getComputedStyle(up), edge = up.getBoundingClientRect();
        if (style.display === 'inline') continue;
        const shape = up.matches('button, .btn, kbd, .card');
        const clips = shape || style.overflowX !== 'visible' || style.overflowY !== 'visible';
        if (clips && out(box, edge, style.overflowY === 'auto')) found.add(text.textContent.trim());
        if (style.position === 'fixed') break;  // what it stands in does not clip it
      }
    }
  }
  return [...found];
}"""


def longer(words: str) -> str:
    """The same with accents and 40 % more; what is filled in stays as it is."""
    pieces = re.split(r"(\{\w+\})", words)
    grown = "".join(piece if piece.startswith("{") else piece.translate(ACCENTS) for piece in pieces)
    more = "ŵöřđø " * len(words)
    return f"{grown} {more[: math.ceil(0.4 * len(words)) - 1]}".strip() if len(words) > 2 else grown


def translated(part: Any) -> Any:
    if isinstance(part, dict):
        return {key: translated(value) for key, value in part.items()}
    return longer(str(part))


@pytest.fixture(scope="module", autouse=True)
def third_language(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """The platform with one file more."""
    folder = tmp_path_factory.mktemp("locales")
    for path in LOCALES.glob("*.yaml"):
        (folder / path.name).write_bytes(path.read_bytes())
    words = translated(yaml.safe_load((folder / "en.yaml").read_text("utf-8")))
    (folder / f"{LANGUAGE}.yaml").write_text(yaml.safe_dump(words, allow_unicode=True), encoding="utf-8")
    locales.LOCALES = folder
    forget()
    yield
    locales.LOCALES = LOCALES
    forget()


def forget() -> None:
    for function in (locales.locale, locales.languages, locales._words):
        function.cache_clear()


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory, third_language: None) -> Iterator[PageSite]:
    text = re.sub(
        r'\{en: ([^,{}"]+), zh:', lambda found: f'{{en: {found[1]}, {LANGUAGE}: "{longer(found[1])}", zh:', SMALL_STUDY
    )
    text = text.replace('{en: "Thank', f'{{{LANGUAGE}: "**X**", en: "Thank').replace(
        "[en, zh]", f"[en, zh, {LANGUAGE}]"
    )
    with PageSite(tmp_path_factory.mktemp("site"), text) as running:
        yield running


@pytest.mark.slow
@SIZES
def test_no_page_cuts_a_word_off(site: PageSite, chromium: Browser, size: dict[str, int]) -> None:
    context = chromium.new_context(viewport=size, has_touch=size is PHONE, locale="xx", reduced_motion="reduce")  # type: ignore[arg-type]
    page = context.new_page()
    cut: dict[str, list[str]] = {}

    def look(place: str) -> None:
        assert page.locator("html").get_attribute("lang") == LANGUAGE, place
        at_rest(page)
        if found := page.evaluate(CUT):
            cut[place] = found

    page.goto(f"{site.url}/?lang={LANGUAGE}")
    look("choose")
    for place in ("declined", "unsuitable", "withdraw"):
        page.goto(f"{site.url}/s/small/{place}?lang={LANGUAGE}")
        look(place)
    page.goto(f"{site.url}/s/small?lang={LANGUAGE}")
    page.wait_for_selector("#agree:enabled")
    look("consent")
    page.locator(".check input").check()
    page.click("#agree")
    page.wait_for_url("**/now")
    me = site.everybody("small")[-1]
    way = site.studies.steps_of(me)
    for index, step in enumerate(way[:-1]):
        if step.is_game or step.number > 2:
            continue
        me = site.everybody("small")[-1]
        site.database.write_now(participants.advance, me.id, me.position, index)
        page.goto(f"{site.url}/s/small/now")
        look(step.key)
        if page.locator("#go").count():
            page.click("#go")
            page.wait_for_selector("#alert:visible")
            look(f"{step.key} with something open")
    me = site.everybody("small")[-1]
    site.database.write_now(participants.advance, me.id, me.position, len(way) - 2)
    page.goto(f"{site.url}/s/small/now")
    page.click("main .btn")
    page.wait_for_selector("#code")
    look("thanks")
    context.close()
    assert cut == {}


@pytest.mark.slow
@SIZES
def test_no_state_of_the_game_cuts_a_word_off(chromium: Browser, size: dict[str, int]) -> None:
    server = FakeGameServer(language=LANGUAGE, lessons=["walk", "fetch", "fill", "wait", "plate", "deliver", "marks"])
    state = kitchen(t=194, players=((3, 3, 2, 1), (7, 3, 2, 3)), score=40, soups=2)
    server.welcome = welcome(grid=RINGS, tick_ms=5000, state=state, title=longer("Double Counters"), kind="tutorial")
    phone = {"has_touch": size is PHONE, "is_mobile": size is PHONE}
    context = chromium.new_context(viewport=size, reduced_motion="reduce", **phone)  # type: ignore[arg-type]
    page = context.new_page()
    cut: dict[str, list[str]] = {}

    def look(place: str, shown: str) -> None:
        page.wait_for_selector(shown)
        at_rest(page)
        if found := page.evaluate(CUT):
            cut[place] = found

    page.goto(server.url)
    look("start", "#start:visible")
    page.click("#start-button")
    server.wait_for(lambda server: bool(server.of(Ready)))
    server.send(Countdown(30))
    look("countdown", "#count:visible")
    server.send(tick(state, NONE))
    for number, lesson in enumerate(("walk", "fill", "plate", "marks")):
        server.send(Lesson(lesson, number, 7, False))
        look(f"lesson {lesson}", "#coach:visible, #lessons .how:visible")
    server.send(Notice(longer("The study continues.")))
    look("notice", "#notice:visible")
    page.locator("#notice button").click()
    if size is DESKTOP:
        page.click("#change-keys")
        look("keys", "#keys-dialog:visible")
        page.keyboard.press("Escape")
    for reason in ("blur", "lost", "other_tab", "server", "researcher"):
        server.send(Paused(reason, 20.0))
        look(f"paused {reason}", "#pause:visible")
    server.send(Paused("database", 0.0))
    look("database", "#banner:visible")
    server.send(Ended(40, 2, 0.0, True, "/blank", "horizon"))
    look("over", "#over:visible")
    context.close()
    server.close()
    assert cut == {}


def shown(page: Page) -> str:
    return page.inner_text("body")


def test_the_file_alone_makes_the_language(site: PageSite, chromium: Browser) -> None:
    page = chromium.new_page()
    page.goto(f"{site.url}/s/small")
    page.get_by_role("link", name=longer("English")).click()
    page.wait_for_url(f"**lang={LANGUAGE}*")
    assert longer("I agree – start") in shown(page)
    assert "I agree – start" not in shown(page).replace(longer("I agree – start"), "")
    page.context.close()
