"""The whole application with a client of every role: accounts, cookies and requests."""

import hashlib
import re
from collections.abc import Iterator
from urllib.parse import urlencode

import httpx
import pytest
from argon2 import PasswordHasher
from sqlalchemy import select

from server.participation.episode_specs import episode_spec
from server.store import admins, episodes
from server.store.participants import get
from server.store.tables import participants
from server.web.admin.opened_games_page import TOKEN_HEADER
from server.web.auth import COOKIE as PARTICIPANT_COOKIE
from server.web.csrf import FORM_FIELD
from tests.support.faults.group import SHORT_GAMES
from tests.support.live_server import LiveServer
from tests.support.real_server import SHORT_STUDY

PASSWORD = "long enough for a test"
QUICK_HASH = PasswordHasher(time_cost=1, memory_cost=8, parallelism=1).hash(PASSWORD)


class PopulatedServer:
    """The running application with somebody of every role in it."""

    def __init__(self, live: LiveServer) -> None:
        self.live, self.app = live, live.app
        self.database = live.app.state.services.web.database
        self.csrf = live.app.state.services.web.csrf
        for role in ("watch", "act", "own"):
            self.database.write_now(admins.create, role, QUICK_HASH, role)
        self.cookies: dict[str, str] = {"anonymous": ""}
        self.enrol("other", "other")
        self.fill()

    def fill(self) -> None:
        self.enrol("participant", "short")
        self.person, self.episode = self._person_with_game()

    def enrol(self, role: str, study: str) -> None:
        with self.client("") as client:
            fields = dict(
                re.findall(
                    r'name="([^"]*)" value="([^"]*)"', client.get(f"/s/{study}", headers={"accept": "text/html"}).text
                )
            )
            answer = client.post(f"/s/{study}/consent", data=fields | {"box_0": "yes"})
            token = answer.headers["set-cookie"].partition("=")[2].partition(";")[0]
        self.cookies[role] = f"{PARTICIPANT_COOKIE}={token}"

    def sign_in(self, role: str) -> None:
        with self.client("") as client:
            form = {FORM_FIELD: self.form_token("anonymous", admin=True), "name": role, "password": PASSWORD}
            answer = client.post("/admin/login", data=form)
            token = answer.headers["set-cookie"].partition("=")[2].partition(";")[0]
        self.cookies[role] = f"researcher={token}"

    def client(self, cookie: str) -> httpx.Client:
        headers = {"accept": "application/json", "origin": self.live.url} | ({"cookie": cookie} if cookie else {})
        return httpx.Client(base_url=self.live.url, headers=headers, follow_redirects=False, timeout=60)

    def form_token(self, role: str, admin: bool) -> str:
        """Return the token that our own page gives to this role, so that only the role can be the reason of a
        refusal."""
        token = self.cookies[role].partition("=")[2]
        if not admin:
            return str(self.csrf.form_token(token if role in ("participant", "other") else "nobody"))
        if role in ("watch", "act", "own") and token:
            return str(self.csrf.form_token(hashlib.sha256(token.encode()).hexdigest()))
        return str(self.csrf.form_token("a researcher who is not signed in"))

    def _person_with_game(self) -> tuple[str, str]:
        token = self.cookies["participant"].partition("=")[2]
        query = select(participants.c.id).where(participants.c.token_hash == hashlib.sha256(token.encode()).hexdigest())
        person = self.database.read_now(lambda connection: connection.execute(query).scalar_one())
        row = self.database.read_now(get, person)
        studies = self.app.state.services.web.studies
        step = next(one for one in studies.steps_of(row) if one.kind == "episode")
        spec = episode_spec(studies.of(row), step, row.condition, "en")
        new = episodes.NewEpisode(spec, step.key, (person, None), row.study_id, row.condition)
        return person, self.database.write_now(episodes.create, new)

    def request(self, route: str, role: str) -> httpx.Response:
        method, _, path = route.partition(" ")
        action = "signed_out" if "account" in path else "extend"
        values = {"name": "short", "study": "short", "person": self.person, "episode": self.episode, "account": "watch"}
        values |= {"kitchen": "nook", "section": "title"}
        values |= {"draft": "1", "number": "1", "condition": "tom", "language": "en", "position": "1", "what": "now"}
        path = path.format(**values, action=action)
        with self.client(self.cookies[role]) as client:
            if method == "GET":
                return client.get(path)
            token = self.form_token(role, path.startswith("/admin"))
            fields = {FORM_FIELD: token, "text": "hello", "minutes": "1", "language": "en", "blind": "on", "step": "x"}
            kind = {
                "content-type": "application/x-www-form-urlencoded",
                TOKEN_HEADER: token,
            }  # where the body is a file
            return client.post(path, content=urlencode(fields), headers=kind)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PopulatedServer]:
    folder = tmp_path_factory.mktemp("server")
    other = folder / "other.yaml"
    other.write_text(SHORT_STUDY.replace("name: short", "name: other"), encoding="utf-8")
    with LiveServer(folder, study=SHORT_GAMES, more_studies=(other,)) as live:
        made = PopulatedServer(live)
        for role in ("watch", "act", "own"):
            made.sign_in(role)
        yield made
