"""The report from the dashboard: made in a separate process, kept, opened under a strict policy, downloaded."""

import asyncio
import base64
import hashlib
import io
import os
import re
import subprocess
import sys
import time
import zipfile
from contextlib import AsyncExitStack
from dataclasses import replace
from datetime import timedelta
from typing import Any

import pytest
from sqlalchemy import Connection

from server.monitoring import report_making
from server.monitoring.report_making import StudyReports
from server.store import audit, participants, study_reports
from server.store.withdrawal import withdraw
from server.web.admin import report_pages
from tests.support.page_site import PageSite
from tests.support.researcher_site import Researcher, signed_in
from tests.support.researcher_site import site as admin_site
from tests.support.study_data import fill

admin_site_fixture = admin_site
TIMEOUT_S = 240
BASE = "/admin/s/small"


@pytest.fixture
def site(admin_site_fixture: PageSite) -> PageSite:
    made = admin_site_fixture
    reports = StudyReports(made.database, str(made.services.settings.database), AsyncExitStack())
    made.use(replace(made.services, reports=reports))
    made.app.include_router(report_pages.router)
    return made


def people_and_a_bot(connection: Connection) -> str:
    """Six people who finished the study, and a simulated participant; returns the id of one person."""
    study_id = fill(connection, people=6, key="small", timesteps=20)
    found = participants.of_study(connection, study_id)
    for person in found:
        participants.complete(connection, person.id, "KM-1")
    bot = participants.NewParticipant(study_id, "tom", 5, participants.new_token(), simulated=True)
    participants.create(connection, bot)
    return found[0].id


def seeing(site: PageSite, name: str = "act") -> Researcher:
    """Signed in, with blind mode off."""
    researcher = signed_in(site, name)
    researcher.get(BASE)
    researcher.post("/admin/blind", blind="off", next=BASE)
    return researcher


def state(researcher: Researcher) -> dict[str, Any]:
    answer = researcher.client.get(f"{BASE}/report.json")
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


def ended(researcher: Researcher) -> dict[str, Any]:
    """The state when nothing is being made."""
    until = time.monotonic() + TIMEOUT_S
    while (found := state(researcher))["stage"]:
        assert time.monotonic() < until, found
        time.sleep(0.1)
    return found


def test_a_report_is_made_of_people_only_kept_opened_and_downloaded(site: PageSite) -> None:
    person = site.database.write_now(people_and_a_bot)
    researcher = seeing(site)
    assert state(researcher) == {"stage": "", "failure": "", "kept": None, "missing": ""}
    token = researcher.token()
    assert researcher.client.get(f"{BASE}/report.html").status_code == 404
    assert researcher.post(f"{BASE}/report", token).json()["stage"] == report_making.STAGES[0]
    assert researcher.post(f"{BASE}/report", token).status_code == 503
    found = ended(researcher)
    assert found["failure"] == ""
    assert {key: found["kept"][key] for key in ("by", "participants", "simulated")} == {
        "by": "act",
        "participants": 6,
        "simulated": False,
    }
    page = researcher.get(f"{BASE}/report.html")
    assert "1 simulated participants of this data set are left out" in page.text
    check_policy(page.headers["content-security-policy"], page.text)
    archive = researcher.post(f"{BASE}/report.zip", token)
    assert 'filename="small-report.zip"' in archive.headers["content-disposition"]
    names = zipfile.ZipFile(io.BytesIO(archive.content)).namelist()
    assert {"report.html", "results.csv", "quality.csv", "figures/reward.png"} <= set(names)
    noted = [entry.action for entry in site.database.read_now(audit.entries) if entry.actor == "act"]
    assert noted[-2:] == ["report", "download report"]
    assert site.database.write_now(withdraw, person)
    assert state(researcher)["kept"] is None
    assert researcher.get(f"{BASE}/report.html").status_code == 404


def check_policy(policy: str, page: str) -> None:
    """The page may load nothing and run its own script alone, apart from the dashboard's origin."""
    (script,) = re.findall(r"<script>(.*?)</script>", page, re.S)
    hashed = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    rules = {words[0]: words[1:] for words in (rule.split() for rule in policy.split(";"))}
    assert rules["default-src"] == ["'none'"]
    assert rules["script-src"] == [f"'sha256-{hashed}'"]
    assert rules["sandbox"] == ["allow-scripts"]
    assert rules["frame-ancestors"] == rules["form-action"] == rules["base-uri"] == ["'none'"]


@pytest.mark.slow
def test_data_without_a_report_are_a_failure_with_its_reason(site: PageSite) -> None:
    researcher = seeing(site)
    researcher.post(f"{BASE}/report")
    found = ended(researcher)
    assert found["kept"] is None
    assert "participants" in found["failure"]
    assert "Traceback" not in found["failure"]


def test_a_report_is_for_those_who_may_export_and_not_in_blind_mode(site: PageSite) -> None:
    for name, status in (("watch", 403), ("act", 409)):
        researcher = signed_in(site, name)
        page = researcher.get(BASE).text
        assert "report-dialog.js" not in page
        token = researcher.token()
        for route in ("report", "report.zip"):
            assert researcher.post(f"{BASE}/{route}", token).status_code == status
        for route in ("report.json", "report.html"):
            assert researcher.client.get(f"{BASE}/{route}").status_code == status
    researcher = seeing(site)
    assert "report-dialog.js" in researcher.get(BASE).text
    assert researcher.post("/admin/s/..%2f..%2fsecret/report", researcher.token()).status_code == 404


def test_where_packages_are_missing_the_command_that_installs_them_is_shown(
    site: PageSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(report_making, "find_spec", lambda name: None)
    researcher = seeing(site)
    assert state(researcher)["missing"] == "make setup"
    answer = researcher.post(f"{BASE}/report")
    assert answer.status_code == 409
    assert "make setup" in answer.text


def test_a_process_that_says_nothing_is_known_to_run_and_ends_with_the_server(
    site: PageSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[subprocess.Popen[bytes]] = []

    def sleeping(*_: str, **__: Any) -> subprocess.Popen[bytes]:
        started.append(subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"]))
        return started[0]

    monkeypatch.setattr(report_making, "start_module", sleeping)
    monkeypatch.setattr(study_reports, "SEEN_EVERY", timedelta())

    async def run() -> None:
        async with AsyncExitStack() as stack:
            reports = StudyReports(site.database, "", stack)
            assert await reports.start("small", "mara")
            assert not await reports.start("other", "ben")
            begun, _ = await site.database.read(study_reports.newest, "small")
            seen = begun
            while begun is not None and seen is not None and seen.seen_at == begun.seen_at:
                await asyncio.sleep(0.05)
                seen, _ = await site.database.read(study_reports.newest, "small")

    asyncio.run(run())
    assert started[0].returncode is not None
    with pytest.raises(ProcessLookupError):
        os.kill(started[0].pid, 0)
