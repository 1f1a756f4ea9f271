"""A study file that changes while it is served is reported, and its new version can be served without a restart."""

import asyncio
import os
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from models.inference.supervised_worker import ModelsDown
from server.monitoring.alerts import Alerts
from server.monitoring.peers import Process
from server.participation.served_studies import Studies
from server.participation.study_changes import ServedVersion
from server.participation.study_versions import StudyVersions
from server.settings import Settings
from server.store import audit
from server.study.loader import StudyError, load_study
from tests.support.page_site import SMALL_STUDY, PageSite, Visitor
from tests.support.researcher_site import signed_in
from tests.support.researcher_site import site as admin_site

site = admin_site
OTHER_AGENT = ("name: stay, predictor: random", "name: random, predictor: random")


class AddedModels:
    """Remembers what was to be loaded."""

    def __init__(self) -> None:
        self.agents: set[Any] = set()
        self.broken = False

    async def add(self, agents: Any, predictors: Any, grids: Any, paths: Any) -> None:
        if self.broken:
            raise ModelsDown("stay cannot be used on matrix: pretends to be broken")
        self.agents |= set(agents)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "small.yaml"
    path.write_text(SMALL_STUDY, encoding="utf-8")
    return path


@pytest.fixture
def models() -> AddedModels:
    return AddedModels()


@pytest.fixture
def versions(site: PageSite, file: Path, models: AddedModels) -> StudyVersions:
    settings = Settings(database=f"sqlite:///{file.parent}/site.db")
    made = StudyVersions(settings, [load_study(file)], models, site.studies)  # type: ignore[arg-type]
    site.use(replace(site.services, versions=made))
    return made


def change(file: Path, old: str, new: str) -> None:
    text = file.read_text("utf-8")
    assert old in text
    file.write_text(text.replace(old, new), encoding="utf-8")
    later = file.stat().st_mtime_ns + 10**9  # as an editor would: later than the version before
    os.utime(file, ns=(later, later))


def test_a_changed_file_is_reported_with_its_problems_until_it_is_as_served(
    versions: StudyVersions, file: Path, site: PageSite, tmp_path: Path
) -> None:
    told: list[str] = []
    alerts = Alerts(
        site.services.live, tmp_path / "site.db", lambda alert, over: told.append(f"{over} {alert.text}"), versions
    )
    versions.find_changes()
    assert versions.changed == {}
    change(file, "seed: 11", "seed: 12")
    versions.find_changes()
    asyncio.run(alerts.check())
    assert told[-1].startswith("False small: the study file has changed (now ")
    assert "The dashboard of the study offers the new version." in told[-1]
    change(file, "seed: 12", "sed: 12")
    versions.find_changes()
    assert "unknown key 'sed'" in versions.changed["small"].problem
    change(file, "sed: 12", "seed: 12")
    change(file, "planner, predictor: random", "planner, predictor: mistyped")
    versions.find_changes()
    assert (
        "the kitchen coordination_ring has no trained predictor called 'mistyped'" in versions.changed["small"].problem
    )
    file.write_text(SMALL_STUDY, encoding="utf-8")
    os.utime(file, ns=(10**18, 10**18))
    versions.find_changes()
    assert versions.changed == {}
    asyncio.run(alerts.check())
    assert told[-1].startswith("True ")


def test_the_dashboard_offers_the_new_version_and_serves_it_to_those_who_come_then(
    site: PageSite, versions: StudyVersions, file: Path, models: AddedModels
) -> None:
    Visitor(site).consent("small")
    (early,) = site.everybody("small")
    watcher, researcher = signed_in(site, "watch"), signed_in(site, "act")
    offer = "Serve the new version"
    assert offer not in researcher.get("/admin/s/small").text
    change(file, *OTHER_AGENT)
    versions.find_changes()
    assert offer not in watcher.get("/admin/s/small").text
    assert offer in researcher.get("/admin/s/small").text
    answer = researcher.post("/admin/s/small/version", note="another agent")
    assert "The new version is served" in answer.text
    assert offer not in answer.text
    Visitor(site).consent("small")
    (late,) = site.everybody("small")
    assert late.study_id != early.study_id
    assert [agent.name for agent in site.studies.of(late).agents] == ["planner", "random"]
    assert [agent.name for agent in site.studies.of(early).agents] == ["planner", "stay"]
    assert {("matrix", "random"), ("matrix", "stay")} <= models.agents
    entries = site.database.read_now(audit.entries)
    assert (entries[-1].action, entries[-1].detail["reason"]) == ("serve new version", "another agent")


def test_the_list_of_studies_shows_their_names(site: PageSite) -> None:
    assert re.search(r"<code[^>]*>small</code>", signed_in(site, "watch").get("/admin").text)


def test_a_version_whose_models_do_not_load_changes_nothing(
    site: PageSite, versions: StudyVersions, file: Path, models: AddedModels
) -> None:
    before = site.studies.open("small")
    change(file, *OTHER_AGENT)
    versions.find_changes()
    models.broken = True
    researcher = signed_in(site, "act")
    researcher.get("/admin/s/small")
    assert "could not be served" in researcher.post("/admin/s/small/version").text
    assert site.studies.open("small") == before
    with pytest.raises(StudyError, match="pretends to be broken"):
        asyncio.run(versions.prepare_file(site.database, "small"))


def test_models_of_an_earlier_version_are_loaded_for_those_who_are_still_in_it(
    site: PageSite, file: Path, models: AddedModels
) -> None:
    Visitor(site).consent("small")
    change(file, *OTHER_AGENT)
    newest = load_study(file)
    settings = Settings(database=f"sqlite:///{file.parent}/site.db")
    versions = StudyVersions(settings, [newest], models, site.studies)  # type: ignore[arg-type]
    asyncio.run(versions.load_earlier(site.database))
    assert ("matrix", "stay") in models.agents


def test_a_process_that_is_started_again_serves_what_the_others_serve(
    site: PageSite, file: Path, models: AddedModels
) -> None:
    at_the_start = site.studies.open("small")
    served = ServedVersion("small", load_study(file).sha256, 0.0)
    change(file, *OTHER_AGENT)
    newest = load_study(file)
    studies = asyncio.run(Studies.opened(site.database, [newest]))
    assert studies.open("small") != at_the_start

    async def others() -> list[Process]:
        return [Process("another", {}, served=(served,))]

    settings = Settings(database=f"sqlite:///{file.parent}/site.db")
    versions = StudyVersions(settings, [newest], models, studies, others)  # type: ignore[arg-type]
    asyncio.run(versions.begin(site.database, joins=True))
    assert studies.open("small") == at_the_start
    versions.find_changes()
    assert versions.changed["small"].sha256 == newest.sha256
