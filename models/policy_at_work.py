"""A small agent at work: the `mlp` network in numpy, quick for the few rows of a tick. No torch; knows no training."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.checkpoint import Checkpoint, CheckpointError
from models.columns import varying_columns
from models.network_config import LEAK, NetworkConfig
from models.protocols import Observations, Policy, Probabilities
from overcooked.layout import Layout, parse_layout


class MlpAtWork:
    """`models.policy.MlpPolicy` without its value: a `Policy`. Raises KeyError for weights that are missing."""

    def __init__(self, config: NetworkConfig, tensors: Mapping[str, NDArray[Any]], layout: Layout) -> None:
        self._columns, largest = varying_columns(layout)
        names = [*(f"head.layers.{k}" for k in range(len(config.hidden))), "head.policy"]
        self._layers = [
            (np.ascontiguousarray(tensors[f"{name}.weight"].T, np.float32), tensors[f"{name}.bias"]) for name in names
        ]
        first, bias = self._layers[0]
        self._layers[0] = (first / largest[:, None], bias)

    def probabilities(self, observations: Observations) -> Probabilities:
        x = observations.reshape(len(observations), -1)[:, self._columns].astype(np.float32)
        *hidden, (last, last_bias) = self._layers
        for weight, bias in hidden:
            x = x @ weight
            x += bias
            np.maximum(x, LEAK * x, out=x)
        logits = x @ last + last_bias
        logits -= logits.max(1, keepdims=True)
        law = np.exp(logits)
        return np.asarray(law / law.sum(1, keepdims=True), np.float32)


def policy_at_work(checkpoint: Checkpoint) -> tuple[Policy, Layout]:
    """The agent in a checkpoint, ready to be asked, and the layout it was trained on. Raises CheckpointError."""
    config = checkpoint.config
    try:
        if config["network"]["kind"] == "mlp":
            layout = parse_layout(config["grid"], config["layout"])
            settings = NetworkConfig(**{**config["network"], "hidden": tuple(config["network"]["hidden"])})
            return MlpAtWork(settings, checkpoint.tensors, layout), layout
    except (KeyError, TypeError, ValueError) as error:
        raise CheckpointError(f"{checkpoint.folder}: this is no agent that I understand ({error}).") from error
    from models.policy import NetworkPolicy, network_of  # convolutions are torch's

    network, layout, _ = network_of(checkpoint)
    return NetworkPolicy(network), layout
