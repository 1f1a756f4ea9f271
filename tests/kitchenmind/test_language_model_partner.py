"""The example of a language-model partner keeps its deadline whatever the endpoint does: it acts on its last plan."""

import json
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import numpy as np
import pytest

import kitchenmind
from models.agents.http_agent import HttpAgent
from overcooked.layout import load_layout
from overcooked.state import Kitchens
from server.settings import ROOT

ROOM = load_layout("cramped_room")


class FakeModel:
    """An endpoint with chat completions: answers `goal` with `status`, once `hold` is set."""

    def __init__(self) -> None:
        self.hold = threading.Event()
        self.hold.set()
        self.status, self.goal = 200, "serve"
        self.asked: list[dict[str, Any]] = []
        self.keys: list[str | None] = []
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), _handler(self))
        self._server.daemon_threads = True
        threading.Thread(target=self._server.serve_forever, daemon=True).start()
        self.url = f"http://127.0.0.1:{self._server.server_port}/v1"

    def close(self) -> None:
        self.hold.set()
        self._server.shutdown()
        self._server.server_close()


def _handler(model: FakeModel) -> type[BaseHTTPRequestHandler]:
    class _ModelHandler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            model.keys.append(self.headers.get("Authorization"))
            model.asked.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))) | {"path": self.path})
            model.hold.wait()
            body = json.dumps({"choices": [{"message": {"content": model.goal}}]}).encode()
            self.send_response(model.status)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: Any) -> None: ...

    return _ModelHandler


@pytest.fixture
def model(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeModel]:
    made = FakeModel()
    monkeypatch.setenv("LLM_URL", made.url)
    monkeypatch.setenv("LLM_API_KEY", "a key")
    yield made
    made.close()


@pytest.fixture
def partner_class(model: FakeModel, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The example's class. Those that a test makes are closed after it."""
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "examples"))
    import language_model_partner  # type: ignore[import-not-found]

    monkeypatch.setattr(language_model_partner, "REST_S", (0.01, 0.01))
    made: list[Any] = []

    class TestedPartner(language_model_partner.LanguageModelPartner):  # type: ignore[misc]
        def __init__(self, layout: Any) -> None:
            super().__init__(layout)
            made.append(self)

    yield TestedPartner
    model.hold.set()
    for one in made:
        one.close()
    sys.modules.pop("language_model_partner")


def until(holds: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def start() -> Any:
    return Kitchens.start(ROOM).encode()[:, 0]


def test_it_acts_while_the_model_thinks_and_on_the_plan_once_it_is_there(model: FakeModel, partner_class: Any) -> None:
    model.hold.clear()
    model.goal = "I will wait."
    partner = partner_class(ROOM)
    first = partner.probabilities(start())  # the model has not answered: `hold` is not set
    until(lambda: len(model.asked) == 1)
    assert first.argmax() != 4, "a cook goes for an onion"
    assert (partner.probabilities(start()) == first).all()
    model.hold.set()
    until(lambda: bool(partner.plans))
    assert partner.probabilities(start()).argmax() == 4
    asked = model.asked[0]
    assert (asked["path"], model.keys[0]) == ("/v1/chat/completions", "Bearer a key")
    assert "You hold nothing" in asked["messages"][1]["content"]


@pytest.mark.parametrize(("status", "goal"), [(500, "onion"), (401, "onion"), (200, "pizza"), (200, "")])
def test_it_keeps_cooking_if_the_model_fails(model: FakeModel, partner_class: Any, status: int, goal: str) -> None:
    model.status, model.goal = status, goal
    partner = partner_class(ROOM)
    before = partner.probabilities(start())

    def failed_again() -> bool:
        assert (partner.probabilities(start()) == before).all()
        return partner.failures > 1

    until(failed_again)
    assert partner.plans == {}


def test_a_plan_outlives_an_endpoint_that_goes_away(model: FakeModel, partner_class: Any) -> None:
    model.goal = "wait"
    partner = partner_class(ROOM)
    partner.probabilities(start())
    until(lambda: bool(partner.plans))
    model.close()
    kitchens = Kitchens.start(ROOM)
    kitchens.players[0, 1, 3] = 1  # another situation: the other chef holds an onion
    assert partner.probabilities(kitchens.encode()[:, 0]).argmax() == 4, "the last plan for an empty hand holds"


def test_it_plays_whole_games_behind_an_address_with_an_endpoint_that_never_answers(
    model: FakeModel, partner_class: Any
) -> None:
    model.hold.clear()
    with kitchenmind.serve_agent(partner_class, port=0) as serving:
        with closing(HttpAgent(serving.url, ROOM)) as agent:
            answer = agent.probabilities(np.repeat(start(), 3, axis=0))
        assert answer.shape == (3, 6)
    played = kitchenmind.simulate(ROOM, ["planner", partner_class], 1, horizon=200)
    assert played["score"].item() > 0
