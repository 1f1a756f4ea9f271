"""A researcher's pages over real HTTP: who gets in, who may do what, what is hidden, what is written down."""

import asyncio
import json
import re
import time
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from html import unescape
from pathlib import Path
from typing import Any
from urllib.parse import urlencode
from xml.etree import ElementTree

import httpx
import pytest
from argon2 import PasswordHasher
from fastapi.routing import APIRoute
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from overcooked.constants import STAY
from server.cluster.dispatch import ClusterControl
from server.monitoring import invented_participants
from server.monitoring.alerts import Alert, Alerts, message_of
from server.monitoring.control import Control
from server.monitoring.dashboard import Dashboard
from server.monitoring.enrolment_flow import flow_of, stock
from server.monitoring.latency_history import LatencyHistory
from server.monitoring.live_games import LiveGames
from server.monitoring.peers import Process, SingleProcess
from server.participation.episode_specs import episode_spec, layout_of
from server.play.clock import Clock
from server.play.lateness import LATELY_S, Lateness
from server.play.recorder import EpisodeResult, InputRecord, PauseRecord, TickRecord
from server.play.simulation import Simulation
from server.settings import Settings
from server.store import admins, audit, decisions, episodes, events, inputs, participants, ticks
from server.store.tables import participants as participants_table
from server.web.admin import actions, downloads, live_boards, replay_page, researcher_pages
from server.web.guess_limits import Hashing
from server.web.participant.game_socket import Sockets
from tests.support.page_site import SMALL_STUDY, Site, Visitor
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
def site(tmp_path: Path) -> Iterator[Site]:
    from server.play.games import Games
    from server.store.episodes import StoreRecorder

    made = Site(tmp_path, SMALL_STUDY)
    games = Games(Clock(), NoModels(), StoreRecorder(made.database), lambda _: asyncio.sleep(0, None))
    web = made.services.web
    sockets = Sockets(games, lambda *_: asyncio.sleep(0, None), web.csrf.is_own_origin)
    live = LiveGames(web, games, sockets)
    services = some_services(
        web=web,
        settings=Settings(database=f"sqlite:///{tmp_path}/site.db"),
        sockets=sockets,
        hashing=Hashing(),
        live=live,
        dashboard=Dashboard(live, tmp_path / "site.db"),
        latency_history=LatencyHistory(live),
        alerts=Alerts(live, tmp_path / "site.db", lambda *_: None),
        control=ClusterControl(Control(games, made.database, made.studies)),
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


def signed_in(site: Site, name: str) -> Researcher:
    researcher = Researcher(site)
    assert researcher.sign_in(name).status_code == 200
    return researcher


def played(site: Site, timesteps: int = 12) -> str:
    """An episode of a participant that is stored: both chefs wait."""
    visitor = Visitor(site)
    visitor.consent("small")
    participant = site.only("small")
    study = site.studies.of(participant)
    step = next(one for one in site.studies.way(participant) if one.kind == "episode")
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


def paths(site: Site, episode: str) -> list[tuple[str, str]]:
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


def test_nothing_is_shown_or_done_without_signing_in(site: Site) -> None:
    episode = played(site)
    unknown_visitor = httpx.Client(base_url=site.url)
    site.clients.append(unknown_visitor)
    everything = paths(site, episode)
    assert len(everything) >= 18
    for method, path in everything:
        answer = unknown_visitor.request(method, path, headers={"accept": "application/json"})
        assert answer.status_code in (401, 403), f"{method} {path} gives {answer.status_code}"
        page = unknown_visitor.request(method, path, headers={"accept": "text/html"})
        assert "P-001" not in page.text
    assert site.database.read_now(audit.entries) == []


def test_sockets_are_for_researchers_only(site: Site) -> None:
    episode = played(site)
    cookie = f"researcher={signed_in(site, 'watch').client.cookies['researcher']}"
    base = site.url.replace("http", "ws")
    for path in ("/admin/s/small/live", f"/admin/s/small/game/{episode}/live"):
        for headers in ({}, {"cookie": "researcher=guessed"}, {"cookie": cookie, "origin": "https://evil.example"}):
            with pytest.raises(InvalidStatus, match="403"):
                connect(base + path, additional_headers=headers)
        with connect(base + path, additional_headers={"cookie": cookie}) as socket:
            assert json.loads(socket.recv(10))["type"] in ("cards", "over")


@pytest.mark.parametrize("role", ROLES)
def test_every_address_asks_for_its_role(site: Site, role: str) -> None:
    episode = played(site)
    researcher = signed_in(site, role)
    for method, path in paths(site, episode):
        if researcher.get("/admin").url.path == "/admin/login":
            researcher = signed_in(site, role)  # one of the addresses signed them out
            researcher.get("/admin")
        allowed = ROLES.index(role) >= ROLES.index(needed(method, path))
        answer = (
            researcher.get(path)
            if method == "GET"
            else researcher.post(path, note="a test", text="hello", blind="on", next="/admin/audit")
        )
        if allowed:
            assert answer.status_code in (200, 409), f"{role}: {method} {path} gives {answer.status_code}"
        else:
            assert answer.status_code == 403, f"{role}: {method} {path} gives {answer.status_code}"


def test_a_form_that_was_not_made_for_the_session_changes_nothing(site: Site) -> None:
    first, second = signed_in(site, "own"), signed_in(site, "own")
    first.get("/admin")
    second.get("/admin")
    assert second.post("/admin/s/small/pause", token=first.token()).status_code == 403
    second.get("/admin")
    assert second.post("/admin/s/small/pause", token="").status_code == 403
    second.get("/admin")
    foreign = second.client.post(
        "/admin/s/small/pause",
        content=urlencode({"form_token": second.token()}),
        headers={"origin": "https://evil.example"},
    )
    assert foreign.status_code == 403
    assert site.database.read_now(decisions.paused_studies) == set()


def test_the_cookie_is_for_our_own_pages_and_no_script_and_changes_with_every_sign_in(site: Site) -> None:
    researcher = Researcher(site)
    researcher.client.follow_redirects = False
    answer = researcher.sign_in("act")
    words = answer.headers["set-cookie"].lower()
    assert "httponly" in words
    assert "samesite=strict" in words
    assert "path=/admin" in words
    before = researcher.client.cookies["researcher"]
    stored = site.database.read_now(
        lambda c: c.exec_driver_sql("select token_hash from admin_sessions").scalars().all()
    )
    assert before not in stored
    researcher.sign_in("act")
    assert researcher.client.cookies["researcher"] != before
    stale = httpx.get(f"{site.url}/admin", cookies={"researcher": before})
    assert stale.status_code == 401


def test_signing_out_ends_the_session_for_every_copy_of_the_cookie(site: Site) -> None:
    researcher = signed_in(site, "watch")
    copy = researcher.client.cookies["researcher"]
    researcher.get("/admin")
    researcher.post("/admin/logout")
    assert httpx.get(f"{site.url}/admin", cookies={"researcher": copy}).status_code == 401


def test_guessing_passwords_has_to_wait(site: Site) -> None:
    guesser = Researcher(site)
    codes = [guesser.sign_in("own", f"guess number {n}").status_code for n in range(6)]
    assert codes == [401] * 5 + [429]
    assert guesser.sign_in("own").status_code == 429, "the right password has to wait too"
    assert Researcher(site).sign_in("nobody", "x").status_code == 401


def test_after_signing_in_nobody_is_led_elsewhere(site: Site) -> None:
    for target in ("https://evil.example/", "//evil.example/admin/", "/admin/../s/small", "/s/small"):
        researcher = Researcher(site)
        researcher.client.follow_redirects = False
        researcher.get("/admin/login")
        answer = researcher.post("/admin/login", name="own", password=PASSWORD, next=target)
        assert answer.headers["location"] in ("/admin", "/admin/../s/small"), target
        assert "evil" not in answer.headers["location"]


def test_a_blinded_researcher_is_sent_neither_conditions_nor_marks(site: Site) -> None:
    episode = played(site)
    participant = site.only("small")
    researcher = signed_in(site, "own")
    for path in ("/admin/s/small", f"/admin/s/small/person/{participant.id}", f"/admin/s/small/game/{episode}"):
        assert f">{participant.condition}<" not in researcher.get(path).text
    record = researcher.get(f"/admin/s/small/game/{episode}/record.json").json()
    assert record["inputs"] == []
    assert all(row["prediction"] == [] and row["displayed"] == [] for row in record["rows"])
    assert record["accuracy"] == []
    assert researcher.get("/admin/s/small/consort.svg").text.count("Arm ") == len(
        site.studies.of(participant).conditions
    )
    researcher.get("/admin/s/small")
    researcher.post("/admin/blind", blind="off", next="/admin/s/small")
    seeing = researcher.get(f"/admin/s/small/game/{episode}/record.json").json()
    assert seeing["rows"][3]["displayed"] == [[STAY, 95], [0, 80], [STAY, 60]]
    assert f">{participant.condition}<" in researcher.get(f"/admin/s/small/game/{episode}").text
    assert [entry.action for entry in site.database.read_now(audit.entries)][-1] == "blind mode off"


def test_the_flow_begins_with_the_links_that_were_opened(site: Site) -> None:
    visitor = Visitor(site)
    visitor.get("/s/small")
    form = visitor.fields("/consent")
    for kind, reason in (("opened", ""), ("opened", ""), ("opened", ""), ("unsuitable", "screen"), ("declined", "")):
        assert visitor.send("/s/small/arrivals", form | {"kind": kind, "reason": reason}).status_code == 204
    assert visitor.send("/s/small/arrivals", form | {"kind": "hello"}).status_code == 400
    assert visitor.send("/s/small/arrivals", {"kind": "opened"}).status_code == 403
    Visitor(site).consent("small")
    numbers = site.studies.versions("small")
    nodes = flow_of(site.studies.of(site.only("small")), site.database.read_now(stock, numbers))
    assert [(node["name"], node["reached"], node["lost"]) for node in nodes][:2] == [
        ("Opened the link", 3, {"screen too small": 1, "declined": 1}),
        ("Consented", 1, {}),
    ]
    diagram = signed_in(site, "watch").get("/admin/s/small/consort.svg").text
    assert "Not enrolled (n = 2)" in diagram
    assert ElementTree.fromstring(diagram).tag.endswith("svg")


def test_alerts_are_told_when_they_begin_and_when_they_are_over(site: Site, tmp_path: Path) -> None:
    told: list[tuple[str, bool]] = []
    alerts = Alerts(site.services.live, tmp_path / "site.db", lambda alert, over: told.append((alert.key, over)))
    asyncio.run(alerts.look())
    assert told == []
    loop = site.services.live.games.loop
    for late_ms in [3.0] * 50 + [90.0]:
        loop.lateness.add(late_ms)
    Visitor(site).consent("small")
    person = site.only("small").id
    site.database.write_now(events.add, events.Event("trouble", datetime.now(UTC), person, detail={"text": "a secret"}))
    asyncio.run(alerts.look())
    asyncio.run(alerts.look())
    assert sorted(told) == [("late", False), (f"trouble {person}", False)], "each once"
    assert not any("secret" in alert.text for alert in alerts.open.values())
    assert str(alerts.shown("small")[0]["text"]).startswith("Timesteps come late: 90 ms")
    loop.lateness = Lateness()
    asyncio.run(alerts.look())
    assert told[-1] == ("late", True)


def test_an_alert_tells_of_people_who_consent_and_do_nothing(site: Site, tmp_path: Path) -> None:
    alerts = Alerts(site.services.live, tmp_path / "site.db", lambda *_: None)
    for _ in range(invented_participants.FEWEST):
        Visitor(site).consent("small")
    asyncio.run(alerts.look())
    assert alerts.open == {}
    earlier = {"started_at": datetime.now(UTC) - timedelta(minutes=15)}
    site.database.write_now(lambda connection: connection.execute(participants_table.update().values(earlier)))
    asyncio.run(alerts.look())
    assert list(alerts.open) == ["silent small"]
    assert "have done nothing since" in str(alerts.shown("small")[0]["text"])


def test_an_alert_tells_the_newest_figure_and_ends_when_no_tick_was_late_lately(site: Site, tmp_path: Path) -> None:
    told: list[tuple[str, bool]] = []
    alerts = Alerts(site.services.live, tmp_path / "site.db", lambda alert, over: told.append((alert.key, over)))
    loop = site.services.live.games.loop
    loop.lateness.add(1274.0)
    asyncio.run(alerts.look())
    (first,) = alerts.open.values()
    loop.lateness = Lateness()
    loop.lateness.add(1274.0, time.monotonic() - LATELY_S - 1)  # long ago
    loop.lateness.add(61.0)
    asyncio.run(alerts.look())
    (second,) = alerts.open.values()
    assert ("1274 ms" in first.text, "61 ms" in second.text) == (True, True)
    assert second.since == first.since, "it is still the same alert"
    loop.lateness = Lateness()
    loop.lateness.add(1274.0, time.monotonic() - LATELY_S - 1)  # the last tick there was
    asyncio.run(alerts.look())
    assert alerts.open == {}
    assert told == [("late", False), ("late", True)]


def test_of_several_processes_one_tells_what_all_see(site: Site, tmp_path: Path) -> None:
    class Several(SingleProcess):
        other = ""

        async def processes(self) -> list[Process]:
            return [Process(self.other, {})]

    Visitor(site).consent("small")
    person = site.only("small").id
    site.database.write_now(events.add, events.Event("trouble", datetime.now(UTC), person, detail={"text": "x"}))
    site.services.live.peers = several = Several()
    for several.other, told in (("another", []), ("the last", [f"trouble {person}"])):
        alerts = Alerts(site.services.live, tmp_path / "site.db", lambda *_: None)
        asyncio.run(alerts.look())
        assert list(alerts.open) == told


def test_an_alert_carries_a_text_for_a_chat_and_parts_for_a_program() -> None:
    alert = Alert("game 7", "ring: P-001 is away.", "/admin/s/ring/game/7", "ring")
    message = message_of(alert, over=False, public_url="https://lab.example/")
    assert message["text"] == "kitchenmind: ring: P-001 is away. https://lab.example/admin/s/ring/game/7"
    assert (message["alert"], message["state"], message["study"]) == ("game 7", "open", "ring")
    assert message_of(alert, over=True, public_url="")["text"] == "kitchenmind: over: ring: P-001 is away."


def test_the_course_counts_people_and_samples_lateness(site: Site) -> None:
    for _ in range(3):
        Visitor(site).consent("small")
    first = site.everybody("small")[0].id
    site.database.write_now(participants.complete, first, "KM-1234")
    latencies = site.services.latency_history
    latencies.sample(100.0)
    said = signed_in(site, "watch").get("/admin/s/small/latency.json").json()
    assert (said["people"]["consented"], said["people"]["completed"]) == ([1, 2, 3, 3], [0, 0, 0, 1])
    assert said["machine"] == {"at": [100], "games": [0], "p50_ms": [None], "p99_ms": [None]}


def test_the_table_of_games_shows_what_the_rules_and_the_researcher_say(site: Site) -> None:
    episode = played(site, timesteps=60)
    participant = site.only("small")
    result = EpisodeResult(episode, "done", "horizon", 0, 0, 0.0, True, "0" * 16)
    site.database.write_now(episodes.end, result)
    researcher = signed_in(site, "act")
    shown = " ".join(researcher.get("/admin/s/small/games").text.split())
    assert f'data-episode="{episode}" data-pending="yes"' in shown
    said = researcher.get("/admin/s/small/quality.json").json()
    proposal, rules = said["proposals"][episode]
    assert (said["waiting"], proposal) == (0, "drop"), "nobody did anything in it"
    assert "idle" in rules
    researcher.get(f"/admin/s/small/game/{episode}")
    researcher.post(f"/admin/s/small/game/{episode}/exclude", reason="not attentive", note="")
    text = researcher.get(f"/admin/s/small/person/{participant.id}").text
    assert "excluded: not attentive" in text
    assert '<span class="flag bad">drop</span>' in text


def test_a_replay_says_whether_every_state_is_the_stored_one(site: Site) -> None:
    episode = played(site, timesteps=12)
    researcher = signed_in(site, "watch")
    record = researcher.get(f"/admin/s/small/game/{episode}/record.json").json()
    assert record["checked"] == {"states": 13, "equal": True, "difference": None}
    assert [row["t"] for row in record["rows"]] == list(range(13))
    assert record["rows"][5]["actions"] == [STAY, STAY]
    forge = "update ticks set action_0 = 2 where timestep = 7"
    site.database.write_now(lambda connection: connection.exec_driver_sql(forge) and None)
    forged = researcher.get(f"/admin/s/small/game/{episode}/record.json").json()["checked"]
    assert not forged["equal"]
    assert "timestep 7" in forged["difference"]


def test_a_replay_has_every_input_at_its_timestep_with_what_became_of_it(site: Site) -> None:
    episode = played(site)
    began = datetime(2026, 3, 1, tzinfo=UTC)
    site.database.write_now(episodes.pause, PauseRecord(episode, 9, "blur", began, 4000.0))
    one = InputRecord(episode, 0, 1, "tab-0001", 7, 2, 5, 1.5, began.timestamp() * 1000 - 9000, 450.0, 4, "applied")
    late = replace(one, number=2, seq=8, held=None, received_ms=1010.0, timestep=None, outcome="replaced")
    stood = replace(late, number=3, seq=9, received_ms=None, received_unix_ms=began.timestamp() * 1000 + 500)
    site.database.write_now(inputs.insert, [one, late, replace(stood, outcome="stood_still")])
    found = signed_in(site, "own").get(f"/admin/s/small/game/{episode}/record.json").json()["inputs"]
    assert [(row["seq"], row["t"], row["held"], row["tap"], row["outcome"]) for row in found] == [
        (7, 3, 2, 5, "applied"),
        (8, 5, None, 5, "replaced"),
        (9, 9, None, 5, "stood_still"),
    ]


def test_the_accuracy_of_a_replay_counts_what_was_done_in_the_timestep_foretold(site: Site) -> None:
    episode = played(site, timesteps=12)
    researcher = signed_in(site, "act")
    researcher.get("/admin")
    researcher.post("/admin/blind", blind="off")
    steps = researcher.get(f"/admin/s/small/game/{episode}/record.json").json()["accuracy"]
    assert [(step["share"], step["n"]) for step in steps] == [(1.0, 12), (0.0, 11), (1.0, 10)]


def test_a_paused_study_lets_nobody_in_until_it_is_resumed(site: Site) -> None:
    waiting = Visitor(site)
    boxes = dict.fromkeys(re.findall(r'name="(box_\d+)"', waiting.get("/s/small").text), "yes")
    form = waiting.fields("/consent") | boxes
    researcher = signed_in(site, "act")
    researcher.get("/admin/s/small")
    assert "is paused" in researcher.post("/admin/s/small/pause", note="the room is dark").text
    assert waiting.send("/s/small/consent", form).status_code == 503, "the consent page has to wait too"
    newcomer = Visitor(site).get("/s/small?lang=en&PROLIFIC_PID=5f1e00000000000000000001")
    assert newcomer.status_code == 503
    assert "paused this study for a while" in newcomer.text
    assert "PROLIFIC_PID=5f1e00000000000000000001" in newcomer.text, "the link stays whole"
    assert site.everybody("small") == []
    researcher.get("/admin/s/small")
    researcher.post("/admin/s/small/resume", note="light again")
    assert Visitor(site).consent("small").status_code == 200
    noted = site.database.read_now(audit.entries)
    assert [entry.action for entry in noted] == ["sign in", "pause study", "resume study"]
    assert noted[1].actor == "act"
    assert noted[1].detail == {"study": "small", "reason": "the room is dark"}


def test_an_exclusion_needs_a_reason_is_audited_and_can_be_taken_back(site: Site) -> None:
    episode = played(site)
    person = site.only("small").id
    researcher = signed_in(site, "act")
    game, page = f"/admin/s/small/game/{episode}", f"/admin/s/small/person/{person}"
    researcher.get(game)
    assert researcher.post(f"{game}/exclude", reason="because").status_code == 400
    researcher.get(game)
    assert "are excluded" in researcher.post(f"{game}/exclude", reason="not attentive", note="phone", next=game).text
    (held,) = site.database.read_now(decisions.exclusions_of, [person])
    assert (held.episode_id, held.reason, held.note) == (episode, "not attentive", "phone")
    assert "not attentive" in researcher.get(page).text
    researcher.post(f"{page}/restore", exclusion=str(held.id), next=page)
    assert site.database.read_now(decisions.exclusions_of, [person]) == []
    actions_noted = [entry.action for entry in site.database.read_now(audit.entries)]
    assert actions_noted == ["sign in", "exclude game", "restore participant"]
    assert site.database.read_now(audit.first_forged) is None


def test_a_freed_place_is_given_to_the_next(site: Site) -> None:
    played(site)
    participant = site.only("small")
    researcher = signed_in(site, "act")
    page = f"/admin/s/small/person/{participant.id}"
    researcher.get(page)
    assert "free again" in researcher.post(f"{page}/release", note="left the room", next=page).text
    assert site.only("small").status == "returned"
    assert "already ended" in researcher.post(f"{page}/release", note="again", next=page).text


def test_an_export_is_refused_in_blind_mode_and_else_is_the_command_s(site: Site) -> None:
    import io
    import zipfile

    played(site)
    researcher = signed_in(site, "act")
    researcher.get("/admin/s/small")
    assert researcher.post("/admin/s/small/export").status_code == 409
    researcher.get("/admin/s/small")
    researcher.post("/admin/blind", blind="off", next="/admin/s/small")
    archive = researcher.post("/admin/s/small/export")
    assert archive.headers["content-type"] == "application/zip"
    names = zipfile.ZipFile(io.BytesIO(archive.content)).namelist()
    assert any(name.endswith("dataset_description.json") for name in names)
    assert "export" in [entry.action for entry in site.database.read_now(audit.entries)]


def test_researchers_get_errors_in_their_own_pages(site: Site) -> None:
    researcher = signed_in(site, "own")
    missing = researcher.get("/admin/s/nowhere")
    assert (missing.status_code, missing.text.count("There is no study &#39;nowhere&#39; here.")) == (404, 1)
    assert '<link rel="stylesheet" href="/static/css/admin.css">' in missing.text
    assert "Check the address." in researcher.get("/admin/no-such-page").text
    assert "admin.css" not in researcher.get("/administer").text
    program = researcher.client.get("/admin/s/nowhere", headers={"accept": "application/json"})
    assert program.json() == {"detail": "there is no study 'nowhere' here"}
