"""`kitchenmind doctor`: every check passes on a good machine, and names the remedy otherwise."""

import json
import shutil
import socket
import ssl
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import psycopg
import pytest
from redis import Redis
from sqlalchemy import text as sql

import kitchenmind
from server import doctor, required_models
from server.settings import ROOT
from server.store.database import Database
from server.store.migrate import migrate
from server.web import health
from tests.support.postgres_server import PostgresServer
from tests.support.redis_server import RedisServer

STUDY = ROOT / "tests" / "data" / "small_study.yaml"


@pytest.fixture
def where(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a secret that only its owner can read."""
    monkeypatch.setenv("KITCHENMIND_DATA", str(tmp_path))
    for name in ("MODE", "SECRET", "PUBLIC_URL", "STUDIES", "DATABASE", "REDIS", "WORKERS"):
        monkeypatch.delenv(f"KITCHENMIND_{name}", raising=False)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "secret").write_text("x")
    (tmp_path / "secret").chmod(0o600)
    return tmp_path


@pytest.fixture
def own_redis() -> Iterator[RedisServer]:
    """A Redis that the test may stop."""
    server = RedisServer()
    yield server
    server.remove()


def run(*words: str, capsys: pytest.CaptureFixture[str], study: Path = STUDY) -> tuple[int, dict[str, str]]:
    """The exit status, and the last line about each thing."""
    code = kitchenmind.main(["doctor", "--port", "0", "--study", str(study), *words])
    lines = [line.split(maxsplit=2) for line in capsys.readouterr().out.splitlines()[:-1]]
    return code, {about: f"{grade} {words}" for grade, about, words in lines}


def test_all_checks_pass_on_a_healthy_machine(where: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, said = run("--database", f"sqlite:///{where}/new/study.sqlite3", capsys=capsys)
    assert code == 0
    assert set(said) == {"secret", "port", "database", "disk", "study", "weights", "TLS"}
    assert {words.split()[0] for about, words in said.items() if about != "disk"} == {"ok"}
    assert "will be created" in said["database"]
    assert list(where.iterdir()) == [where / "secret"], "it looks, and makes nothing"


def test_a_port_that_is_taken_is_named(
    where: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(doctor, "PATIENCE_S", 0.2)  # who has the port never answers
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        code, said = run("--port", str(port), capsys=capsys)
    assert code == 1
    assert said["port"].startswith(f"BAD cannot listen on 127.0.0.1:{port}")
    assert "--port" in said["port"]


@contextmanager
def answering(body: bytes) -> Iterator[int]:
    """A server that gives every request this answer, on the port."""

    class FixedAnswer(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: object) -> None: ...

    with HTTPServer(("127.0.0.1", 0), FixedAnswer) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server.server_port
        server.shutdown()


async def test_a_port_on_which_our_server_runs_is_fine(where: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with answering(json.dumps(await health.live()).encode()) as port:
        code, said = run("--port", str(port), capsys=capsys)
    assert (code, said["port"]) == (0, f"ok a kitchenmind server is already running at 127.0.0.1:{port}")


@pytest.mark.parametrize("body", [b'{"status": "alive"}', b"[1]", b"hello", b"{" * 5000])
def test_a_port_on_which_another_server_answers_is_taken(
    where: Path, capsys: pytest.CaptureFixture[str], body: bytes
) -> None:
    with answering(body) as port:
        code, said = run("--port", str(port), capsys=capsys)
    assert (code, said["port"].split()[0]) == (1, "BAD")


def test_a_secret_that_others_can_read_is_refused(where: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (where / "secret").chmod(0o644)
    code, said = run(capsys=capsys)
    assert (code, said["secret"].startswith("BAD"), "chmod 600" in said["secret"]) == (1, True, True)


def test_databases_are_distinguished(where: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = where / "study.sqlite3"
    url = f"sqlite:///{file}"
    migrate(url)
    assert run("--database", url, capsys=capsys)[1]["database"].endswith("exists and is up to date")
    with Database(url) as database:
        database.write_now(
            lambda connection: connection.execute(sql("update alembic_version set version_num = '9999'"))
        )
    code, said = run("--database", url, capsys=capsys)
    assert (code, "made by a later kitchenmind" in said["database"]) == (1, True)
    with Database(url) as database:
        database.write_now(
            lambda connection: connection.execute(sql("update alembic_version set version_num = '0001'"))
        )
    code, said = run("--database", url, capsys=capsys)
    assert (code, said["database"].split()[0], "backup" in said["database"]) == (0, "look", True)
    file.write_text("no database")
    code, said = run("--database", url, capsys=capsys)
    assert (code, said["database"].split()[0]) == (1, "BAD")
    code, said = run("--database", f"sqlite:///{file}/deeper.sqlite3", capsys=capsys)
    assert (code, "cannot be written to" in said["database"]) == (1, True)


@pytest.mark.postgres
def test_a_new_postgresql_database_is_fine_when_it_can_hold_every_letter(
    where: Path, postgres: PostgresServer, capsys: pytest.CaptureFixture[str]
) -> None:
    url = postgres.url(postgres.new_database())
    code, said = run("--database", url, capsys=capsys)
    assert (code, said["database"].endswith("is empty: tables will be created")) == (0, True)
    with psycopg.connect(postgres.url(), autocommit=True) as connection:
        connection.execute("CREATE DATABASE ascii ENCODING 'SQL_ASCII' TEMPLATE template0")
    code, said = run("--database", postgres.url("ascii"), capsys=capsys)
    assert (code, "createdb --encoding UTF8" in said["database"]) == (1, True)
    with psycopg.connect(url, autocommit=True) as connection:
        connection.execute("CREATE TABLE recipes (name text)")
    code, said = run("--database", url, capsys=capsys)
    assert (code, "is not a kitchenmind database" in said["database"]) == (1, True)


@pytest.mark.postgres
def test_a_redis_that_several_processes_could_not_use_is_reported(
    where: Path, postgres: PostgresServer, own_redis: RedisServer, capsys: pytest.CaptureFixture[str]
) -> None:
    database = ("--workers", "2", "--database", postgres.url(postgres.new_database()))
    code, said = run(*database, "--redis", own_redis.url, capsys=capsys)
    assert (code, said["redis"]) == (0, "ok it answers")
    with Redis.from_url(own_redis.url) as client:
        client.config_set("maxmemory", 1)  # what a full disk does, too: it answers, and takes nothing
    code, said = run(*database, "--redis", own_redis.url, capsys=capsys)
    assert (code, said["redis"].split()[0], "maxmemory" in said["redis"]) == (1, "BAD", True)
    own_redis.stop()
    code, said = run(*database, "--redis", own_redis.url.replace("redis://", "redis://:hunter2@"), capsys=capsys)
    assert (code, said["redis"].split()[0], "--redis" in said["redis"]) == (1, "BAD", True)
    assert "hunter" not in said["redis"]


@pytest.mark.postgres
def test_a_study_that_several_processes_cannot_serve_is_reported(
    where: Path, postgres: PostgresServer, redis: RedisServer, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("--workers", "2", "--redis", redis.url, "--database", postgres.url(postgres.new_database()))
    code, said = run(*words, capsys=capsys, study=ROOT / "studies" / "two_people.yaml")
    assert (code, said["study"].split()[0], "with one worker" in said["study"]) == (1, "BAD", True)


def test_a_full_disk_is_reported_before_it_pauses_games(
    where: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(doctor, "MIN_FREE_GB", 1e9)
    code, said = run("--database", f"sqlite:///{where}/x.sqlite3", capsys=capsys)
    assert (code, said["disk"].split()[0], "Make room" in said["disk"]) == (1, "BAD", True)


def test_an_invalid_study_is_reported_with_file_and_line(where: Path, capsys: pytest.CaptureFixture[str]) -> None:
    study = where / "wrong.yaml"
    study.write_text(STUDY.read_text("utf-8").replace("seed: 11", "seed: x"), encoding="utf-8")
    code, said = run(capsys=capsys, study=study)
    assert code == 1
    assert said["study"].startswith(f"BAD {study}:6: seed: 'x' is not a whole number")


def test_a_changed_byte_in_the_weights_is_found(
    where: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    agent = Path("coordination_ring") / "sp"
    for layout in ("coordination_ring", "matrix"):
        shutil.copytree(ROOT / "models" / "weights" / layout / "sp", where / layout / "sp")
    monkeypatch.setattr(required_models, "WEIGHTS", where)
    text = STUDY.read_text("utf-8").replace("{name: planner, predictor", "{name: sp, predictor")
    study = where / "small.yaml"
    study.write_text(text, encoding="utf-8")
    assert "2 agents" in run(capsys=capsys, study=study)[1]["weights"]
    weights = bytearray((where / agent / "weights.safetensors").read_bytes())
    weights[-1] ^= 1
    (where / agent / "weights.safetensors").write_bytes(weights)
    assert kitchenmind.main(["doctor", "--port", "0", "--study", str(study)]) == 1
    assert "sha256 differs" in capsys.readouterr().out


def test_a_wrong_setting_is_exit_status_2(
    where: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("KITCHENMIND_MODE", "production")
    assert kitchenmind.main(["doctor"]) == 2
    assert "production needs KITCHENMIND_SECRET" in capsys.readouterr().err


@pytest.fixture
def certified(where: Path) -> Iterator[tuple[int, Path]]:
    """A TLS server with a certificate for localhost that it signed itself: its port, and the certificate."""
    key, certificate = where / "key.pem", where / "certificate.pem"
    words = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "10", "-subj", "/CN=localhost"]
    words += ["-addext", "subjectAltName=DNS:localhost", "-keyout", str(key), "-out", str(certificate)]
    subprocess.run(words, check=True, capture_output=True)
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.load_cert_chain(certificate, key)
    with socket.create_server(("localhost", 0)) as listening:
        server = threading.Thread(target=_shake_hands, args=(listening, context), daemon=True)
        server.start()
        yield listening.getsockname()[1], certificate
        listening.shutdown(socket.SHUT_RDWR)
        server.join(5)


def _shake_hands(listening: socket.socket, context: ssl.SSLContext) -> None:
    while True:
        try:
            line, _ = listening.accept()
        except OSError:
            return
        try:
            context.wrap_socket(line, server_side=True).close()
        except OSError:
            line.close()


def test_the_certificate_of_the_public_address_is_looked_at(
    certified: tuple[int, Path], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    port, certificate = certified
    monkeypatch.setenv("KITCHENMIND_PUBLIC_URL", f"https://localhost:{port}")
    code, said = run(capsys=capsys)
    assert (code, said["TLS"].split()[0], "self-signed" in said["TLS"]) == (1, "BAD", True)
    monkeypatch.setenv("SSL_CERT_FILE", str(certificate))
    code, said = run(capsys=capsys)
    assert (code, said["TLS"]) == (0, "look the certificate of localhost is good for 10 days")


def test_a_public_address_that_does_not_answer_is_reported(
    where: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    monkeypatch.setenv("KITCHENMIND_PUBLIC_URL", f"https://127.0.0.1:{port}")
    code, said = run(capsys=capsys)
    assert (code, "does not answer" in said["TLS"], "TLS proxy" in said["TLS"]) == (1, True, True)
