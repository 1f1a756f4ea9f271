"""The machine of the guide to running a server: its commands run in a folder of ours, with our names for its addresses
and paths; nginx or Caddy in front with a certificate of our own; somebody plays through them.
"""

import asyncio
import contextlib
import os
import re
import shlex
import shutil
import socket
import ssl
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import pytest

from server.bots.participant import Bot
from tests.support.real_server import SHORT_STUDY
from tests.test_guides import BLOCK

ROOT = Path(__file__).parents[2]
GUIDE = (ROOT / "docs" / "guides" / "run_on_a_server.md").read_text(encoding="utf-8")
OWN = shlex.join([sys.executable, str(ROOT / "kitchenmind")])
STUDY = SHORT_STUDY.replace("tutorial, ", "").replace("horizon: 60", "horizon: 25")
STUDY = STUDY.replace(", {name: random, predictor: random}, {name: none, predictor: none}", "")
STUDY = STUDY.replace(
    "agents: [{name: planner, predictor: sp_predictor_stream}]", "agents: [{name: sp}]\npredictor: {form: stream}"
)  # production wants weights


def block(start: str) -> str:
    """The guide's block that begins with these words."""
    return next(found["text"] for found in BLOCK.finditer(GUIDE) if found["text"].startswith(start))


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as free:
        return int(free.getsockname()[1])


@dataclass(kw_only=True)
class GuideMachine:
    """`folder` is the guide's checkout, /srv/kitchenmind; `http` the port of the server, `https` that of the proxy."""

    folder: Path
    http: int = field(default_factory=free_port)
    https: int = field(default_factory=free_port)
    path: str = ""  # behind which it lies

    @property
    def address(self) -> str:
        return f"https://localhost:{self.https}{self.path}"

    def names(self) -> dict[str, str]:
        """The guide's words that are other ones here."""
        return {
            "https://lab.example.org": self.address,
            "127.0.0.1:8000": f"127.0.0.1:{self.http}",
            "/srv/kitchenmind/.venv/bin/kitchenmind": OWN,
            "/srv/kitchenmind": str(self.folder),
            "python3 -c": f"{sys.executable} -c",
        }

    def ours(self, text: str) -> str:
        """The guide's text with our names in place of those of its machine."""
        names = self.names()
        return re.sub("|".join(map(re.escape, names)), lambda found: names[found[0]], text)

    def environment(self) -> dict[str, str]:
        return {**os.environ, "SSL_CERT_FILE": str(self.folder / "certificate.pem")}

    def does(self, command: str, within_s: float = 60, **more: str) -> str:
        """What the command printed; it must succeed."""
        done = subprocess.run(
            self.ours(command),
            shell=True,
            cwd=self.folder,
            env=self.environment() | more,
            capture_output=True,
            text=True,
            timeout=within_s,
        )
        assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
        return done.stdout

    def make_settings(self) -> str:
        """The `.env` that the guide's first lines make; it names a study, which is put in its place."""
        (self.folder / "studies").mkdir(exist_ok=True)
        (self.folder / "studies" / "my_study.yaml").write_text(STUDY, encoding="utf-8")
        lines = [line for line in block("python3 -c").splitlines() if not line.startswith("docker")]
        named = re.search(r'`(KITCHENMIND_STUDIES=\["studies/my_study.yaml"\])`', GUIDE)
        assert named is not None
        for line in [*lines, f"echo '{named[1]}' >> .env"]:
            self.does(line)
        return (self.folder / ".env").read_text(encoding="utf-8")

    @contextlib.contextmanager
    def proxy(self, kind: "Callable[[GuideMachine], list[str]]") -> Iterator[None]:
        """TLS in front, by `nginx` or `caddy`."""
        names = "-subj /CN=localhost -addext subjectAltName=DNS:localhost"
        self.does(f"openssl req -x509 -newkey rsa:2048 -nodes -days 90 -keyout key.pem -out certificate.pem {names}")
        (self.folder / "proxy").mkdir()
        name, *words = kind(self)
        program = shutil.which(name, path=f"{os.environ['PATH']}:/usr/sbin")
        assert program is not None, f"{name} is not installed. `make test-slow` says how."
        with (self.folder / "proxy" / "said").open("wb") as said:
            running = subprocess.Popen([program, *words], stdout=said, stderr=said)
        try:
            yield
        finally:
            running.terminate()
            running.wait(10)

    def until_ready(self, why_not: Callable[[], str], within_s: float = 60) -> None:
        """Until the proxy says that games can be played; `why_not` gives the message if it never does."""
        trusted = ssl.create_default_context(cafile=str(self.folder / "certificate.pem"))
        deadline = time.monotonic() + within_s
        while time.monotonic() < deadline:
            why_not()
            with contextlib.suppress(httpx.TransportError):
                if httpx.get(f"{self.address}/health/ready", verify=trusted).status_code == 200:
                    return
            time.sleep(0.1)
        raise AssertionError(f"it is not ready:\n{why_not()}")

    async def play(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Somebody takes part in the study, up to the end of a game, over TLS and with cookies that want it."""
        monkeypatch.setenv("SSL_CERT_FILE", str(self.folder / "certificate.pem"))
        bot = Bot(self.address, "short", 1)
        page = await bot.consent()
        while not page.is_game:
            page = await bot.submit(page)
        assert await asyncio.wait_for(bot.game().play(), 60)
        assert bot.journal.violations == []
        assert {cookie.secure for cookie in bot._client.cookies.jar} == {True}
        await bot.close()


def nginx(machine: GuideMachine) -> list[str]:
    """The guide's block in the least that nginx wants around it."""
    return nginx_with(machine, machine.ours(block("location /")))


def nginx_with(machine: GuideMachine, location: str) -> list[str]:
    """With this block."""
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
                {location}
            }}
        }}""")
    return ["nginx", "-p", str(folder), "-c", "nginx.conf", "-e", f"{folder}/error.log"]


def caddy(machine: GuideMachine) -> list[str]:
    """The guide's whole file, but with a certificate at hand: it cannot be fetched here."""
    head = f"{{\n    admin off\n    auto_https disable_redirects\n    storage file_system {machine.folder}/proxy\n}}\n"
    own = machine.ours(block("lab.example.org {")).replace("lab.example.org", machine.address)
    certificate = f"    tls {machine.folder}/certificate.pem {machine.folder}/key.pem\n"
    (machine.folder / "proxy" / "Caddyfile").write_text(head + own.replace("{\n", "{\n" + certificate, 1))
    return ["caddy", "run", "--config", str(machine.folder / "proxy" / "Caddyfile"), "--adapter", "caddyfile"]
