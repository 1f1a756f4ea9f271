"""What the pages say of a study that was opened from a draft, and is paused or has another name."""

import re
import time
from types import SimpleNamespace

import msgspec
import pytest

from server.monitoring.peers import Process
from server.monitoring.rehearsals import Rehearsal
from server.store import interventions
from tests.support.draft_site import admin_site_fixture as admin_site_fixture
from tests.support.draft_site import asked, begun, opened, source
from tests.support.draft_site import file as file
from tests.support.draft_site import site as site
from tests.support.page_site import PageSite, Visitor
from tests.support.researcher_site import signed_in


def test_opening_a_study_that_is_paused_says_that_nobody_can_join_yet(site: PageSite) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    opened(researcher, draft, 2)
    site.database.write_now(interventions.pause_study, "pilot", "mara")
    researcher.post(f"/admin/drafts/{draft}/close", study="pilot")
    assert "Closed, paused" in researcher.get("/admin/s/pilot").text
    assert "but paused: participants can join when you resume it" in opened(researcher, draft, 2)


def test_a_study_whose_draft_was_renamed_and_opened_can_still_be_closed(site: PageSite) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    opened(researcher, draft, 2)
    renamed = source(site, draft).replace("name: pilot\n", "name: main\n")
    asked(researcher, draft, "save", text=renamed, revision="2")
    page = opened(researcher, draft, 3)
    assert "The study with its former name is open, too" in page
    assert f"{site.url}/s/pilot" in page
    assert '<dialog id="ask-close-pilot"' in page, "it asks for confirmation, as Close does"
    assert 'data-ask="close-pilot"' in page
    assert Visitor(site).get("/s/pilot").status_code == 200
    assert "The study is closed" in researcher.post(f"/admin/drafts/{draft}/close", study="pilot").text
    assert [Visitor(site).get(f"/s/{name}").status_code for name in ("pilot", "main")] == [409, 200]
    assert f"{site.url}/s/pilot" not in researcher.get(f"/admin/drafts/{draft}").text


def test_bots_and_previews_know_what_other_processes_do(site: PageSite, monkeypatch: pytest.MonkeyPatch) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    there: list[Process] = []

    async def processes() -> list[Process]:
        return there

    monkeypatch.setattr(site.services.live, "peers", SimpleNamespace(processes=processes))
    page = f"/admin/drafts/{draft}/bots"
    researcher.get(page)
    there = [Process("other", {"games": 1.0})]
    assert "participants are playing" in researcher.post(page, number="4").text
    preview = researcher.get(f"/admin/drafts/{draft}/preview").text
    games = re.findall(r'href="(/admin/drafts/[^"]+/preview/\w+/en/\d+)"', preview)
    played = next(step for step in games if f'href="{step}/play"' in researcher.get(step).text)
    assert "participants are playing" in researcher.get(f"{played}/play").text
    researcher.get(page)
    there = [Process("other", {}, rehearsals=(Rehearsal(draft, 2, 7, "mara"),))]
    assert "7 bots, revision 2" in researcher.get(page).text
    assert "They began" not in researcher.get(page).text
    there = [Process("other", {}, rehearsals=(Rehearsal(draft, 2, 7, "mara", began_at=time.time() - 150),))]
    assert "They began 2 minutes ago; they are stopped after 30 minutes." in " ".join(researcher.get(page).text.split())
    there = [Process("other", {}, rehearsals=(Rehearsal(draft + 1, 2, 7, "mara"),))]
    researcher.get(page)
    assert "another rehearsal is running" in researcher.post(page, number="4").text
    assert msgspec.json.decode(msgspec.json.encode(there[0]), type=Process) == there[0], "as it is sent"
