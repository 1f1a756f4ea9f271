"""Two server processes with one PostgreSQL and one Redis: versions and drafts of a study are the same in both."""

import re
from pathlib import Path
from typing import Any

import httpx
import pytest

from models.inference.supervised_worker import ModelsDown
from server.bots.participant import Bot
from server.store import admins, study_drafts
from server.store.study_drafts import DraftText
from server.web.passwords import hashed
from tests.support.live_server import LiveServer
from tests.support.server_pair import PAIR_STUDY, Pair, until

pytestmark = pytest.mark.postgres


def change_the_study(folder: Path) -> None:
    """As an editor would, while both servers run."""
    path = folder / "short.yaml"
    path.write_text(path.read_text("utf-8").replace("A short study", "A newer study"), encoding="utf-8")


def opened(live: LiveServer, study: str = "short") -> Any:
    """The number of the version that this server lets people into."""
    found = live.app.state.services.web.studies.open(study)
    return found[0] if found else None


def signed_in(live: LiveServer, role: str = "act") -> httpx.Client:
    """A researcher at this server."""
    database, password = live.app.state.services.web.database, "a password for the tests"
    live.do(lambda: database.write(admins.create, "ada", hashed(password), role))
    client = httpx.Client(base_url=live.url, follow_redirects=True, timeout=60)
    form = {"form_token": token_in(client.get("/admin/login").text), "name": "ada", "password": password}
    assert client.post("/admin/login", data=form).status_code == 200
    return client


def token_in(page: str) -> str:
    """The hidden field that every form needs."""
    found = re.search(r'name="form_token" value="([^"]+)"', page)
    assert found is not None
    return found[1]


async def test_one_click_serves_the_new_version_of_a_study_in_every_process(pair: Pair, tmp_path: Path) -> None:
    here, there = pair
    await until(lambda: all(live.do(live.app.state.services.live.peers.processes) for live in pair))
    before = opened(here)
    assert opened(there) == before
    change_the_study(tmp_path)
    researcher = signed_in(here)
    form = {"form_token": token_in(researcher.get("/admin/s/short").text)}
    assert "The new version is served" in researcher.post("/admin/s/short/version", data=form).text
    await until(lambda: opened(there) != before)
    assert opened(there) == opened(here) != before


async def test_a_version_that_not_every_process_can_serve_is_served_by_none(
    pair: Pair, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here, there = pair
    await until(lambda: all(live.do(live.app.state.services.live.peers.processes) for live in pair))
    before = opened(here)
    change_the_study(tmp_path)
    monkeypatch.setattr(there.models, "add", broken)
    researcher = signed_in(here)
    form = {"form_token": token_in(researcher.get("/admin/s/short").text)}
    assert "could not be served" in researcher.post("/admin/s/short/version", data=form).text
    assert opened(here) == opened(there) == before


async def broken(*_: Any) -> None:
    raise ModelsDown("planner cannot be used: pretends to be broken")


async def test_a_participant_of_a_version_that_one_process_serves_is_known_in_all(pair: Pair, tmp_path: Path) -> None:
    here, there = pair
    change_the_study(tmp_path)
    services = here.app.state.services
    services.versions.open(here.do(lambda: services.versions.prepare_file(services.web.database, "short")))
    visitor = Bot(here.url, "short", 1)
    await visitor.consent()
    found = httpx.get(f"{there.url}/s/short/now", cookies={"participant": visitor.token})
    assert found.status_code == 200, "sent away to consent again"
    assert "A newer study" in found.text
    await until(lambda: opened(there) == opened(here))  # nobody told it: it has seen what the other serves
    await visitor.close()


async def test_a_draft_that_is_opened_in_one_process_is_served_changed_and_closed_in_the_other(pair: Pair) -> None:
    here, there = pair
    await until(lambda: all(live.do(live.app.state.services.live.peers.processes) for live in pair))
    researcher, database = signed_in(here, "own"), here.app.state.services.web.database
    text = PAIR_STUDY.replace("name: short", "name: drafted")
    number = here.do(lambda: database.write(study_drafts.create, DraftText("ada", text, "drafted", note="created")))
    draft = f"/admin/drafts/{number}"

    def click(what: str, **fields: str) -> str:
        form = {"form_token": token_in(researcher.get(draft).text), **fields}
        return researcher.post(f"{draft}/{what}", data=form).text

    assert opened(there, "drafted") is None
    assert "The study is open: participants can join." in click("open", revision="1")
    await until(lambda: opened(there, "drafted") is not None)
    assert opened(there, "drafted") == opened(here, "drafted")
    early = Bot(there.url, "drafted", 1)
    await early.consent()
    newer = DraftText("ada", text.replace("A short study", "A newer study"), "drafted", 1)
    here.do(lambda: database.write(study_drafts.save, number, newer))
    before = opened(there, "drafted")
    click("open", revision="2")
    await until(lambda: opened(there, "drafted") not in (None, before))
    kept = httpx.get(f"{here.url}/s/drafted/now", cookies={"participant": early.token})
    assert "A short study" in kept.text, "who has begun keeps the version, in every process"
    assert "A newer study" in httpx.get(f"{there.url}/s/drafted").text
    click("close", study="drafted")
    late = httpx.get(f"{there.url}/s/drafted")
    assert "form_token" not in late.text, "nobody new is let in"
    assert httpx.get(f"{there.url}/s/drafted/now", cookies={"participant": early.token}).status_code == 200
    await early.close()
    researcher.close()
