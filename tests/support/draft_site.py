"""Drafts of studies on the researchers' pages, as the tests of them make and open some."""

from contextlib import AsyncExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import pytest

from server.monitoring.rehearsals import Rehearsals
from server.participation.served_studies import Studies
from server.participation.study_versions import StudyVersions
from server.settings import Settings
from server.store import study_drafts
from server.store.database import Database
from server.study.loader import load_study
from server.web.admin import draft_routes
from tests.server.participation.test_study_versions import AddedModels
from tests.support.page_site import SMALL_STUDY, PageSite
from tests.support.researcher_site import Researcher
from tests.support.researcher_site import site as admin_site

admin_site_fixture = admin_site


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "small.yaml"
    path.write_text(SMALL_STUDY, encoding="utf-8")
    return path


async def nobody() -> list[Any]:
    """The other processes."""
    return []


def versions_of(database: Database, studies: Studies, file: Path, several: bool = False) -> StudyVersions:
    settings = Settings(data=file.parent, database=f"sqlite:///{file.parent}/site.db")
    models: Any = AddedModels()
    return StudyVersions(settings, [load_study(file)], models, studies, nobody if several else None)


@pytest.fixture
def site(admin_site_fixture: PageSite, file: Path) -> PageSite:
    made = admin_site_fixture
    versions, stack = versions_of(made.database, made.studies, file), AsyncExitStack()
    made.use(replace(made.services, versions=versions, rehearsals=Rehearsals(stack), games=[]))  # type: ignore[arg-type]
    made.app.include_router(draft_routes.router)
    return made


def begun(site: PageSite, researcher: Researcher, name: str = "pilot") -> int:
    """A draft that is made from the shortest template; its number."""
    researcher.get("/admin/drafts/new")
    page = researcher.post("/admin/drafts", template="quick_look", name=name, title="A pilot")
    assert page.status_code == 200, page.text[:400]
    (draft, *_) = site.database.read_now(study_drafts.every)
    assert page.url.path == f"/admin/drafts/{draft.id}"
    # The small study has agents that need no weights.
    text = SMALL_STUDY.replace("name: small", f"name: {name}")
    assert asked(researcher, draft.id, "save", text=text, revision="1")[0] == 200
    researcher.get(f"/admin/drafts/{draft.id}")
    return draft.id


def asked(researcher: Researcher, draft: int, route: str, **fields: str) -> tuple[int, Any]:
    """Send what the page's script sends."""
    body = urlencode({"form_token": researcher.token(), **fields})
    headers = {"content-type": "application/x-www-form-urlencoded", "accept": "application/json"}
    answer = researcher.client.post(f"/admin/drafts/{draft}/{route}", content=body, headers=headers)
    return answer.status_code, answer.json()


def source(site: PageSite, draft: int) -> str:
    found = site.database.read_now(study_drafts.get, draft)
    assert found is not None
    return found.source


def opened(researcher: Researcher, draft: int, revision: int) -> str:
    researcher.get(f"/admin/drafts/{draft}")
    return researcher.post(f"/admin/drafts/{draft}/open", revision=str(revision)).text
