"""Settings with which a server refuses to start; its tokens, cookies and passwords; and secrets that it never
reveals.
"""

import asyncio
import hashlib
import re
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from secrets import token_hex, token_urlsafe

import httpx
import pytest
from argon2 import extract_parameters
from pydantic import ValidationError
from sqlalchemy import select

import kitchenmind
from server.settings import Settings, settings_with
from server.store import admins, audit, engines
from server.store.admins import IDLE, MAX_SESSION
from server.store.participants import new_token
from server.store.tables import admin_sessions, participants
from server.web.auth import CsrfProtection
from server.web.passwords import hashed, weakness
from tests.support.faults.group import SHORT_GAMES
from tests.support.faults.recording_client import RecordingClient
from tests.support.live_server import SECRET, LiveServer
from tests.support.real_server import RealServer

PUBLIC = "https://lab.example.org"
STRONG = "".join(chr(97 + number % 26) + str(number % 10) for number in range(20))


def settings(**values: object) -> Settings:
    return Settings(_env_file=None, **values)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ({"secret": None, "public_url": PUBLIC}, "KITCHENMIND_SECRET"),
        ({"secret": "changeme", "public_url": PUBLIC}, "KITCHENMIND_SECRET"),
        ({"secret": "a" * 40, "public_url": PUBLIC}, "KITCHENMIND_SECRET"),
        ({"secret": STRONG[:20], "public_url": PUBLIC}, "KITCHENMIND_SECRET"),
        ({"secret": STRONG, "public_url": ""}, "KITCHENMIND_PUBLIC_URL"),
        ({"secret": STRONG, "public_url": "http://lab.example.org"}, "KITCHENMIND_PUBLIC_URL"),
        ({"secret": STRONG, "public_url": PUBLIC, "speed": 2.0}, "KITCHENMIND_SPEED"),
        ({"secret": "12345678901234567890123456789012", "public_url": PUBLIC}, "KITCHENMIND_SECRET"),
        ({"secret": "98765432109876543210987654321098", "public_url": PUBLIC}, "KITCHENMIND_SECRET"),
        ({"secret": "abcdefghijklmnopqrstuvwxyz123456", "public_url": PUBLIC}, "KITCHENMIND_SECRET"),
        ({"secret": "0123456789abcdef0123456789abcdef", "public_url": PUBLIC}, "KITCHENMIND_SECRET"),
        ({"secret": "Ab3$xY9!" * 4, "public_url": PUBLIC}, "KITCHENMIND_SECRET"),
        ({"secret": "change-me-please-this-is-secret-1", "public_url": PUBLIC}, "KITCHENMIND_SECRET"),
        ({"secret": STRONG, "public_url": "https://"}, "KITCHENMIND_PUBLIC_URL"),
        ({"secret": STRONG, "public_url": "https://[x"}, "KITCHENMIND_PUBLIC_URL"),
        ({"secret": STRONG, "public_url": "https://lab.example.org/study?of=me"}, "KITCHENMIND_PUBLIC_URL"),
        ({"secret": STRONG, "public_url": "https://me:pw@lab.example.org"}, "KITCHENMIND_PUBLIC_URL"),
        ({"secret": STRONG, "public_url": "https://lab.example.org:99999"}, "KITCHENMIND_PUBLIC_URL"),
        ({"secret": STRONG, "public_url": "http://localhost", "host": "0.0.0.0"}, "KITCHENMIND_PUBLIC_URL"),
        ({"secret": STRONG, "public_url": "http://127.0.0.1:8000", "host": "::"}, "KITCHENMIND_PUBLIC_URL"),
        ({"secret": STRONG, "public_url": PUBLIC, "metrics_token": "x"}, "KITCHENMIND_METRICS_TOKEN"),
        ({"secret": STRONG, "public_url": PUBLIC, "metrics_token": ""}, "KITCHENMIND_METRICS_TOKEN"),
        ({"secret": STRONG, "public_url": PUBLIC, "metrics_token": "1234567890123456"}, "KITCHENMIND_METRICS_TOKEN"),
        *(
            ({"secret": STRONG, "public_url": PUBLIC, "trusted_proxies": proxies}, "KITCHENMIND_TRUSTED_PROXIES")
            for proxies in (
                "*",
                "127.0.0.1,*",
                "0.0.0.0/0",
                "::/0",
                "0.0.0.0/1,128.0.0.0/1",
                "::ffff:0:0/96",
                "::/16",
                "172.28.57.1/24",
                "proxy",
                "",
            )
        ),
    ],
)
def test_production_refuses_to_start_with_what_is_not_safe(
    monkeypatch: pytest.MonkeyPatch, values: dict[str, object], named: str
) -> None:
    monkeypatch.delenv("KITCHENMIND_SECRET", raising=False)
    with pytest.raises(ValidationError, match=named) as refused:
        settings(mode="production", **values)
    assert str(values["secret"]) not in str(refused.value) or not values["secret"]


def test_production_starts_with_a_secret_and_tls_in_front() -> None:
    assert settings(mode="production", secret=STRONG, public_url=PUBLIC, host="0.0.0.0").mode == "production"


@pytest.mark.parametrize(
    "make",
    [
        lambda: token_hex(16),
        lambda: token_hex(32),
        lambda: token_urlsafe(32),
        lambda: "grüner Tee, zwölf Löffel & ein Keks",
    ],
    ids=["hex", "long hex", "urlsafe", "sentence"],
)
def test_production_takes_random_secrets(make: Callable[[], str]) -> None:
    secret = make()
    proxies = "127.0.0.1, ::1, 172.28.57.0/24, 10.0.0.0/8, ::ffff:10.0.0.0/104, fd00::/64"
    taken = settings(
        mode="production", secret=secret, public_url=f"{PUBLIC}:8443/", metrics_token=secret, trusted_proxies=proxies
    )
    assert taken.secret is not None
    assert taken.secret.get_secret_value() == secret


@pytest.mark.parametrize("command", [["admin", "list"], ["serve"], ["doctor"], ["verify"], ["export", "--out", "x"]])
def test_a_refused_setting_reveals_no_secret(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("KITCHENMIND_MODE", "production")
    monkeypatch.setenv("KITCHENMIND_SECRET", "hunter2hunter2")
    monkeypatch.setenv("KITCHENMIND_DATABASE", "postgresql://kitchenmind:hunter3hunter3@192.0.2.1/x")
    assert kitchenmind.main(command) == 2
    said = capsys.readouterr().err
    assert "KITCHENMIND_SECRET" in said
    assert "hunter" not in said


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("redis", "redis://:hunter2/hunter@127.0.0.1:6379/0"),
        ("redis", "redis://:hunter2#hunter@127.0.0.1:6379/0"),
        ("redis", "redis://:2/hunter@127.0.0.1:6379/0"),  # the password begins like a port
        ("redis", "redis://[hunter@127.0.0.1:6379/0"),
        ("alert_webhook", "https://chat.example.org:hunter/hooks"),
    ],
)
def test_an_address_that_is_not_understood_shows_no_piece_of_its_password(name: str, value: str) -> None:
    with pytest.raises(ValueError, match=f"KITCHENMIND_{name.upper()} must be an address like") as refused:
        settings_with(**{name: value}, database="postgresql://x@/y")
    assert "hunter" not in str(refused.value)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("redis", "redis://:pass%2Fword@127.0.0.1:6379/0"),
        ("redis", "redis://"),
        ("redis", "unix:///run/redis/redis.sock?db=1"),
        ("alert_webhook", "https://lab.webhook.example.com/webhookb2/1@2/IncomingWebhook/3"),
    ],
)
def test_addresses_of_all_kinds_are_taken(name: str, value: str) -> None:
    assert getattr(settings_with(**{name: value}, database="postgresql://x@/y"), name).get_secret_value() == value


def test_without_production_nobody_else_can_reach_the_server() -> None:
    with pytest.raises(ValidationError, match="can be reached by others"):
        settings(host="0.0.0.0")


def test_the_secret_shows_in_no_text_of_the_settings() -> None:
    assert STRONG not in repr(settings(secret=STRONG))


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
