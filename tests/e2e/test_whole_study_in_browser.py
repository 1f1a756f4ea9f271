"""The whole way from the link to the code in a browser, every setting changed: by keyboard alone, by touch alone."""

from collections.abc import Iterator
from uuid import uuid4

import pytest
from playwright.sync_api import Browser

from server.store import participants, studies
from server.store.database import Database
from server.store.tables import episodes, events
from tests.support.browser.game_page import DESKTOP, PHONE, draw_less_often, screenshot
from tests.support.browser.single_input import KeyboardOnly, TouchOnly, take_part
from tests.support.real_server import ROOT, RealServer

pytestmark = [pytest.mark.browser, pytest.mark.timeout(280)]
STUDY = (ROOT / "tests" / "data" / "every_setting.yaml").read_text(encoding="utf-8")
# One round of each kitchen and agent is enough here, and pauses are counted on the quick clock too.
SHORTER = STUDY.replace(", repeat: 2}", "}").replace("each_s: 20, episode_s: 25", "each_s: 300, episode_s: 900")


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RealServer]:
    with RealServer(tmp_path_factory.mktemp("whole"), speed=4.0, study=SHORTER) as running:
        yield running


@pytest.fixture
def recruitment_id() -> str:
    """A new participant for each try: one who has begun continues where they stopped, without the consent page."""
    return f"p{uuid4().int % 10**12}"


def stored(server: RealServer, person: str) -> tuple[participants.Participant, list[str], list[str]]:
    """The participants of that link, how their games ended, and their events."""

    def look(connection):  # type: ignore[no-untyped-def]
        (study,) = studies.every(connection)
        me = participants.by_recruitment_id(connection, study.id, person)
        mine = connection.execute(episodes.select().where(episodes.c.participant_1 == me.id)).all()
        happened = connection.execute(events.select().where(events.c.participant_id == me.id)).all()
        return me, [f"{row.kind} {row.status}" for row in mine], [row.kind for row in happened]

    with Database(server.database, read_only=True) as database:
        found: tuple[participants.Participant, list[str], list[str]] = database.read_now(look)
        return found


@pytest.mark.slow
def test_the_whole_study_by_keyboard_alone(chromium: Browser, server: RealServer, recruitment_id: str) -> None:
    context = chromium.new_context(viewport=DESKTOP, locale="en-GB", reduced_motion="reduce")
    page = draw_less_often(context).new_page()
    person = KeyboardOnly(page)
    titles = take_part(person, f"{server.url}/s/every_setting?PID={recruitment_id}&WAVE=1")
    assert titles.count("game") == 5
    assert titles[-1] == "Thank you for cooking with us"
    assert page.inner_text("#code") == "DONE77"
    assert (
        page.get_attribute("main .actions a.btn", "href") == "https://app.prolific.com/submissions/complete?cc=DONE77"
    )
    assert "PID" not in page.url
    assert person.unseen == []
    me, games, happened = stored(server, recruitment_id)
    assert (me.status, me.language, me.completion_code in page.content()) == ("completed", "en", True)
    assert games == ["tutorial done"] + ["episode done"] * 4
    assert "attention_failed" not in happened
    page.context.close()


@pytest.mark.slow
def test_the_whole_study_by_touch_alone_in_chinese(chromium: Browser, server: RealServer, recruitment_id: str) -> None:
    context = chromium.new_context(
        viewport=PHONE, has_touch=True, is_mobile=True, locale="zh-CN", reduced_motion="reduce"
    )
    page = draw_less_often(context).new_page()
    person = TouchOnly(page)
    titles = take_part(person, f"{server.url}/s/every_setting?PID={recruitment_id}&WAVE=2")
    assert titles.count("game") == 5
    assert page.get_attribute("html", "lang") == "zh"
    assert page.inner_text("#code") == "DONE77"
    assert person.small == []
    screenshot(page, "thanks-phone-zh")
    me, games, _ = stored(server, recruitment_id)
    assert (me.status, me.language) == ("completed", "zh")
    assert games == ["tutorial done"] + ["episode done"] * 4
    page.context.close()


@pytest.mark.slow
def test_everything_that_they_stored_is_valid(server: RealServer) -> None:
    verified = server.command("verify")
    assert verified.returncode == 0, verified.stdout + verified.stderr
