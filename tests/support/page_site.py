"""The participant's pages over real HTTP and a real database, without the live game: its episodes are ended by hand."""

import asyncio
import re
import socket
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from html import unescape
from pathlib import Path
from typing import Any, cast
from urllib.parse import urlencode

import httpx
import uvicorn
from fastapi import FastAPI
from fastapi.staticfiles import StaticFiles

from server.cluster.command_dispatch import ClusterControl
from server.monitoring.control import Control
from server.participation.episode_specs import episode_spec
from server.participation.served_studies import Studies
from server.play.recorder import EpisodeResult
from server.settings import ROOT
from server.store import episodes, participants
from server.store.database import Database
from server.store.participants import Participant
from server.study.loader import parse_study
from server.study.steps import StudyStep
from server.web.csrf import CsrfProtection
from server.web.dependencies import Web, templates
from server.web.error_pages import install_error_pages
from server.web.participant import exits, study_pages
from server.web.security_headers import SecurityHeaders
from server.web.services import Services
from tests.support.databases import with_tables
from tests.support.some_services import some_services

SMALL_STUDY = (ROOT / "tests" / "data" / "small_study.yaml").read_text(encoding="utf-8")
SECRET = b"a secret for tests only, never served"


class NoGames(dict[str, Any]):
    """No game runs here."""

    async def taken_up(self, episode: str) -> None:
        """Return no game."""


class PageSite:
    """A running server with some studies."""

    def __init__(self, folder: Path, *texts: str) -> None:
        self.database = Database(with_tables(folder / "site.db"))
        files = [parse_study(text) for text in texts]
        with ThreadPoolExecutor(1) as other:  # a browser's event loop may be running in this thread
            self.studies = other.submit(asyncio.run, Studies.opened(self.database, files)).result()
        self.app = FastAPI(openapi_url=None)
        self.app.add_middleware(SecurityHeaders)
        self.app.mount("/static", StaticFiles(directory=ROOT / "static"))
        install_error_pages(self.app)
        self.app.include_router(study_pages.router)
        self.app.include_router(exits.router)
        control = Control(cast(Any, NoGames()), self.database, self.studies)
        web = Web(self.database, self.studies, CsrfProtection(SECRET), templates())
        self.use(some_services(web=web, control=ClusterControl(control)))
        self.clients: list[httpx.Client] = []
        self._server = uvicorn.Server(uvicorn.Config(self.app, log_level="warning", ws="websockets-sansio"))

    @property
    def services(self) -> Services:
        services: Services = self.app.state.services
        return services

    def use(self, services: Services) -> None:
        """From the next request on."""
        self.app.state.services = services

    def __enter__(self) -> "PageSite":
        listening = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{listening.getsockname()[1]}"
        self._thread = threading.Thread(target=self._server.run, args=([listening],), daemon=True)
        self._thread.start()
        while not self._server.started:
            time.sleep(0.01)
        return self

    def __exit__(self, *_: object) -> None:
        for client in self.clients:
            client.close()
        self._server.should_exit = True
        self._thread.join()
        self.database.close()

    def everybody(self, name: str) -> list[Participant]:
        found = self.studies.open(name)
        assert found is not None
        return self.database.read_now(participants.of_study, found[0])

    def only(self, name: str) -> Participant:
        (participant,) = self.everybody(name)
        return participant

    def step(self, participant: Participant) -> StudyStep:
        fresh = self.database.read_now(participants.get, participant.id)
        assert fresh is not None
        return self.studies.step(fresh)

    def end_game(self, participant: Participant, passed: bool = True, status: str = "done") -> None:
        """Store the current game as played to its end."""
        study, step = self.studies.of(participant), self.step(participant)
        spec = episode_spec(study, step, participant.condition, "en")
        new = episodes.NewEpisode(spec, step.key, (participant.id, None), participant.study_id, participant.condition)
        episode = self.database.write_now(episodes.create, new)
        result = EpisodeResult(episode, status, "horizon", 60, 3, 9.0, passed, "0" * 16)  # type: ignore[arg-type]
        self.database.write_now(episodes.end, result)


class Visitor:
    """A browser without a screen: follows redirects, keeps cookies, sends the forms that it was shown."""

    def __init__(self, site: PageSite, headers: dict[str, str] | None = None) -> None:
        base = {"accept": "text/html", "accept-language": "en"}
        self.client = httpx.Client(base_url=site.url, headers=base | (headers or {}), follow_redirects=True, timeout=60)
        site.clients.append(self.client)
        self.page: httpx.Response

    def get(self, path: str) -> httpx.Response:
        self.page = self.client.get(path)
        return self.page

    def fields(self, action: str = "") -> dict[str, str]:
        """The hidden fields of the form on the page (the one whose action ends so)."""
        forms = re.findall(r'<form[^>]*action="([^"]*)"[^>]*>(.*?)</form>', self.page.text, re.S)
        (inside,) = [inside for target, inside in forms if target.endswith(action or "/now")]
        pairs = re.findall(r'<input\s+type="hidden"\s+name="([^"]*)"\s+value="([^"]*)"', inside)
        return {unescape(name): unescape(value) for name, value in pairs}

    def send(self, path: str, fields: dict[str, str] | list[tuple[str, str]]) -> httpx.Response:
        body = urlencode(fields)
        self.page = self.client.post(path, content=body, headers={"content-type": "application/x-www-form-urlencoded"})
        return self.page

    def consent(self, name: str, query: str = "") -> httpx.Response:
        self.get(f"/s/{name}{query}")
        boxes = dict.fromkeys(re.findall(r'name="(box_\d+)"', self.page.text), "yes")
        return self.send(f"/s/{name}/consent", self.fields("/consent") | boxes)

    def submit(self, name: str, **answers: str | list[str]) -> httpx.Response:
        """Send the current page's form with these answers; `a__b` stands for the field `a.b`."""
        pairs = list(self.fields().items())
        for key, value in answers.items():
            pairs += [(key.replace("__", "."), one) for one in ([value] if isinstance(value, str) else value)]
        return self.send(f"/s/{name}/now", pairs)


EVERYTHING: dict[str, str | list[str]] = {
    "mood": "4", "check": "2", "pick": "tea", "many": ["a", "c"], "words": "=1+1", "years": "30",
    "rank__x": "3", "rank__y": "1", "rank__z": "2",
}  # fmt: skip
