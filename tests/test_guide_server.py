"""The guide to a server of one's own, to the letter: its commands, its nginx block, its systemd unit; a person plays
through TLS. Only names that belong to the guide's machine (addresses, paths, `sudo`) are replaced by ours."""

import asyncio
import os
import re
import shlex
import shutil
import signal
import socket
import ssl
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import pytest
from postgres_server import PostgresServer, programs
from real_server import SHORT_STUDY
from redis_server import RedisServer
from test_guides import BLOCK

from server.bots import Bot

ROOT = Path(__file__).parent.parent
GUIDE = (ROOT / "docs" / "guides" / "run_on_a_server.md").read_text(encoding="utf-8")
OWN = shlex.join([sys.executable, str(ROOT / "kitchenmind.py")])
STUDY = SHORT_STUDY.replace("tutorial, ", "").replace("horizon: 60", "horizon: 25")
STUDY = STUDY.replace(", {name: random, predictor: random}, {name: none, predictor: none}", "")
STUDY = STUDY.replace(
    "agents: [{name: planner}]", "agents: [{name: sp}]\npredictor: {form: stream}"
)  # production wants weights
pytestmark = [pytest.mark.slow, pytest.mark.postgres, pytest.mark.timeout(280)]


def block(start: str) -> str:
    """The guide's block that begins with these words."""
    return next(found["text"] for found in BLOCK.finditer(GUIDE) if found["text"].startswith(start))


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as free:
        return int(free.getsockname()[1])


@dataclass
class Machine:
    """Stands for the guide's machine: `folder` is /srv/kitchenmind."""

    folder: Path
    postgres: PostgresServer
    redis: RedisServer
    http: int = field(default_factory=free_port)
    https: int = field(default_factory=free_port)

    @property
    def address(self) -> str:
        return f"https://localhost:{self.https}"

    def ours(self, text: str) -> str:
        """The guide's text with our names in place of those of its machine."""
        names = {
            "https://lab.example.org": self.address,
            "127.0.0.1:8000": f"127.0.0.1:{self.http}",
            "127.0.0.1:6379": f"127.0.0.1:{self.redis.port}",
            "/srv/kitchenmind/.venv/bin/kitchenmind": OWN,
            "/srv/kitchenmind": str(self.folder),
            "sudo -u postgres ": "",
            "python3 -c": f"{sys.executable} -c",
        }
        return re.sub("|".join(map(re.escape, names)), lambda found: names[found[0]], text)

    def environment(self, user: str = "kitchenmind") -> dict[str, str]:
        given = {
            "PATH": f"{programs()}:{os.environ['PATH']}",
            "PGHOST": str(self.postgres.folder),
            "PGUSER": user,
            "SSL_CERT_FILE": str(self.folder / "certificate.pem"),
        }
        return {**os.environ, **given}

    def does(self, command: str, user: str = "kitchenmind", **more: str) -> str:
        """What the command printed; it must succeed."""
        environment = self.environment(user) | more
        done = subprocess.run(
            self.ours(command), shell=True, cwd=self.folder, env=environment, capture_output=True, text=True, timeout=60
        )
        assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
        return done.stdout


@pytest.fixture
def machine(tmp_path: Path) -> Iterator[Machine]:
    """With a study of its own, a certificate for `localhost`, and an empty PostgreSQL of the user `postgres`."""
    postgres, redis = PostgresServer(), RedisServer()
    folder = tmp_path / "srv"
    (folder / "studies").mkdir(parents=True)
    (folder / "studies" / "my_study.yaml").write_text(STUDY, encoding="utf-8")
    made = Machine(folder, postgres, redis)
    names = "-subj /CN=localhost -addext subjectAltName=DNS:localhost"
    made.does(f"openssl req -x509 -newkey rsa:2048 -nodes -days 90 -keyout key.pem -out certificate.pem {names}")
    made.does("psql postgres --command 'CREATE ROLE postgres SUPERUSER LOGIN'")
    made.does("psql postgres --command 'ALTER ROLE kitchenmind RENAME TO somebody'", user="postgres")
    yield made
    postgres.remove()
    redis.remove()


@pytest.fixture
def settings(machine: Machine) -> str:
    """The `.env` that the guide's first lines make, with the study that it speaks of."""
    lines = [line for line in block("python3 -c").splitlines() if "docker" not in line]
    named = re.search(r'`(KITCHENMIND_STUDIES=\["studies/my_study.yaml"\])`', GUIDE)
    assert named is not None
    for line in [*lines, f"echo '{named[1]}' >> .env"]:
        machine.does(line)
    return (machine.folder / ".env").read_text(encoding="utf-8")


def nginx(machine: Machine) -> list[str]:
    """The guide's block in the least that nginx wants around it."""
    folder = machine.folder / "proxy"
    places = " ".join(f"{of}_temp_path {folder}/{of};" for of in ("proxy", "fastcgi", "uwsgi", "scgi"))
    (folder / "nginx.conf").write_text(f"""
        daemon off; pid {folder}/pid; error_log {folder}/error.log;
        events {{}}
        http {{
            access_log off; client_body_temp_path {folder}/body; {places}
            server {{
                listen 127.0.0.1:{machine.https} ssl;
                ssl_certificate {machine.folder}/certificate.pem; ssl_certificate_key {machine.folder}/key.pem;
                {machine.ours(block("location /"))}
            }}
        }}""")
    return ["nginx", "-p", str(folder), "-c", "nginx.conf", "-e", f"{folder}/error.log"]


def caddy(machine: Machine) -> list[str]:
    """The guide's whole file, but with a certificate at hand: it cannot be fetched here."""
    head = f"{{\n    admin off\n    auto_https disable_redirects\n    storage file_system {machine.folder}/proxy\n}}\n"
    own = machine.ours(block("lab.example.org {")).replace("lab.example.org", machine.address)
    certificate = f"    tls {machine.folder}/certificate.pem {machine.folder}/key.pem\n"
    (machine.folder / "proxy" / "Caddyfile").write_text(head + own.replace("{\n", "{\n" + certificate, 1))
    return ["caddy", "run", "--config", str(machine.folder / "proxy" / "Caddyfile"), "--adapter", "caddyfile"]


@pytest.fixture(params=[nginx, caddy], ids=["nginx", "caddy"])
def proxy(machine: Machine, request: pytest.FixtureRequest) -> Iterator[None]:
    """TLS in front."""
    (machine.folder / "proxy").mkdir()
    name, *words = request.param(machine)
    program = shutil.which(name, path=f"{os.environ['PATH']}:/usr/sbin")
    assert program is not None, f"{name} is not installed. `make test-slow` says how."
    with (machine.folder / "proxy" / "said").open("wb") as said:
        running = subprocess.Popen([program, *words], stdout=said, stderr=said)
    yield
    running.terminate()
    running.wait(10)


def unit() -> dict[str, list[str]]:
    """The systemd unit's settings."""
    found: dict[str, list[str]] = {}
    for line in block("[Unit]").splitlines():
        name, is_setting, value = line.partition("=")
        if is_setting:
            found.setdefault(name, []).append(value)
    return found


@pytest.fixture
def service(machine: Machine, settings: str, proxy: None) -> "Iterator[subprocess.Popen[bytes]]":
    """What systemd would run, with the environment that it would give; up when the proxy says that it is ready."""
    for line in block("sudo -u postgres").splitlines():
        machine.does(line, user="postgres")
    given = dict(line.split("=", 1) for line in settings.splitlines())
    given |= dict(one.split("=", 1) for line in unit()["Environment"] for one in line.split())
    words = shlex.split(machine.ours(unit()["ExecStart"][0]))
    assert shlex.join(words).endswith(machine.ours(block("kitchenmind doctor").split("kitchenmind serve ")[1].strip()))
    environment = machine.environment() | given | {"KITCHENMIND_PORT": str(machine.http)}
    with (machine.folder / "log").open("wb") as log:
        running = subprocess.Popen(words, cwd=machine.folder, env=environment, stdout=log, stderr=log)
    try:
        until_ready(machine, running)
        yield running
    finally:
        running.kill()
        running.wait()


def until_ready(machine: Machine, running: "subprocess.Popen[bytes]") -> None:
    trusted = ssl.create_default_context(cafile=str(machine.folder / "certificate.pem"))
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        said = (machine.folder / "log").read_text()
        assert running.poll() is None, said
        try:
            if httpx.get(f"{machine.address}/health/ready", verify=trusted).status_code == 200:
                return
        except httpx.TransportError:
            pass
        time.sleep(0.1)
    raise AssertionError(f"it is not ready:\n{(machine.folder / 'log').read_text()}")


def test_settings_file_holds_the_secrets_and_is_nobody_elses(machine: Machine, settings: str) -> None:
    assert (machine.folder / ".env").stat().st_mode & 0o077 == 0
    names = [line.partition("=")[0] for line in settings.splitlines()]
    assert names == ["KITCHENMIND_SECRET", "POSTGRES_PASSWORD", "KITCHENMIND_PUBLIC_URL", "KITCHENMIND_STUDIES"]


def test_systemd_takes_the_unit(machine: Machine) -> None:
    if shutil.which("systemd-analyze") is None:
        pytest.skip("systemd is not installed here")
    file = machine.folder / "kitchenmind.service"
    file.write_text(machine.ours(block("[Unit]")))
    done = subprocess.run(["systemd-analyze", "verify", file], capture_output=True, text=True)
    complaints = [line for line in done.stderr.splitlines() if "kitchenmind.service" in line]
    assert not [line for line in complaints if "Unit" not in line or "not found" not in line], done.stderr


async def test_a_person_plays_through_tls_on_what_the_guide_sets_up(
    machine: Machine, service: "subprocess.Popen[bytes]", monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SSL_CERT_FILE", str(machine.folder / "certificate.pem"))
    bot = Bot(machine.address, "short", 1)
    page = await bot.consent()
    while not page.is_game:
        page = await bot.submit(page)
    assert await asyncio.wait_for(bot.game().play(), 60)
    assert bot.journal.violations == []
    assert {cookie.secure for cookie in bot._client.cookies.jar} == {True}
    await bot.close()
    doctor = machine.does(f"{OWN} doctor", KITCHENMIND_PORT="0", KITCHENMIND_DATABASE="postgresql:///kitchenmind")
    assert "certificate of localhost is good for" in doctor
    service.send_signal(signal.SIGTERM)
    assert service.wait(int(unit()["TimeoutStopSec"][0])) == 0
