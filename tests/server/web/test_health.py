"""Endpoints for machines: alive, ready, metrics."""

import json
import logging
import re
import sqlite3
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from server import logging_setup
from server.web.health import METRICS
from tests.support.live_server import LiveServer
from tests.support.real_server import SHORT_STUDY

TOKEN = "a token for those who watch"


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    with LiveServer(tmp_path_factory.mktemp("health"), metrics_token=TOKEN) as serving:
        yield serving


def test_a_server_that_can_play_is_alive_and_ready(live: LiveServer) -> None:
    assert httpx.get(f"{live.url}/health/live").json() == {"status": "alive", "server": "kitchenmind"}
    answer = httpx.get(f"{live.url}/health/ready")
    assert (answer.status_code, answer.json()) == (200, {"ready": True, "missing": []})


def test_a_server_without_models_or_while_stopping_is_not_ready(
    live: LiveServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live.models, "ready", False)
    monkeypatch.setattr(live.app.state.services.games, "stopping", True)
    answer = httpx.get(f"{live.url}/health/ready")
    assert (answer.status_code, answer.json()["missing"]) == (503, ["models", "stopping"])
    assert httpx.get(f"{live.url}/health/live").status_code == 200


def test_a_server_whose_database_does_not_commit_is_not_ready(live: LiveServer) -> None:
    def missing() -> list[str]:
        return httpx.get(f"{live.url}/health/ready", timeout=30).json()["missing"]  # type: ignore[no-any-return]

    def until(wanted: list[str]) -> None:
        deadline = time.monotonic() + 40
        while (found := missing()) != wanted:
            assert time.monotonic() < deadline, found
            time.sleep(0.05)

    intruder = sqlite3.connect(live.database.removeprefix("sqlite:///"), isolation_level=None)
    intruder.execute("BEGIN IMMEDIATE")  # reading continues as if nothing had happened
    until(["database"])
    jobs = live.app.state.services.web.database._jobs
    for _ in range(5):
        assert missing() == ["database"]
    assert jobs.qsize() <= 1, "one test commit waits, however often somebody asks"
    intruder.execute("ROLLBACK")
    intruder.close()
    until([])


def test_metrics_need_the_token(live: LiveServer) -> None:
    assert httpx.get(f"{live.url}/metrics").status_code == 401
    assert httpx.get(f"{live.url}/metrics", headers={"Authorization": "Bearer wrong"}).status_code == 401
    answer = httpx.get(f"{live.url}/metrics", headers={"Authorization": f"Bearer {TOKEN}"})
    lines = [line for line in answer.text.splitlines() if not line.startswith("#")]
    told = {re.sub(r"\{.*", "", line): float(line.split()[-1]) for line in lines}
    assert set(told) == {f"kitchenmind_{name}" for name in METRICS}
    assert told["kitchenmind_games"] == 0
    assert answer.headers["content-type"] == "text/plain; version=0.0.4; charset=utf-8"
    for name, (kind, meaning) in METRICS.items():
        assert f"# HELP kitchenmind_{name} {meaning}\n# TYPE kitchenmind_{name} {kind}\n" in answer.text
    assert told["kitchenmind_resident_memory_bytes"] > 1e6


def test_a_log_for_machines_is_a_json_object_a_line(capfd: pytest.CaptureFixture[str]) -> None:
    root = logging.getLogger()
    before = root.handlers, root.level
    try:
        logging_setup.configure("json")
        try:
            raise ValueError("broken on purpose")
        except ValueError:
            logging.getLogger("server.play.loop").exception("episode %s cannot continue", "abc")
        (line,) = capfd.readouterr().err.splitlines()
        told = json.loads(line)
        assert (told["event"], told["level"], told["logger"]) == (
            "episode abc cannot continue",
            "error",
            "server.play.loop",
        )
        assert "broken on purpose" in told["exception"]
    finally:
        root.handlers, root.level = before


def test_figures_are_hidden_in_production_without_a_token(tmp_path: Path) -> None:
    secret = {"mode": "production", "public_url": "https://lab.example.org"}
    with LiveServer(tmp_path, 1.0, SHORT_STUDY.replace("planner}", "planner, predictor: random}"), **secret) as live:
        assert httpx.get(f"{live.url}/metrics").status_code == 404
        assert httpx.get(f"{live.url}/health/ready").status_code == 200
