"""A researcher opens a file of recorded games in a real browser, and watches one."""

import re
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from tests.support import command_line
from tests.support.browser.game_page import draw_less_often, screenshot, violations
from tests.support.live_server import LiveServer

pytestmark = [pytest.mark.browser, pytest.mark.timeout(180)]
PEOPLE = Path(__file__).parents[1] / "data" / "cramped_room_train.jsonl.gz"


@pytest.mark.slow
def test_games_of_people_are_opened_watched_and_not_stored(chromium: Browser, tmp_path: Path) -> None:
    with LiveServer(tmp_path) as server:
        words = ("admin", "--database", server.database, "create", "mara", "--role", "watch")
        made = re.search(r"password: (\S+)", command_line.run(*words).stdout)
        assert made
        context = draw_less_often(chromium.new_context(viewport={"width": 1366, "height": 768}))
        page = context.new_page()
        page.set_default_timeout(60_000)
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(f"{server.url}/admin/recordings")
        page.fill("[name=name]", "mara")
        page.fill("[name=password]", made[1])
        page.click("main button")
        page.goto(f"{server.url}/admin/recordings")
        page.set_input_files("#file", {"name": "other.jsonl", "mimeType": "", "buffer": b'{"k": "s"}\n'})
        expect(page.locator("#status")).to_contain_text("other.jsonl, line 1: a state comes before", timeout=60_000)
        page.set_input_files("#file", PEOPLE)
        expect(page.locator("#status")).to_have_text(
            f"{PEOPLE.name}: 8 games. All states follow from the rules.", timeout=60_000
        )
        expect(page.locator("#episode option").nth(1)).to_have_text(re.compile("2: cramped_room, 1204 timesteps, "))
        page.select_option("#episode", "1")
        page.fill("#scrub", "600")
        expect(page.locator("#kitchen")).to_have_attribute("data-timestep", "600")
        page.click("#forward")
        expect(page.locator("#at")).to_have_text("t 601")
        assert page.locator("#frame th").all_inner_texts()[1:] == ["Blue did", "Green did"]
        assert violations(page) == []
        screenshot(page, "recordings")
        assert errors == []
        context.close()
