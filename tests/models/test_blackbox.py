"""Agents and predictors from outside: ONNX files, Python classes, addresses."""

import json
import re
import socket
import threading
from contextlib import contextmanager, suppress
from hashlib import sha256
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import onnx
import pytest
from onnx import TensorProto

import kitchenmind
from models.agents import http_agent
from models.agents.blackbox import BlackBoxError, load_foreign_agent, load_foreign_predictor
from models.agents.catalogue import agent_sha256
from models.agents.onnx_models import _softmax_if_needed
from models.agents.onnx_weights import external_files
from overcooked.layout import load_layout
from overcooked.state import Kitchens
from tests.support import onnx_files

RING = load_layout("coordination_ring")
STATES = Kitchens.start(RING, 3).encode()[:, 0].copy()


def softmax(logits):
    raised = np.exp(logits - logits.max(-1, keepdims=True))
    return raised / raised.sum(-1, keepdims=True)


@pytest.mark.parametrize("shape", [["games", 5, 5, 26], ["games", 26, 5, 5], ["games", 650], ["games", "w", "h", 26]])
@pytest.mark.parametrize("answers_probabilities", [True, False])
def test_an_onnx_agent_is_called_with_its_input_shape(shape, answers_probabilities, tmp_path):
    if "w" in shape:
        weights = onnx_files.linear_agent(tmp_path / "a.onnx", ["games", 5, 5, 26], softmax=answers_probabilities)
    else:
        weights = onnx_files.linear_agent(tmp_path / "a.onnx", shape, softmax=answers_probabilities)
    policy, mode = load_foreign_agent(str(tmp_path / "a.onnx"), RING)
    seen = np.moveaxis(STATES, -1, 1) if shape[1] == 26 else STATES
    expected = softmax(seen.reshape(3, -1).astype(np.float32) @ weights)
    assert np.allclose(policy.probabilities(STATES), expected, atol=1e-4)
    assert (mode.temperature, mode.stuck_mix) == (1.0, 0.0)


def test_an_onnx_agent_may_read_small_integers(tmp_path):
    onnx_files.linear_agent(tmp_path / "a.onnx", ["games", 5, 5, 26], kind=TensorProto.INT8)
    policy, _ = load_foreign_agent(str(tmp_path / "a.onnx"), RING)
    assert np.allclose(policy.probabilities(STATES).sum(1), 1, atol=1e-5)


def test_an_onnx_agent_of_another_kitchen_is_refused_with_the_shapes_that_fit(tmp_path):
    onnx_files.linear_agent(tmp_path / "a.onnx", ["games", 7, 5, 26])
    with pytest.raises(BlackBoxError, match=r"must end in \[5, 5, 26\], \[26, 5, 5\] or \[650\]"):
        load_foreign_agent(str(tmp_path / "a.onnx"), RING)


def test_something_that_is_not_a_model_is_refused(tmp_path):
    (tmp_path / "broken.onnx").write_bytes(b"nothing")
    for name, reason in [
        (str(tmp_path / "broken.onnx"), "is not an ONNX model"),
        (str(tmp_path / "missing.onnx"), "there is no file"),
        ("tests.support.foreign_models:Nobody", "was not found"),
        ("tests.support.foreign_models:Remembering", "no method probabilities"),
    ]:
        with pytest.raises(BlackBoxError, match=reason):
            load_foreign_agent(name, RING)


def test_an_onnx_predictor_sees_the_last_ten_steps_with_the_current_action_hidden(tmp_path):
    weights = onnx_files.linear_predictor(tmp_path / "p.onnx", 5, 5)
    predictor = load_foreign_predictor(str(tmp_path / "p.onnx"), RING)
    slots, draws = np.array([2, 0]), np.random.default_rng(0)
    predictor.begin(slots)
    taken = [np.full((2, 2), -1)]
    for _ in range(14):
        answer = predictor.predict(slots, STATES[:2], taken[-1].astype(np.int8))
        taken.append(draws.integers(0, 6, (2, 2)))
    hot = np.zeros((10, 12), np.float32)
    for place, joint in enumerate(taken[5:14]):
        hot[place, [joint[0, 0], 6 + joint[0, 1]]] = 1
    assert np.allclose(answer[0], softmax((hot.ravel() @ weights).reshape(3, 6)), atol=1e-4)


def test_a_predictor_cannot_be_an_address():
    with pytest.raises(BlackBoxError, match="Give an ONNX file"):
        load_foreign_predictor("http://127.0.0.1:1/", RING)


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


def checked(capsys, *words):
    status = kitchenmind.main(["agent", "check", *words, "--layout", "coordination_ring"])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def test_agent_check_describes_an_agent(capsys, tmp_path):
    onnx_files.linear_agent(tmp_path / "a.onnx", ["games", 5, 5, 26])
    status, out, _ = checked(capsys, str(tmp_path / "a.onnx"), "--deadline-ms", "60000")
    assert status == 0
    assert "it can be used" in out
    assert "deterministic  yes" in out
    status, out, _ = checked(
        capsys, "tests.support.foreign_models:Remembering", "--predictor", "--deadline-ms", "60000"
    )
    assert status == 0
    status, out, _ = checked(capsys, "planner", "--deadline-ms", "60000")
    assert "certain        in 100% of the states" in out


def test_agent_check_refuses_what_does_not_fit(capsys):
    status, _, err = checked(capsys, "tests.support.foreign_models:WrongShape")
    assert status == 1
    assert "it gave an array of shape (1, 3), wanted (1, 6)" in err
    status, _, err = checked(capsys, "tests.support.foreign_models:BrokenAfterWarming")
    assert status == 1
    assert "gave NaN, infinite or negative probabilities" in err
    status, _, err = checked(capsys, "tests.support.foreign_models:Overconfident", "--predictor")
    assert status == 1
    assert "gave an intention whose probability is not between 0 and 1" in err
    status, _, err = checked(capsys, "planner", "--deadline-ms", "0.0001")
    assert status == 1
    assert "is too slow" in err
    status, _, err = checked(capsys, "nobody")
    assert status == 2
    assert "Known: planner" in err


def test_a_path_that_is_not_there_is_named_from_the_root(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # as from another folder than the one that the path begins in
    for name, said in (("./mine", f"there is no folder {tmp_path}/mine. "), ("a.onnx", f"no file {tmp_path}/a.onnx. ")):
        status, _, err = checked(capsys, name)
        assert (status, said in err) == (2, True)
    assert kitchenmind.main(["agent", "check", "planner", "--layout", "nook.layout"]) == 2
    assert f"check: there is no layout 'nook.layout' in {tmp_path}. Known: " in capsys.readouterr().err


@pytest.mark.parametrize(
    "kind",
    [TensorProto.FLOAT16, TensorProto.UINT8, TensorProto.INT16, TensorProto.INT64, TensorProto.UINT64],
    ids=["float16", "uint8", "int16", "int64", "uint64"],
)
def test_an_onnx_agent_may_read_any_type_of_number(kind, tmp_path):
    expected = onnx_files.linear_agent(tmp_path / "a.onnx", ["games", 5, 5, 26])
    onnx_files.linear_agent(tmp_path / "b.onnx", ["games", 5, 5, 26], kind=kind)
    policy, _ = load_foreign_agent(str(tmp_path / "b.onnx"), RING)
    wanted = softmax(STATES.reshape(3, -1).astype(np.float32) @ expected)
    assert np.allclose(policy.probabilities(STATES), wanted, atol=1e-4)


def test_a_type_that_cannot_be_given_is_named(tmp_path):
    onnx_files.linear_agent(tmp_path / "a.onnx", ["games", 5, 5, 26], kind=TensorProto.BOOL)
    with pytest.raises(
        BlackBoxError, match=r"expects tensor\(bool\), which is not supported. Cast it .* float16"
    ) as refusal:
        load_foreign_agent(str(tmp_path / "a.onnx"), RING)
    assert "must end in" not in str(refusal.value)


@pytest.mark.parametrize("size", [1, 2])
def test_an_onnx_agent_with_a_fixed_batch_size_is_called_in_parts(size, tmp_path):
    weights = onnx_files.linear_agent(tmp_path / "a.onnx", [size, 5, 5, 26])
    policy, _ = load_foreign_agent(str(tmp_path / "a.onnx"), RING)
    for games in (1, 2, 3):
        expected = softmax(STATES[:games].reshape(games, -1).astype(np.float32) @ weights)
        assert np.allclose(policy.probabilities(STATES[:games]), expected, atol=1e-4)


def test_nan_of_one_game_does_not_change_how_the_answers_about_others_are_read():
    probabilities = np.array([[0.5, 0.5, 0, 0, 0, 0], [np.nan] * 6], np.float32)
    assert _softmax_if_needed(probabilities)[0].tolist() == [0.5, 0.5, 0, 0, 0, 0]
    assert _softmax_if_needed(probabilities * 3)[0, 0] < 0.5, "these are logits"


def test_an_onnx_predictor_for_one_game_watches_several(tmp_path):
    onnx_files.linear_predictor(tmp_path / "many.onnx", 5, 5)
    onnx_files.linear_predictor(tmp_path / "one.onnx", 5, 5, games=1)
    slots, draws = np.array([2, 0, 1]), np.random.default_rng(0)
    many, one = (load_foreign_predictor(str(tmp_path / name), RING) for name in ("many.onnx", "one.onnx"))
    for predictor in (many, one):
        predictor.begin(slots)
    for _ in range(4):
        actions = draws.integers(0, 6, (3, 2)).astype(np.int8)
        assert np.allclose(one.predict(slots, STATES, actions), many.predict(slots, STATES, actions), atol=1e-5)


def test_a_model_that_fails_in_a_batch_is_reported_in_plain_words(tmp_path):
    onnx_files.linear_agent(tmp_path / "a.onnx", ["games", 5, 5, 26], games_inside=1)
    policy, _ = load_foreign_agent(str(tmp_path / "a.onnx"), RING)
    assert policy.probabilities(STATES[:1]).shape == (1, 6)
    with pytest.raises(BlackBoxError, match=r"fails with 3 games at once\. Export it with a free first dimension"):
        policy.probabilities(STATES)


def test_weights_next_to_an_onnx_model_are_part_of_its_hash(tmp_path):
    onnx_files.linear_agent(tmp_path / "a.onnx", ["games", 5, 5, 26], weights_file="a.weights")
    assert external_files(tmp_path / "a.onnx") == ["a.weights"]
    load_foreign_agent(str(tmp_path / "a.onnx"), RING)
    first = agent_sha256(str(tmp_path / "a.onnx"), RING)
    changed = bytearray((tmp_path / "a.weights").read_bytes())
    changed[10] ^= 1
    (tmp_path / "a.weights").write_bytes(changed)
    assert agent_sha256(str(tmp_path / "a.onnx"), RING) != first
    (tmp_path / "a.weights").unlink()
    with pytest.raises(BlackBoxError, match=r"keeps weights in a\.weights, which is missing"):
        load_foreign_agent(str(tmp_path / "a.onnx"), RING)


def test_hash_of_a_model_in_one_file_is_that_of_the_file(tmp_path):
    onnx_files.linear_agent(tmp_path / "a.onnx", ["games", 5, 5, 26])
    assert agent_sha256(str(tmp_path / "a.onnx"), RING) == sha256((tmp_path / "a.onnx").read_bytes()).hexdigest()


def test_weights_outside_the_folder_of_a_model_are_refused(tmp_path):
    (tmp_path / "in").mkdir()
    onnx_files.linear_agent(tmp_path / "in" / "a.onnx", ["games", 5, 5, 26], weights_file="a.weights")
    model = (tmp_path / "in" / "a.onnx").read_bytes()
    (tmp_path / "in" / "a.onnx").write_bytes(model.replace(b"a.weights", b"../weight"))
    (tmp_path / "weight").write_bytes((tmp_path / "in" / "a.weights").read_bytes())
    with pytest.raises(BlackBoxError, match="must be in the folder of the model"):
        load_foreign_agent(str(tmp_path / "in" / "a.onnx"), RING)


def test_weights_in_a_subgraph_are_found(tmp_path):
    inner = onnx.helper.make_tensor("w", TensorProto.FLOAT, [1], b"1234", raw=True)
    inner.data_location = TensorProto.EXTERNAL
    inner.external_data.add(key="location", value="deep.bin")
    constant = onnx.helper.make_node("Constant", [], ["c"], value=inner)
    branch = onnx.helper.make_graph([constant], "branch", [], [])
    node = onnx.helper.make_node("If", ["x"], ["y"], then_branch=branch, else_branch=branch)
    model = onnx.helper.make_model(onnx.helper.make_graph([node], "g", [], []))
    (tmp_path / "m.onnx").write_bytes(model.SerializeToString())
    (tmp_path / "deep.bin").write_bytes(b"1234")
    assert external_files(tmp_path / "m.onnx") == ["deep.bin"]
