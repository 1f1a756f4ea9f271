"""Agents behind an HTTP address: answers, limits of time and size, and lost connections."""

import json
import re
import socket
import threading
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from models.agents import http_agent
from models.agents.blackbox import BlackBoxError, load_foreign_agent
from overcooked.layout import load_layout
from overcooked.state import Kitchens

RING = load_layout("coordination_ring")
STATES = Kitchens.start(RING, 3).encode()[:, 0].copy()


@pytest.fixture
def address():
    """An HTTP agent whose behaviour depends on the path."""

    class Agent(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_POST(self):
            question = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            games = len(question["observations"])
            answers = {
                "/actions": {"actions": [2] * games},
                "/distribution": {"probabilities": [[0.5, 0.5, 0, 0, 0, 0]] * games},
                "/wrong": {"actions": [9] * games},
                "/layout": {"actions": [len(question["grid"])] * games},
            }
            body = json.dumps(answers.get(self.path, "?")).encode()
            self.send_response(500 if self.path == "/down" else 200)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Agent)
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    thread.join()
    server.server_close()


@contextmanager
def agent_at(url):
    policy, _ = load_foreign_agent(url, RING)
    yield policy
    policy.close()


def test_an_agent_behind_an_address_answers_with_actions_or_probabilities(address):
    with agent_at(f"{address}/actions") as policy:
        assert policy.probabilities(STATES).argmax(1).tolist() == [2, 2, 2]
        assert policy.probabilities(STATES[:1]).argmax(1).tolist() == [2]
    with agent_at(f"{address}/distribution") as policy:
        assert policy.probabilities(STATES)[0].tolist() == [0.5, 0.5, 0, 0, 0, 0]
    with agent_at(f"{address}/layout") as policy:
        assert policy.probabilities(STATES[:1]).argmax() == 5


@pytest.mark.parametrize(
    ("path", "reason"), [("wrong", "outside 0-5"), ("down", "answered 500"), ("text", "must answer")]
)
def test_an_address_that_answers_nonsense_is_an_error(address, path, reason):
    with agent_at(f"{address}/{path}") as policy, pytest.raises(BlackBoxError, match=reason):
        policy.probabilities(STATES)


def read_request(connection):
    """All of it: a connection that is closed with something unread is reset, and the answer may be lost."""
    request = b""
    while b"\r\n\r\n" not in request:
        request += connection.recv(65536)
    head, _, body = request.partition(b"\r\n\r\n")
    left = int(re.search(rb"Content-Length: (\d+)", head)[1]) - len(body)
    while left > 0:
        left -= len(connection.recv(65536))


@pytest.fixture
def raw_address():
    """An address that answers every connection with what the test gives: chunks of bytes, each sent with a pause."""
    stop = threading.Event()
    listening = socket.create_server(("127.0.0.1", 0))
    listening.settimeout(0.1)
    answer = {"chunks": [], "pause_s": 0.0, "sent": 0}

    def serve():
        while not stop.is_set():
            try:
                connection, _ = listening.accept()
            except TimeoutError:
                continue
            with connection, suppress(OSError):
                read_request(connection)
                for chunk in answer["chunks"]:
                    connection.sendall(chunk)
                    answer["sent"] += len(chunk)
                    if stop.wait(answer["pause_s"]):
                        return

    thread = threading.Thread(target=serve)
    thread.start()
    yield f"http://127.0.0.1:{listening.getsockname()[1]}/", answer
    stop.set()
    thread.join()
    listening.close()


HEAD = b"HTTP/1.1 200 OK\r\nContent-Length: 100000000\r\n\r\n"


@pytest.mark.parametrize("where", ["headers", "body"])
def test_an_answer_that_trickles_in_is_given_up_after_the_time_for_one_call(raw_address, monkeypatch, where):
    url, answer = raw_address
    monkeypatch.setattr(http_agent, "TIMEOUT_S", 0.3)
    trickle = [b"1"] * 10_000 if where == "body" else [b"X-A: b\r\n"] * 10_000
    answer |= {"chunks": [HEAD if where == "body" else HEAD[:17], *trickle], "pause_s": 0.1}
    with agent_at(url) as policy, pytest.raises(BlackBoxError, match=r"no whole answer within|timed out"):
        policy.probabilities(STATES)
    assert answer["sent"] < 1000


def test_an_answer_without_end_is_read_up_to_the_limit_only(raw_address):
    url, answer = raw_address
    answer["chunks"] = [HEAD, *[b" " * 1_000_000] * 100]
    with agent_at(url) as policy, pytest.raises(BlackBoxError, match=r"more than 1,000,000 bytes"):
        policy.probabilities(STATES)
    assert answer["sent"] < 50_000_000


@pytest.mark.parametrize(
    "body",
    [
        b"[" * 100_000,
        b'{"actions": ' + b"[" * 100_000,
        b'{"other": ' + b"[" * 100_000,
        b'{"actions": [1, 2]}',
        b'{"actions": [1e999, 0, 0]}',
        b'{"actions": [99999999999999999999999, 0, 0]}',
        b'{"actions": null}',
        b'{"probabilities": [[1], [1, 0], []]}',
        b'{"probabilities": [[[0.5]]]}',
        b"\xff\xfe",
        b"",
    ],
    ids=lambda body: repr(body[:24]),
)
def test_an_answer_that_cannot_be_read_is_an_error_of_the_agent(raw_address, body):
    url, answer = raw_address
    answer["chunks"] = [b"HTTP/1.1 200 OK\r\nConnection: close\r\nContent-Length: %d\r\n\r\n" % len(body) + body]
    with agent_at(url) as policy, pytest.raises(BlackBoxError, match=r"127\.0\.0\.1"):
        policy.probabilities(STATES)


def test_an_answer_on_a_connection_that_closes_is_read_whole(raw_address):
    url, answer = raw_address
    answer["chunks"] = [b"HTTP/1.1 200 OK\r\nConnection: close\r\n\r\n", b'{"actions": [2, ', b"2, 3]}"]
    with agent_at(url) as policy:
        assert policy.probabilities(STATES).argmax(1).tolist() == [2, 2, 3]
        assert policy.probabilities(STATES).argmax(1).tolist() == [2, 2, 3]


def test_a_connection_that_the_address_closed_in_a_pause_is_opened_again(raw_address):
    url, answer = raw_address
    body = b'{"actions": [2, 2, 3]}'
    answer["chunks"] = [b"HTTP/1.1 200 OK\r\nContent-Length: %d\r\n\r\n" % len(body) + body]
    with agent_at(url) as policy:
        for _ in range(3):
            assert policy.probabilities(STATES).argmax(1).tolist() == [2, 2, 3]


def test_an_address_that_closes_every_connection_is_an_error(raw_address):
    url, _ = raw_address
    with agent_at(url) as policy, pytest.raises(BlackBoxError, match="does not answer as an agent should"):
        policy.probabilities(STATES)


def test_an_address_with_a_wrong_port_is_refused():
    with pytest.raises(BlackBoxError, match="is not an address"):
        load_foreign_agent("http://127.0.0.1:x/", RING)


def test_an_address_where_nobody_listens_is_an_error():
    policy, _ = load_foreign_agent("http://127.0.0.1:9/", RING)
    with pytest.raises(BlackBoxError, match=r"does not answer .* Check that it is running at this address\."):
        policy.probabilities(STATES)
