"""An agent behind HTTP, served by `kitchenmind agent serve` or from a notebook, plays with people."""

import json
import re
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

import kitchenmind
from kitchenmind.client import GameClient, take_part
from models.agents.agent_server import AgentServer
from models.agents.catalogue import load_agent
from models.agents.http_agent import HttpAgent
from models.protocols import BlackBoxError, Observations, Probabilities
from overcooked.layout import Layout, load_layout
from overcooked.state import Kitchens
from server.play import messages
from tests.support import command_line
from tests.support.ctrl_c import ctrl_c_enabled
from tests.support.real_server import SHORT_STUDY, RealServer

ROOT = Path(__file__).parents[2]
RING = load_layout("coordination_ring")
QUESTION = {
    "layout": RING.name,
    "grid": RING.grid,
    "observations": Kitchens.start(RING).encode()[:, 0].tolist(),
}


class NorthAgent:
    """Goes north whatever it sees."""

    asked = 0

    def __init__(self, layout: Layout) -> None:
        self.layout = layout

    def probabilities(self, observations: Observations) -> Probabilities:
        type(self).asked += len(observations)
        return np.eye(6, dtype=np.float32)[np.zeros(len(observations), np.int8)]


class Failing(NorthAgent):
    def probabilities(self, observations: Observations) -> Probabilities:
        raise RuntimeError("out of ideas")


class NanForTheFirst(NorthAgent):
    def probabilities(self, observations: Observations) -> Probabilities:
        answer = super().probabilities(observations)
        answer[0] = np.nan
        return answer


@pytest.fixture
def northward() -> Iterator[AgentServer]:
    with kitchenmind.serve_agent(NorthAgent, port=0) as serving:
        yield serving


@pytest.mark.slow
async def test_an_agent_of_this_process_plays_a_whole_episode_with_somebody(
    northward: AgentServer, tmp_path: Path
) -> None:
    """The server asks it from a separate process, as a study does."""
    study = SHORT_STUDY.replace(
        "{name: planner, predictor: sp_predictor_stream}",
        f'{{name: mine, model: "{northward.url}", predictor: random}}',
    )
    study = study.replace("{name: tom, predictor: tom}, {name: random, predictor: random}, ", "").replace(
        "tutorial, ", ""
    )
    partners: list[int] = []

    class WatchingClient(GameClient):
        def act(self, tick: messages.Tick) -> int | None:
            if self.welcome is not None and tick.state.t > 0:
                partners.append(tick.actions[1 - self.welcome.seat])
            return super().act(tick)

    before = NorthAgent.asked
    with RealServer(tmp_path, speed=4.0, study=study.replace("horizon: 60", "horizon: 30")) as server:
        done = await take_part(server.url, "short", WatchingClient)
    assert [ended.reason for ended in done.games] == ["horizon", "horizon"]
    assert NorthAgent.asked > before
    assert 0 in partners
    assert set(partners) <= {0, 4}, "it goes north, and waits where its answer was late"


def test_the_command_serves_an_agent_that_a_study_can_ask() -> None:
    words = [sys.executable, str(ROOT / "kitchenmind"), "agent", "serve", "sp@greedy", "--port", "0"]
    with ctrl_c_enabled():
        process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    with process:
        try:
            assert process.stdout is not None
            found = re.search(r"http://\S+", process.stdout.readline())
            assert found is not None
            seen = Kitchens.start(RING, 3).encode()[:, 1].copy()
            with closing(HttpAgent(found[0], RING)) as agent:
                there = agent.probabilities(seen)
            here = load_agent("sp@greedy", RING).policy.probabilities(seen)
            assert (there.argmax(1) == here.argmax(1)).all()
            assert there.max() == 1, "greedy, as its name says"
        finally:
            process.send_signal(signal.SIGINT)
        assert process.wait(60) == 130


def test_the_schema_describes_question_and_answer(northward: AgentServer) -> None:
    jsonschema_rs = pytest.importorskip("jsonschema_rs")
    schema = httpx.get(northward.url).raise_for_status().json()
    answer = httpx.post(northward.url, json=QUESTION).raise_for_status().json()
    for name, message in (("AgentQuestion", QUESTION), ("AgentAnswer", answer)):
        checks = jsonschema_rs.Draft202012Validator(schema | {"$ref": f"#/$defs/{name}"})
        assert checks.is_valid(json.loads(json.dumps(message)))
        assert not checks.is_valid({})
    assert answer == {"probabilities": [[1, 0, 0, 0, 0, 0]]}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"observations": [[[[0]]]]}, "have the shape"),
        ({"observations": []}, "have the shape"),
        ({"observations": [[[[300] * 26] * 5] * 5]}, "outside -128 to 127"),
        ({"observations": [[[[0]], [[0], [0]]]]}, "not an array"),
        ({"observations": "none"}, "observations"),
        ({"grid": ["X"]}, "layout|coordination_ring"),
    ],
)
def test_a_bad_question_is_answered_with_the_reason(
    northward: AgentServer, change: dict[str, Any], message: str
) -> None:
    answer = httpx.post(northward.url, json=QUESTION | change)
    assert answer.status_code == 400
    assert re.search(message, answer.json()["error"])
    assert httpx.post(northward.url, json=QUESTION).status_code == 200, "it answers the next one"


def test_an_answer_does_not_wait_until_the_client_has_acknowledged_its_headers(northward: AgentServer) -> None:
    """By Nagle's algorithm it would: 40 ms of the 120 ms that a partner has."""
    assert northward._server.RequestHandlerClass.disable_nagle_algorithm  # type: ignore[attr-defined]


def test_a_study_that_goes_away_leaves_no_traceback(northward: AgentServer, capfd: pytest.CaptureFixture[str]) -> None:
    host, port = httpx.URL(northward.url).host, httpx.URL(northward.url).port
    with socket.create_connection((host, port or 0)) as gone:
        gone.sendall(b"POST /act HTTP/1.1\r\nContent-Length: 5\r\n\r\n")
        gone.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # closes with a reset
    assert httpx.post(northward.url, json=QUESTION).status_code == 200
    northward.close()
    assert capfd.readouterr().err == ""


def test_an_agent_that_fails_reports_it_and_continues_to_serve(capfd: pytest.CaptureFixture[str]) -> None:
    with kitchenmind.serve_agent(Failing, port=0) as serving:
        answer = httpx.post(serving.url, json=QUESTION)
        assert (answer.status_code, answer.json()) == (500, {"error": "the agent failed: out of ideas"})
        said = pytest.raises(BlackBoxError, match=r"answered 500: the agent failed: out of ideas\.")
        with closing(HttpAgent(serving.url, RING)) as agent, said:
            agent.probabilities(Kitchens.start(RING).encode()[:, 0].copy())
    assert "RuntimeError: out of ideas" in capfd.readouterr().err


def test_an_agent_without_an_answer_for_one_game_answers_about_the_others(capfd: pytest.CaptureFixture[str]) -> None:
    seen = Kitchens.start(RING, 2).encode()[:, 0].copy()
    with kitchenmind.serve_agent(NanForTheFirst, port=0) as serving, closing(HttpAgent(serving.url, RING)) as agent:
        assert agent.probabilities(seen).tolist() == [[0] * 6, [1, 0, 0, 0, 0, 0]]
    assert "the agent gave no probabilities for some of its games" in capfd.readouterr().err


def test_what_cannot_be_served_exits_with_2_and_the_reason() -> None:
    for words, reason in (
        (["nowhere:Agent"], "nowhere:Agent was not found"),
        (["tests.kitchenmind.test_serve_agent:Failing"], "RuntimeError: out of ideas (test_serve_agent.py"),
        (["stay", "--port", "99999"], "99999 is not a port"),
        (["stay", "--layout", "nowhere"], "there is no layout 'nowhere'"),
    ):
        done = command_line.run("agent", "serve", *words)
        assert done.returncode == 2
        assert reason in done.stderr
    with socket.create_server(("127.0.0.1", 0)) as taken:
        done = command_line.run("agent", "serve", "stay", "--port", str(taken.getsockname()[1]))
    assert done.returncode == 2
    assert "in use. Give another --port (0 takes a free one)" in done.stderr
    with pytest.raises(TypeError, match="5 is not an agent"):
        kitchenmind.serve_agent(5)  # type: ignore[arg-type]
