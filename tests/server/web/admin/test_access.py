"""Access to the researchers' pages: signing in, roles, forms, guesses, blinding."""

import json
from datetime import UTC, datetime, timedelta
from urllib.parse import urlencode

import httpx
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from overcooked.constants import STAY
from server.store import audit, interventions
from server.store.database import DatabaseDown
from server.store.tables import admin_sessions
from tests.support.page_site import PageSite
from tests.support.researcher_site import PASSWORD, ROLES, Researcher, needed, paths, played, signed_in


def test_nothing_is_shown_or_done_without_signing_in(site: PageSite) -> None:
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


def test_sockets_are_for_researchers_only(site: PageSite) -> None:
    episode = played(site)
    cookie = f"researcher={signed_in(site, 'watch').client.cookies['researcher']}"
    base = site.url.replace("http", "ws")
    for path in ("/admin/s/small/live", f"/admin/s/small/game/{episode}/live"):
        for headers in ({}, {"cookie": "researcher=guessed"}, {"cookie": cookie, "origin": "https://evil.example"}):
            with pytest.raises(InvalidStatus, match="403"):
                connect(base + path, additional_headers=headers)
        with connect(base + path, additional_headers={"cookie": cookie}) as socket:
            assert json.loads(socket.recv(10))["type"] in ("cards", "status")


@pytest.mark.parametrize("role", ROLES)
def test_every_address_requires_its_role(site: PageSite, role: str) -> None:
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


def test_a_form_that_was_not_made_for_the_session_changes_nothing(site: PageSite) -> None:
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
    assert site.database.read_now(interventions.paused_studies) == set()


def test_the_cookie_is_for_our_own_pages_and_no_script_and_changes_with_every_sign_in(site: PageSite) -> None:
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


def test_signing_out_ends_the_session_for_every_copy_of_the_cookie(site: PageSite) -> None:
    researcher = signed_in(site, "watch")
    copy = researcher.client.cookies["researcher"]
    researcher.get("/admin")
    researcher.post("/admin/logout")
    assert httpx.get(f"{site.url}/admin", cookies={"researcher": copy}).status_code == 401


def test_guessing_passwords_has_to_wait(site: PageSite) -> None:
    guesser = Researcher(site)
    codes = [guesser.sign_in("own", f"guess number {n}").status_code for n in range(6)]
    assert codes == [401] * 5 + [429]
    assert guesser.sign_in("own").status_code == 429, "the right password has to wait too"
    assert Researcher(site).sign_in("nobody", "x").status_code == 401


def test_after_signing_in_nobody_is_led_elsewhere(site: PageSite) -> None:
    climbing = ("/admin/../s/small", "/admin/s/../../../other-app", "/admin/./..", "/admin/..")  # behind a path: away
    for target in ("https://evil.example/", "//evil.example/admin/", "/s/small", *climbing):
        researcher = Researcher(site)
        researcher.client.follow_redirects = False
        researcher.get("/admin/login")
        answer = researcher.post("/admin/login", name="own", password=PASSWORD, next=target)
        assert answer.headers["location"] == "/admin", target


def test_a_blinded_researcher_is_sent_neither_conditions_nor_marks(site: PageSite) -> None:
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


def test_pages_are_shown_while_the_database_can_be_read_but_not_written(
    site: PageSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    researcher = signed_in(site, "watch")
    earlier = admin_sessions.update().values(seen_at=datetime.now(UTC) - timedelta(minutes=2))
    site.database.write_now(lambda connection: connection.execute(earlier))

    async def full(*_: object) -> None:
        raise DatabaseDown("the disk is full")

    monkeypatch.setattr(site.database, "write", full)
    assert researcher.get("/admin/s/small").status_code == 200
