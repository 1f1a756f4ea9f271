"""Run the networks of `models.networks.policy` in numpy: fast for the few rows of a timestep, without torch."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.inference.convolutions_numpy import Floats, NumpyConvolutions
from models.networks.checkpoint import Checkpoint, CheckpointError
from models.networks.columns import varying_columns
from models.networks.config import LEAK, NetworkConfig
from models.protocols import Observations, Policy, Probabilities
from overcooked.layout import Layout, parse_layout

_CONVOLUTIONS = "features.convolutions."


class NumpyPolicy:
    """A `Policy`: `features` (rows, size) of the observations, then fully connected layers."""

    def __init__(self, features: Callable[[Observations], Floats], layers: list[tuple[Floats, Floats]]) -> None:
        self._features, self._layers = features, layers

    def probabilities(self, observations: Observations) -> Probabilities:
        x = self._features(observations)
        *hidden, (last, last_bias) = self._layers
        for weight, bias in hidden:
            x = x @ weight
            x += bias
            np.maximum(x, LEAK * x, out=x)
        logits = x @ last + last_bias
        logits -= logits.max(1, keepdims=True)
        exponentials = np.exp(logits)
        return np.asarray(exponentials / exponentials.sum(1, keepdims=True), np.float32)


def numpy_policy(checkpoint: Checkpoint) -> tuple[Policy, Layout]:
    """Load the agent of a checkpoint, ready to be used, and the layout that it was trained on. Raises
    CheckpointError."""
    config = checkpoint.config
    try:
        layout = parse_layout(config["grid"], config["layout"])
        settings = NetworkConfig(**{**config["network"], "hidden": tuple(config["network"]["hidden"])})
        kind = {"mlp": _mlp, "cnn": _cnn}[settings.kind]
        return kind(settings, checkpoint.tensors, layout), layout
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise CheckpointError(f"{checkpoint.folder}: not a readable agent ({error}). Fetch it again.") from error


def _mlp(config: NetworkConfig, tensors: Mapping[str, NDArray[Any]], layout: Layout) -> NumpyPolicy:
    """Read the entries that can change, each divided by its largest value."""
    columns, largest = varying_columns(layout)
    layers = _layers(config, tensors)
    first, bias = layers[0]
    layers[0] = (first / largest[:, None], bias)
    return NumpyPolicy(lambda seen: seen.reshape(len(seen), -1)[:, columns].astype(np.float32), layers)


def _cnn(config: NetworkConfig, tensors: Mapping[str, NDArray[Any]], layout: Layout) -> NumpyPolicy:
    of_features = [name for name in tensors if name.startswith(_CONVOLUTIONS)]
    mine = {name.removeprefix(_CONVOLUTIONS): tensors[name] for name in of_features}
    features, layers = NumpyConvolutions(mine, layout.width, layout.height), _layers(config, tensors)
    if features.size != len(layers[0][0]):
        raise ValueError(f"the convolutions give {features.size} features, the next layer takes {len(layers[0][0])}")
    return NumpyPolicy(features, layers)


def _layers(config: NetworkConfig, tensors: Mapping[str, NDArray[Any]]) -> list[tuple[Floats, Floats]]:
    names = [*(f"head.layers.{k}" for k in range(len(config.hidden))), "head.policy"]
    return [
        (np.ascontiguousarray(tensors[f"{name}.weight"].T, np.float32), np.asarray(tensors[f"{name}.bias"], np.float32))
        for name in names
    ]
