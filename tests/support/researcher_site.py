"""A site of the researchers' pages with one researcher of each role, and what they do there."""

import asyncio
import re
from collections.abc import Iterator
from html import unescape
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import httpx
import pytest
from argon2 import PasswordHasher
from fastapi.routing import APIRoute

from overcooked.constants import STAY
from server.cluster.command_dispatch import ClusterControl
from server.monitoring.alerts import Alerts
from server.monitoring.control import Control
from server.monitoring.dashboard import Dashboard
from server.monitoring.latency_history import LatencyHistory
from server.monitoring.live_games import LiveGames
from server.participation.episode_specs import episode_spec, layout_of
from server.play.clock import Clock
from server.play.recorder import TickRecord
from server.play.simulation import Simulation
from server.settings import Settings
from server.store import admins, episodes, ticks
from server.web.admin import actions, downloads, live_boards, replay_page, researcher_pages
from server.web.guess_limits import Hashing
from server.web.participant.game_socket import Sockets
from tests.support.page_site import SMALL_STUDY, PageSite, Visitor
from tests.support.some_services import some_services

PASSWORD = "a good long password"


HASH = PasswordHasher(time_cost=1, memory_cost=8, parallelism=1).hash(PASSWORD)  # quick: the cost is in the hash itself


ROLES = ("watch", "act", "own")


class NoModels:
    """No game runs in these tests, so nobody is asked."""

    async def ask(self, questions: Any, deadline_ms: float) -> Any:
        raise AssertionError("nobody plays here")

    def forget(self, game: str) -> None: ...


@pytest.fixture
def site(tmp_path: Path) -> Iterator[PageSite]:
    from server.play.games import Games
    from server.store.store_recorder import StoreRecorder

    made = PageSite(tmp_path, SMALL_STUDY)
    games = Games(Clock(), NoModels(), StoreRecorder(made.database), lambda _: asyncio.sleep(0, None))
    web = made.services.web
    sockets = Sockets(games, lambda *_: asyncio.sleep(0, None), web.csrf.is_own_origin)
    live = LiveGames(web, games, sockets)
    services = some_services(
        web=web,
        settings=Settings(data=tmp_path, database=f"sqlite:///{tmp_path}/site.db"),
        sockets=sockets,
        hashing=Hashing(),
        live=live,
        dashboard=Dashboard(live, tmp_path / "site.db"),
        latency_history=LatencyHistory(live),
        alerts=Alerts(live, tmp_path / "site.db", lambda *_: None),
        control=ClusterControl(Control(games, made.database, made.studies, dismiss=sockets.dismiss_deleted)),
    )
    made.use(services)
    for module in (researcher_pages, live_boards, replay_page, actions, downloads):
        made.app.include_router(module.router)
    for role in ROLES:
        made.database.write_now(admins.create, role, HASH, role)
    with made as running:
        yield running


class Researcher(Visitor):
    """Somebody at the researcher's pages."""

    def sign_in(self, name: str, password: str = PASSWORD) -> httpx.Response:
        self.get("/admin/login")
        return self.post("/admin/login", name=name, password=password)

    def token(self) -> str:
        found = re.search(r'name="form_token" value="([^"]*)"', self.page.text)
        assert found, self.page.text[:500]
        return unescape(found.group(1))

    def post(self, path: str, token: str | None = None, **fields: str) -> httpx.Response:
        """Send a form with the token of the page that is shown."""
        body = urlencode({"form_token": self.token() if token is None else token, **fields})
        kind = {"content-type": "application/x-www-form-urlencoded"}
        self.page = self.client.post(path, content=body, headers=kind)
        return self.page


def signed_in(site: PageSite, name: str) -> Researcher:
    researcher = Researcher(site)
    assert researcher.sign_in(name).status_code == 200
    return researcher


def played(site: PageSite, timesteps: int = 12) -> str:
    """An episode of a participant that is stored: both chefs wait."""
    visitor = Visitor(site)
    visitor.consent("small")
    participant = site.only("small")
    study = site.studies.of(participant)
    step = next(one for one in site.studies.steps_of(participant) if one.kind == "episode")
    spec = episode_spec(study, step, participant.condition, "en")
    new = episodes.NewEpisode(spec, step.key, (participant.id, None), participant.study_id, participant.condition)
    episode = site.database.write_now(episodes.create, new)
    simulation = Simulation(layout_of(study.layout(step.layout)), spec.horizon)
    rows = []
    for timestep in range(timesteps + 1):
        actions_then = (STAY, STAY) if timestep else None
        if actions_then:
            simulation.step(actions_then)
        chances = ((0.1, 0.1, 0.1, 0.1, 0.5, 0.1), (0.5, 0.1, 0.1, 0.1, 0.1, 0.1), (0.1, 0.1, 0.1, 0.1, 0.5, 0.1))
        rows.append(
            TickRecord(
                episode, timestep, actions_then, simulation.hash(), (0, 0), (0, 0), (0, 0), (None, STAY), chances,
                       ((STAY, 95), (0, 80), (STAY, 60)), (), 200.0 * timestep, 1.5, 2.5, False)
        )  # fmt: skip
    site.database.write_now(ticks.insert, rows)
    return episode


def paths(site: PageSite, episode: str) -> list[tuple[str, str]]:
    """Every address of a researcher, with its method; actions filled in."""
    person = site.only("small").id
    values = {"name": "small", "episode": episode, "person": person, "account": "watch"}
    found = []
    for router in (researcher_pages, replay_page, actions, downloads):
        for route in router.router.routes:
            if not isinstance(route, APIRoute):
                continue  # a websocket: test_sockets_are_for_researchers_only
            action = "extend" if "person" in route.path else "pause" if "/s/" in route.path else "signed_out"
            found += [(method, route.path.format(**values, action=action)) for method in sorted(route.methods)]
    return [(method, path) for method, path in found if not path.endswith("/login")]


def needed(method: str, path: str) -> str:
    """The role that an address asks for."""
    if path.startswith("/admin/accounts"):
        return "own"
    return "act" if method == "POST" and path != "/admin/logout" else "watch"
