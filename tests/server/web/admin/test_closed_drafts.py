"""A study from a draft that was closed, after a restart of the server."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

from server.participation.served_studies import Studies
from server.store import participants
from server.store import studies as stored_studies
from server.study.loader import load_study
from tests.server.participation.test_study_versions import OTHER_AGENT
from tests.support.draft_site import admin_site_fixture as admin_site_fixture
from tests.support.draft_site import asked, begun, opened, source, versions_of
from tests.support.draft_site import file as file
from tests.support.draft_site import site as site
from tests.support.page_site import PageSite, Visitor
from tests.support.researcher_site import signed_in


def closed_with_somebody_in_its_first_version(site: PageSite) -> None:
    """A study whose second version has other agents; everybody in that one is finished."""
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    opened(researcher, draft, 2)
    Visitor(site).consent("pilot")
    asked(researcher, draft, "save", text=source(site, draft).replace(*OTHER_AGENT), revision="2")
    opened(researcher, draft, 3)
    Visitor(site).consent("pilot")
    site.database.write_now(participants.leave, site.only("pilot").id, "returned")
    researcher.get(f"/admin/drafts/{draft}")
    assert "The study is closed" in researcher.post(f"/admin/drafts/{draft}/close", study="pilot").text


async def restarted(site: PageSite, file: Path, refuses: bool = False) -> tuple[Studies, set[Any]]:
    """What a server serves that starts now, and the agents that it loads. `refuses`: not the newest version."""
    studies = await Studies.opened(site.database, [load_study(file)])
    versions = versions_of(site.database, studies, file)
    if refuses:
        versions._refused.add((await site.database.read(stored_studies.every, "pilot"))[-1].sha256)
    await versions.begin(site.database)
    agents: set[Any] = versions._models.agents  # type: ignore[attr-defined]
    return studies, agents


def test_who_is_still_in_an_earlier_version_plays_with_its_models_after_a_restart(site: PageSite, file: Path) -> None:
    closed_with_somebody_in_its_first_version(site)
    studies, agents = asyncio.run(restarted(site, file))
    assert "pilot" in studies.names()
    assert {("matrix", "stay"), ("matrix", "random")} <= agents


def test_the_log_says_when_an_earlier_version_has_no_models(
    site: PageSite, file: Path, caplog: pytest.LogCaptureFixture
) -> None:
    closed_with_somebody_in_its_first_version(site)
    studies, _ = asyncio.run(restarted(site, file, refuses=True))
    assert "pilot" not in studies.names()
    assert "participants of an earlier version of pilot play without its models" in caplog.text
