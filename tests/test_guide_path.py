"""The guide's server behind a path: nginx passes the path on, as the guide says, or removes it."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.support.databases import with_tables
from tests.support.guide_machine import OWN, GuideMachine, block, nginx_with

pytestmark = [pytest.mark.slow, pytest.mark.timeout(280)]


def keeps_the_path(machine: GuideMachine) -> list[str]:
    return nginx_with(machine, machine.ours(block("location /kitchen/ {")))


def removes_the_path(machine: GuideMachine) -> list[str]:
    own = machine.ours(block("location /kitchen/ {"))
    return nginx_with(machine, own.replace(f"127.0.0.1:{machine.http};", f"127.0.0.1:{machine.http}/;"))


@pytest.mark.parametrize("proxy", [keeps_the_path, removes_the_path])
async def test_a_person_plays_behind_a_path_of_nginx(
    proxy: Callable[[GuideMachine], list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine = GuideMachine(folder=tmp_path, path="/kitchen")
    settings = machine.make_settings()
    assert "/kitchen" in settings
    given = dict(line.split("=", 1) for line in settings.splitlines())
    given |= {"KITCHENMIND_MODE": "production", "KITCHENMIND_PORT": str(machine.http)}
    given |= {"KITCHENMIND_DATABASE": with_tables(tmp_path / "study.sqlite3")}
    with machine.proxy(proxy), (tmp_path / "log").open("wb") as log:
        running = subprocess.Popen(
            [*OWN.split(), "serve"], cwd=tmp_path, env=machine.environment() | given, stdout=log, stderr=log
        )
        try:
            machine.until_ready(lambda: (tmp_path / "log").read_text())
            await machine.play(monkeypatch)
        finally:
            running.kill()
            running.wait()
