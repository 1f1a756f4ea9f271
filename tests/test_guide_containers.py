"""The guide's containers, to the letter: image, PostgreSQL and Redis come up from one command, a person plays through
TLS, the data are sound, a backup is restored, and all stops cleanly. Wants a Docker engine that has the base images or
can fetch them; skipped where none answers."""

import json
import os
import re
import shlex
import shutil
import subprocess
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

from tests.support import guide_machine
from tests.support.guide_machine import ROOT, block, caddy
from tests.test_guides import parse

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]
SERVICES = {"server", "database", "redis"}
EXEC = "docker compose exec server kitchenmind "
ONE_EPISODE = r"^\w+ +1 +25 +0$"  # layout, episodes, timesteps, different
LOSE_A_TABLE = "docker compose exec -T database psql --username kitchenmind --command 'DROP TABLE ticks CASCADE'"
BUILT_TIMEOUT_S, HEALTHY_TIMEOUT_S, STOPPED_TIMEOUT_S = 1500, 60, 30  # the last two: the guide's words


@cache
def compose() -> str:
    """`docker compose`, or the older program that is called like it; skips where there is none, or no engine."""
    for words in ("docker compose", "docker-compose"):
        if subprocess.run(f"{words} version", shell=True, capture_output=True).returncode == 0:
            break
    else:
        pytest.skip("Docker's compose is not installed here")
    if subprocess.run(["docker", "info"], capture_output=True).returncode != 0:
        pytest.skip("no Docker engine answers here")
    return words


@dataclass(kw_only=True)
class DockerMachine(guide_machine.GuideMachine):
    """With Docker; the project is named by the folder."""

    def names(self) -> dict[str, str]:
        return (
            {"docker compose exec server": f"{compose()} exec -T server"}
            | super().names()
            | {"docker compose": compose()}
        )

    def containers(self) -> dict[str, dict[str, str]]:
        """Service -> state and health of its container."""
        told = self.does("docker compose ps --all --quiet", within_s=60).split()
        found = {}
        for container in json.loads(self.does(f"docker inspect {' '.join(told)}")) if told else []:
            state = container["State"]
            found[container["Config"]["Labels"]["com.docker.compose.service"]] = {
                "status": state["Status"],
                "health": state.get("Health", {}).get("Status", ""),
                "exit": str(state["ExitCode"]),
            }
        return found


@pytest.fixture
def machine(tmp_path: Path) -> Iterator[DockerMachine]:
    """A separate checkout, whose port is a free one; nothing of it is left in the engine."""
    compose()
    made = DockerMachine(folder=tmp_path / f"kitchenmind_guide_{os.getpid()}")
    for name in subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split():
        (made.folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, made.folder / name)
    file = made.folder / "docker-compose.yml"
    text, changed = re.subn(r"127\.0\.0\.1:8000:", f"127.0.0.1:{made.http}:", file.read_text(encoding="utf-8"))
    assert changed == 1
    file.write_text(text, encoding="utf-8")
    made.make_settings()
    yield made
    made.does("docker compose down --volumes --rmi local", within_s=300)


def commands(block: str) -> list[str]:
    return [line for line in block.splitlines() if line.startswith("docker")]


async def test_every_command_for_containers_does_what_the_guide_says(
    machine: DockerMachine, monkeypatch: pytest.MonkeyPatch
) -> None:
    for line in commands(block("python3 -c")):
        machine.does(line, within_s=BUILT_TIMEOUT_S)
    deadline = time.monotonic() + HEALTHY_TIMEOUT_S
    while {state["health"] for state in machine.containers().values()} != {"healthy"}:
        assert time.monotonic() < deadline, machine.does("docker compose ps; docker compose logs --tail 100")
        time.sleep(0.5)
    assert machine.containers().keys() == SERVICES
    with machine.proxy(caddy):
        machine.until_ready(lambda: machine.does("docker compose logs --tail 40 server"))
        await machine.play(monkeypatch)
        create, verify, export, copy = commands(block("docker compose exec server kitchenmind admin"))
        assert "mara" in machine.does(create)
        assert re.search(ONE_EPISODE, machine.does(verify), re.MULTILINE)
        machine.does(export)
        machine.does(copy)
        assert (machine.folder / "data" / "parquet" / "episodes.parquet").is_file()
        backup, stop, *restore, start = commands(block("docker compose exec -T database pg_dump"))
        machine.does(backup)
        began = time.monotonic()
        machine.does(stop)
        assert time.monotonic() - began < STOPPED_TIMEOUT_S
        assert machine.containers()["server"] | {"health": ""} == {"status": "exited", "health": "", "exit": "0"}
        machine.does(LOSE_A_TABLE)
        for line in restore:
            machine.does(line)
        machine.does(start)
        machine.until_ready(lambda: machine.does("docker compose logs --tail 40 server"))
    assert re.search(ONE_EPISODE, machine.does(verify), re.MULTILINE)


def test_one_container_with_sqlite_starts_as_the_guide_says_and_stops_cleanly(machine: DockerMachine) -> None:
    name = f"kitchenmind_sqlite_{os.getpid()}"
    build, run, verify, stop = (
        re.sub(r"(--tag|--name|exec|--time 30|--volume) kitchenmind\b", rf"\1 {name}", line)
        for line in commands(block("docker build"))
    )
    try:
        machine.does(build, within_s=BUILT_TIMEOUT_S)
        machine.does(re.sub(r"kitchenmind$", name, run))
        with machine.proxy(caddy):
            machine.until_ready(lambda: machine.does(f"docker logs --tail 40 {name}"))
        machine.does(verify)
        machine.does(stop)
        assert machine.does(f"docker inspect --format '{{{{.State.ExitCode}}}}' {name}").strip() == "0"
    finally:
        machine.does(f"docker rm --force {name}; docker volume rm --force {name}; docker rmi --force {name}")


def test_the_prolific_guide_uses_no_other_container_commands() -> None:
    prolific = (ROOT / "docs" / "guides" / "run_a_prolific_study.md").read_text(encoding="utf-8")
    others = set(commands(prolific)) - set(commands(guide_machine.GUIDE))
    assert {line.partition(EXEC)[0] for line in others} == {""}, "of these only the commands of the server are new"
    for line in others:
        parse(shlex.split(line.removeprefix(EXEC)))
    assert len(commands(prolific)) - len(others) > 3
