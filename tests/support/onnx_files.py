"""Tiny ONNX models for tests, written node by node."""

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper


def linear_agent(path, shape, seed=0, softmax=False, kind=TensorProto.FLOAT, games_inside=None, weights_file=None):
    """Planes of `shape` ("games" first), flattened, times a random matrix: logits, or probabilities. `games_inside`: it
    works with so many games only, whatever its input says; `weights_file`: the file that keeps the weights."""
    inputs = int(np.prod([size for size in shape[1:] if isinstance(size, int)]))
    weights = np.random.default_rng(seed).normal(0, 0.3, (inputs, 6)).astype(np.float32)
    nodes = [
        helper.make_node("Cast", ["planes"], ["numbers"], to=TensorProto.FLOAT),
        helper.make_node("Flatten", ["numbers"], ["flat"]),
        helper.make_node("MatMul", ["flat", "weights"], ["logits"]),
    ]
    if softmax:
        nodes.append(helper.make_node("Softmax", ["logits"], ["probabilities"]))
    output = helper.make_tensor_value_info("probabilities" if softmax else "logits", TensorProto.FLOAT, [shape[0], 6])
    constants = {}
    if games_inside is not None:
        flat = helper.make_node("Reshape", ["numbers", "flat_shape"], ["flat"])
        nodes[1], constants = flat, {"flat_shape": np.array([games_inside, inputs], np.int64)}
    _save(
        path, nodes, [helper.make_tensor_value_info("planes", kind, shape)], output, weights, weights_file, **constants
    )
    return weights


def linear_predictor(path, width, height, seed=0, games="games"):
    """The last joint action that it was shown decides, through a random matrix, about all three steps."""
    weights = np.random.default_rng(seed).normal(0, 1, (120, 18)).astype(np.float32)
    nodes = [
        helper.make_node("Flatten", ["actions"], ["flat"]),
        helper.make_node("MatMul", ["flat", "weights"], ["row"]),
        helper.make_node("Reshape", ["row", "shape"], ["logits"]),
        helper.make_node("ReduceSum", ["observations"], ["unused"]),
    ]
    inputs = [
        helper.make_tensor_value_info("observations", TensorProto.FLOAT, [games, 10, width, height, 26]),
        helper.make_tensor_value_info("actions", TensorProto.FLOAT, [games, 10, 12]),
    ]
    output = helper.make_tensor_value_info("logits", TensorProto.FLOAT, [games, 3, 6])
    _save(path, nodes, inputs, output, weights, None, shape=np.array([-1, 3, 6], np.int64))
    return weights


def _save(path, nodes, inputs, output, weights, weights_file, **constants):
    stored = [numpy_helper.from_array(array, name) for name, array in {"weights": weights, **constants}.items()]
    graph = helper.make_graph(nodes, "tiny", inputs, [output], stored)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    onnx.save(model, str(path), save_as_external_data=weights_file is not None, location=weights_file, size_threshold=0)
