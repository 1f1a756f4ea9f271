"""Agents and predictors from ONNX files: inputs, types of numbers, batches and weights."""

from hashlib import sha256

import numpy as np
import onnx
import pytest
from onnx import TensorProto

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
