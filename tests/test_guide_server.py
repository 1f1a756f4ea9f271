"""The guide to running a server, to the letter: its commands, its nginx block, its systemd unit; a person plays
through TLS. Only names that belong to the guide's machine (addresses, paths, `sudo`) are replaced by ours."""

import shlex
import shutil
import signal
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.support import guide_machine
from tests.support.guide_machine import OWN, block, caddy, nginx
from tests.support.postgres_server import PostgresServer, programs
from tests.support.redis_server import RedisServer

pytestmark = [pytest.mark.slow, pytest.mark.postgres, pytest.mark.timeout(280)]


@dataclass(kw_only=True)
class ServerMachine(guide_machine.GuideMachine):
    """With the system's PostgreSQL and Redis; `user` is who gives the next command."""

    postgres: PostgresServer
    redis: RedisServer

    def names(self) -> dict[str, str]:
        return super().names() | {"127.0.0.1:6379": f"127.0.0.1:{self.redis.port}", "sudo -u postgres ": ""}

    def environment(self) -> dict[str, str]:
        path = f"{programs()}:{super().environment()['PATH']}"
        return super().environment() | {"PATH": path, "PGHOST": str(self.postgres.folder), "PGUSER": "kitchenmind"}


@pytest.fixture
def machine(tmp_path: Path) -> Iterator[ServerMachine]:
    """With an empty PostgreSQL of the user `postgres`."""
    postgres, redis = PostgresServer(), RedisServer()
    folder = tmp_path / "srv"
    folder.mkdir()
    made = ServerMachine(folder=folder, postgres=postgres, redis=redis)
    made.does("psql postgres --command 'CREATE ROLE postgres SUPERUSER LOGIN'")
    made.does("psql postgres --command 'ALTER ROLE kitchenmind RENAME TO somebody'", PGUSER="postgres")
    yield made
    postgres.remove()
    redis.remove()


@pytest.fixture
def settings(machine: ServerMachine) -> str:
    return machine.make_settings()


@pytest.fixture(params=[nginx, caddy], ids=["nginx", "caddy"])
def proxy(machine: ServerMachine, request: pytest.FixtureRequest) -> Iterator[None]:
    """TLS in front."""
    with machine.proxy(request.param):
        yield


def unit() -> dict[str, list[str]]:
    """The systemd unit's settings."""
    found: dict[str, list[str]] = {}
    for line in block("[Unit]").splitlines():
        name, is_setting, value = line.partition("=")
        if is_setting:
            found.setdefault(name, []).append(value)
    return found


@pytest.fixture
def service(machine: ServerMachine, settings: str, proxy: None) -> "Iterator[subprocess.Popen[bytes]]":
    """What systemd would run, with the environment that it would give; up when the proxy says that it is ready."""
    for line in block("sudo -u postgres").splitlines():
        machine.does(line, PGUSER="postgres")
    given = dict(line.split("=", 1) for line in settings.splitlines())
    given |= dict(one.split("=", 1) for line in unit()["Environment"] for one in line.split())
    words = shlex.split(machine.ours(unit()["ExecStart"][0]))
    assert shlex.join(words).endswith(machine.ours(block("kitchenmind doctor").split("kitchenmind serve ")[1].strip()))
    environment = machine.environment() | given | {"KITCHENMIND_PORT": str(machine.http)}
    with (machine.folder / "log").open("wb") as log:
        running = subprocess.Popen(words, cwd=machine.folder, env=environment, stdout=log, stderr=log)

    def output() -> str:
        text = (machine.folder / "log").read_text()
        assert running.poll() is None, text
        return text

    try:
        machine.until_ready(output)
        yield running
    finally:
        running.kill()
        running.wait()


def test_settings_file_holds_the_secrets_and_is_nobody_elses(machine: ServerMachine, settings: str) -> None:
    assert (machine.folder / ".env").stat().st_mode & 0o077 == 0
    names = [line.partition("=")[0] for line in settings.splitlines()]
    assert names == ["KITCHENMIND_SECRET", "POSTGRES_PASSWORD", "KITCHENMIND_PUBLIC_URL", "KITCHENMIND_STUDIES"]


def test_systemd_takes_the_unit(machine: ServerMachine) -> None:
    if shutil.which("systemd-analyze") is None:
        pytest.skip("systemd is not installed here")
    file = machine.folder / "kitchenmind.service"
    file.write_text(machine.ours(block("[Unit]")))
    done = subprocess.run(["systemd-analyze", "verify", file], capture_output=True, text=True)
    complaints = [line for line in done.stderr.splitlines() if "kitchenmind.service" in line]
    assert not [line for line in complaints if "Unit" not in line or "not found" not in line], done.stderr


async def test_a_person_plays_through_tls_on_what_the_guide_sets_up(
    machine: ServerMachine, service: "subprocess.Popen[bytes]", monkeypatch: pytest.MonkeyPatch
) -> None:
    await machine.play(monkeypatch)
    doctor = machine.does(f"{OWN} doctor", KITCHENMIND_PORT="0", KITCHENMIND_DATABASE="postgresql:///kitchenmind")
    assert "certificate of localhost is good for" in doctor
    service.send_signal(signal.SIGTERM)
    assert service.wait(int(unit()["TimeoutStopSec"][0])) == 0
