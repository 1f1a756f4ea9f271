"""Tokens, cookies and passwords of a server, and secrets that it never reveals."""

import asyncio
import hashlib
import re
import signal
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from argon2 import extract_parameters
from sqlalchemy import select

from server.store import admins, audit, engines
from server.store.admins import IDLE, MAX_SESSION
from server.store.participants import new_token
from server.store.tables import admin_sessions, participants
from server.web.csrf import CsrfProtection
from server.web.passwords import hashed, weakness
from tests.support.faults.group import SHORT_GAMES
from tests.support.faults.recording_client import RecordingClient
from tests.support.live_server import SECRET, LiveServer
from tests.support.real_server import RealServer

PUBLIC = "https://lab.example.org"


def test_tokens_have_at_least_128_random_bits_and_repeat_never() -> None:
    tokens = {new_token() for _ in range(1000)}
    assert len(tokens) == 1000
    assert min(len(token) for token in tokens) * 6 >= 128


def test_passwords_are_hashed_with_argon2id_as_recommended() -> None:
    found = extract_parameters(hashed("any password will do"))
    assert found.type.name == "ID"
    assert (found.memory_cost >= 19 * 1024, found.time_cost >= 2, found.salt_len >= 16) == (True, True, True)


@pytest.mark.parametrize(
    "guessable",
    ["short", "aaaaaaaaaaaa", "password123", "Password2024!", "1234567890", "qwertyuiop", "iloveyou123", "ada12345678",
     "kitchenmind1", "passwordpassword", "welcome2026", "x" * 300],
)  # fmt: skip
def test_passwords_that_are_tried_first_are_refused(guessable: str) -> None:
    assert weakness(guessable, "ada")


@pytest.mark.parametrize("good", ["correct horse battery staple", "h7-Tq9.wLm2", "grüner Tee um halb vier"])
def test_good_passwords_are_taken(good: str) -> None:
    assert weakness(good, "ada") is None


def test_sessions_end_when_idle_and_after_a_day_s_work() -> None:
    assert IDLE.total_seconds() <= 2 * 3600
    assert MAX_SESSION.total_seconds() <= 12 * 3600


@pytest.fixture(scope="module")
def secure(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    """As behind a TLS proxy."""
    with LiveServer(tmp_path_factory.mktemp("secure"), study=SHORT_GAMES, public_url=PUBLIC) as running:
        running.app.state.services.web.database.write_now(admins.create, "ada", hashed("a good long one"), "own")
        yield running


def secure_client(live: LiveServer) -> httpx.Client:
    headers = {"accept": "text/html", "origin": PUBLIC, "host": "lab.example.org"}
    return httpx.Client(base_url=live.url, headers=headers, timeout=60)


def form_of(page: httpx.Response) -> dict[str, str]:
    return dict(re.findall(r'name="([^"]*)" value="([^"]*)"', page.text))


def test_behind_tls_cookies_have_every_protection(secure: LiveServer) -> None:
    with secure_client(secure) as client:
        consent = client.post("/s/short/consent", data=form_of(client.get("/s/short")) | {"box_0": "yes"})
        page = client.get("/admin/login")
        signed_in = client.post("/admin/login", data=form_of(page) | {"name": "ada", "password": "a good long one"})
    mine, theirs = consent.headers["set-cookie"], signed_in.headers["set-cookie"]
    assert mine.startswith("__Secure-participant=")
    assert theirs.startswith("__Secure-researcher=")
    for cookie in (mine.lower(), theirs.lower()):
        assert "httponly" in cookie
        assert "secure" in cookie.partition(";")[2]
        assert "samesite" in cookie
    assert "samesite=strict" in theirs.lower()
    assert "path=/s/short" in mine.lower()
    assert "path=/admin" in theirs.lower()


def test_a_cookie_without_the_prefix_is_ignored_behind_tls(secure: LiveServer) -> None:
    with secure_client(secure) as client:
        answer = client.post("/s/short/consent", data=form_of(client.get("/s/short")) | {"box_0": "yes"})
        token = answer.headers["set-cookie"].partition("=")[2].partition(";")[0]
        client.cookies.clear()
        assert client.get("/s/short/now", headers={"cookie": f"__Secure-participant={token}"}).status_code == 200
        assert client.get("/s/short/now", headers={"cookie": f"participant={token}"}).status_code == 303


def test_behind_tls_browsers_are_told_to_stay_there(secure: LiveServer) -> None:
    with secure_client(secure) as client:
        headers = client.get("/").headers
    assert int(headers["strict-transport-security"].partition("=")[2]) >= 365 * 24 * 3600
    assert "wss://lab.example.org" in headers["content-security-policy"]
    assert " ws://" not in headers["content-security-policy"]


def test_tokens_are_stored_as_hashes_only(secure: LiveServer) -> None:
    with secure_client(secure) as client:
        answer = client.post("/s/short/consent", data=form_of(client.get("/s/short")) | {"box_0": "yes"})
    token = answer.headers["set-cookie"].partition("=")[2].partition(";")[0]
    database = secure.app.state.services.web.database
    stored = database.read_now(lambda connection: connection.execute(select(participants.c.token_hash)).scalars().all())
    assert hashlib.sha256(token.encode()).hexdigest() in stored
    sessions = database.read_now(lambda connection: connection.execute(select(admin_sessions)).all())
    assert all(len(row.token_hash) == 64 for row in sessions)
    files = [file for file in Path(secure.database.removeprefix("sqlite:///")).parent.iterdir() if file.is_file()]
    assert all(token.encode() not in file.read_bytes() for file in files)


def test_fields_that_no_page_has_change_nothing(secure: LiveServer) -> None:
    extra_fields = {
        "condition": "none",
        "seed": "1",
        "status": "completed",
        "position": "5",
        "id": "me",
        "completion_code": "X",
    }
    with secure_client(secure) as client:
        answer = client.post("/s/short/consent", data=form_of(client.get("/s/short")) | {"box_0": "yes"} | extra_fields)
    token = answer.headers["set-cookie"].partition("=")[2].partition(";")[0]
    query = select(participants).where(participants.c.token_hash == hashlib.sha256(token.encode()).hexdigest())
    row = secure.app.state.services.web.database.read_now(lambda connection: connection.execute(query).one())
    assert (row.condition, row.status, row.position, row.completion_code) == ("tom", "active", 0, None)
    assert row.id != "me"
    assert row.seed != 1


def test_no_address_carries_a_token(secure: LiveServer) -> None:
    with secure_client(secure) as client:
        answer = client.post("/s/short/consent", data=form_of(client.get("/s/short")) | {"box_0": "yes"})
        assert "?" not in answer.headers["location"]
        page = client.get("/s/short/now")
    token = answer.headers["set-cookie"].partition("=")[2].partition(";")[0]
    assert token not in page.text
    assert answer.headers["referrer-policy"] == page.headers["referrer-policy"] == "same-origin"


def test_a_name_that_was_made_to_lead_here_is_not_our_own() -> None:
    class Asked:
        def __init__(self, host: str) -> None:
            self.headers = {"host": host, "origin": f"http://{host}"}

    csrf = CsrfProtection(b"secret")
    assert csrf.is_own_origin(Asked("127.0.0.1:8000"))  # type: ignore[arg-type]
    assert csrf.is_own_origin(Asked("localhost:8000"))  # type: ignore[arg-type]
    assert csrf.is_own_origin(Asked("[::1]:8000"))  # type: ignore[arg-type]
    assert not csrf.is_own_origin(Asked("evil.example:8000"))  # type: ignore[arg-type]
    assert CsrfProtection(b"s", PUBLIC).is_own_origin(Asked("lab.example.org")) is False, "the public address is https"  # type: ignore[arg-type]


def test_the_database_is_not_waited_for_without_end() -> None:
    engine = engines.writer_engine(engines.normal_url("postgresql://nobody@192.0.2.1/none"))
    arguments = engine.dialect.create_connect_args(engine.url)[1] | {"connect_timeout": engines.CONNECT_TIMEOUT_S}
    assert arguments["connect_timeout"] <= 10
    assert engines._CONNECTING["tcp_user_timeout"] <= 10_000
    engine.dispose()


def test_the_log_holds_no_secret_and_no_line_of_somebody_else(tmp_path: Path) -> None:
    """A real server, a player, a wrong password, a browser error with a line break in it; then its whole log."""
    with RealServer(tmp_path, speed=20.0, study=SHORT_GAMES) as server:
        client = RecordingClient(server.url)

        async def visit() -> str:
            await client.to_the_game()
            async with client.game().connect() as line:
                await line.send('{"type":"trouble","text":"x\\\\nERROR forged line"}')
                await line.send('{"type":"nonsense","text":"my-private-words"}')
                await line.recv()
            await client.http.post("/admin/login", data={"name": "ada", "password": "hunter2-hunter2"})
            await client.http.get("/s/short/now?PROLIFIC_PID=5f0000000000000000000001")
            token = next(iter(client.http.cookies.values()))
            await client.close()
            return token

        token = asyncio.run(visit())
        server.end(signal.SIGTERM)
        said = server.log.read_text()
    for secret in (token, "hunter2", "a secret of the tests", "my-private-words", "5f0000000000000000000001"):
        assert secret not in said
    assert not [line for line in said.splitlines() if line.startswith("ERROR forged")]


def test_the_audit_log_escapes_its_texts(secure: LiveServer) -> None:
    database = secure.app.state.services.web.database
    database.write_now(audit.add, "ada", "test", {"text": 'x\n{"forged": 1}'})
    assert database.read_now(audit.first_forged) is None
    assert database.read_now(audit.entries)[-1].detail == {"text": 'x\n{"forged": 1}'}
    assert SECRET not in str(database.read_now(audit.entries))
