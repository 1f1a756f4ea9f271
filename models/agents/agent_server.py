"""`kitchenmind agent serve NAME`: serve an agent over HTTP for a study (`models/agents/http_agent.py` is the client).

POST {"layout", "grid", "observations"} to any path is answered with {"probabilities"}; GET has the JSON Schema of both.
"""

import argparse
import json
import sys
import threading
from collections.abc import Callable
from functools import lru_cache
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Final, Self

import msgspec
import numpy as np

from models.acting import distribution
from models.agents.catalogue import LoadedAgent, load_agent
from models.agents.checked_policy import CheckedPolicy, explained
from models.agents.given_agents import GivenAgent, loader_of
from models.inference.checked_output import usable_rows
from models.protocols import Observations
from overcooked.constants import ACTIONS
from overcooked.layout import Layout, LayoutError, load_layout, parse_layout
from overcooked.planes import PLANES
from overcooked.state import Kitchens

PORT: Final = 9000
MAX_QUESTION_BYTES: Final = 64 * 1024 * 1024
_MAX_KITCHENS: Final = 32  # whose agents are kept


class AgentQuestion(msgspec.Struct):
    """The request: the kitchen, and for each game the 26 planes (width, height, 26) of the agent's chef."""

    layout: str
    grid: list[str]
    observations: list[list[list[list[int]]]]


class AgentAnswer(msgspec.Struct):
    """The response: for each game the probabilities of north, south, east, west, stay and interact; six zeros where
    the agent has no answer."""

    probabilities: list[list[float]]


class BadQuestion(ValueError):
    """A request that cannot be answered; the message says why."""


def schema() -> dict[str, Any]:
    """Return the JSON Schema of requests and responses."""
    _, definitions = msgspec.json.schema_components((AgentQuestion, AgentAnswer), ref_template="#/$defs/{name}")
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "$defs": definitions}


class AgentServer:
    """Serve an agent at `url` in a thread until `close`, or the end of a `with` block."""

    def __init__(self, load: Callable[[Layout], LoadedAgent], host: str = "127.0.0.1", port: int = 0) -> None:
        """`load` makes the agent of a kitchen; `port` 0 takes a free one. Raises OSError if the port is taken."""
        self._load = lru_cache(_MAX_KITCHENS)(lambda text, name: load(parse_layout(text, name)))
        self._one_at_a_time = threading.Lock()  # an agent need not be thread-safe
        self._server = _Server((host, port), _handler(self))
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """The address to give as `model` in a study file."""
        host, port = self._server.server_address[:2]
        return f"http://{host!s}:{port}/act"

    def answer(self, body: bytes) -> bytes:
        """Return the response to a request. Raises BadQuestion, and whatever the agent raises."""
        try:
            question = msgspec.json.decode(body, type=AgentQuestion)
            grid = "\n".join(question.grid)
            layout = parse_layout(grid, question.layout)
            observations = _planes(question.observations, layout)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError, LayoutError) as error:
            raise BadQuestion(str(error)) from None
        with self._one_at_a_time:
            policy, mode = self._load(grid, question.layout)
            given, usable = usable_rows(policy.probabilities(observations), (len(observations), ACTIONS))
        if not usable.all():
            sys.stderr.write("the agent gave no probabilities for some of its games\n")
        is_as_given = mode.temperature == 1  # the game counts how long a chef is stuck; this server is stateless
        chances = given if is_as_given else distribution(given, np.zeros(len(given), np.int32), mode)
        return msgspec.json.encode(AgentAnswer((chances * usable[:, None]).tolist()))

    def wait(self) -> None:
        """Serve until the thread ends, or Ctrl+C."""
        while self._thread.is_alive():
            self._thread.join(1.0)  # with a timeout: a Ctrl+C just before the wait would not end it

    def close(self) -> None:
        """Stop answering."""
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore a client that disconnected; print the traceback of every other error."""
        if not isinstance(sys.exc_info()[1], ConnectionError | TimeoutError):
            super().handle_error(request, client_address)


def _planes(given: list[list[list[list[int]]]], layout: Layout) -> Observations:
    """Return the observations as an array. Raises BadQuestion."""
    wanted = (layout.width, layout.height, PLANES)
    try:
        planes = np.array(given, np.int64)
    except (ValueError, OverflowError) as error:
        raise BadQuestion(f"the observations are not an array of small integers: {error}") from None
    if planes.shape[1:] != wanted or not len(planes):
        raise BadQuestion(
            f"the observations have the shape {planes.shape}; wanted is (games, {', '.join(map(str, wanted))})"
        )
    if planes.min() < -128 or planes.max() > 127:
        raise BadQuestion("the observations have numbers outside -128 to 127")
    return planes.astype(np.int8)


def _handler(agents: AgentServer) -> type[BaseHTTPRequestHandler]:
    class _Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"  # keep the connection open for the next request
        timeout = 60
        disable_nagle_algorithm = True  # otherwise the answer waits 40 ms for the client to acknowledge its headers

        def do_GET(self) -> None:
            self._send(HTTPStatus.OK, json.dumps(schema()).encode())

        def do_POST(self) -> None:
            length = self.headers.get("Content-Length", "")
            if not length.isdecimal() or int(length) > MAX_QUESTION_BYTES:
                self.close_connection = True
                most = f"a question has a Content-Length of at most {MAX_QUESTION_BYTES}"
                self._send(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, _error(most))
                return
            body = self.rfile.read(int(length))
            try:
                answer = agents.answer(body)
            except BadQuestion as error:
                self._send(HTTPStatus.BAD_REQUEST, _error(str(error)))
            except Exception as error:  # noqa: BLE001 somebody's agent may raise anything
                sys.stderr.write(f"the agent failed: {explained(error)}\n")
                self._send(HTTPStatus.INTERNAL_SERVER_ERROR, _error(f"the agent failed: {error}"))
            else:
                self._send(HTTPStatus.OK, answer)

        def _send(self, status: HTTPStatus, body: bytes) -> None:
            self.send_response(status)
            self.send_header("Content-Type", "application/json")
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, format: str, *arguments: Any) -> None:
            """Do not log each request."""

    return _Handler


def _error(text: str) -> bytes:
    return json.dumps({"error": text}).encode()


def serve_agent(agent: GivenAgent, port: int = PORT, host: str = "127.0.0.1") -> AgentServer:
    """Serve an agent of this process, for example of a notebook, and return its server: `url` is what a study file
    names, `close()` ends it. `agent`: a name, a class that is made with the layout, or an object with `probabilities`.
    Raises OSError if the port is taken, TypeError for something else."""
    return AgentServer(loader_of(agent), host, port)


def add_arguments(kinds: Any) -> None:
    """Add `serve` to the commands of `kitchenmind agent`."""
    serve = kinds.add_parser("serve", help="serve an agent over HTTP, for a study on another machine")
    serve.add_argument("name", help="module:Class, bundled agent, checkpoint folder or ONNX file")
    serve.add_argument("--port", type=int, default=PORT, help=f"port; 0 takes a free one ({PORT})")
    serve.add_argument("--host", default="127.0.0.1", help="address to listen on (127.0.0.1)")
    serve.add_argument("--layout", default="coordination_ring", help="test the agent in this kitchen first")


def run(arguments: argparse.Namespace) -> int:
    """Serve until Ctrl+C; 2 if the agent does not load or answer, or the port is taken."""
    if not 0 <= arguments.port <= 65535:
        print(f"kitchenmind agent serve: --port {arguments.port} is not a port. Give 0 to 65535.", file=sys.stderr)
        return 2
    try:
        layout = load_layout(arguments.layout)
        policy, _ = load_agent(arguments.name, layout)
        CheckedPolicy(policy, arguments.name).probabilities(Kitchens.start(layout).encode()[:, 0].copy())
    except (ValueError, OSError) as error:  # ours, which name the remedy
        print(f"kitchenmind agent serve: {arguments.name} cannot be served: {error}", file=sys.stderr)
        return 2
    try:
        server = AgentServer(loader_of(arguments.name), arguments.host, arguments.port)
    except OSError as error:
        place = f"{arguments.host}:{arguments.port}"
        remedy = "Give another --port (0 takes a free one) or another --host."
        print(f"kitchenmind agent serve: {place}: {error.strerror}. {remedy}", file=sys.stderr)
        return 2
    with server:
        print(f"{arguments.name} answers at {server.url}  (stop with Ctrl+C)", flush=True)
        server.wait()
    return 0
