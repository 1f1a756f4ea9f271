"""The shapes of our networks, frozen with their weights. Only numbers: no torch."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from models.protocols import HISTORY

LEAK = 0.01  # of the agents' leaky ReLU below zero
ROTARY_BASE = 100.0  # of the predictors' rotary positions


@dataclass(frozen=True)
class NetworkConfig:
    """The shape of an agent's network; frozen with the weights."""

    kind: str = "mlp"  # "cnn" (the paper's) or "mlp"
    filters: int = 25  # of each convolution (cnn)
    hidden: tuple[int, ...] = (128, 64, 64)  # widths of the fully connected layers; the paper's CNN has (64, 64, 64)


@dataclass(frozen=True)
class IntentionConfig:
    """The shape of a predictor's decoder of intentions; frozen with the weights."""

    hidden: int = 256  # between the tokens of all layers and the classes
    when_hidden: int = 64  # between that and the timesteps


@dataclass(frozen=True)
class PredictorConfig:
    """The shape of a predictor's transformer; frozen with the weights. Numbers without a comment are the paper's."""

    form: str = "stream"  # or "window"
    # The encoder: the entries of the encoding that can change; or "cnn", pretrained convolutions, frozen.
    eyes: str = "columns"
    filters: int = 25  # of each pretrained convolution
    hidden: int = 128
    layers: int = 4
    heads: int = 8
    feed_forward: int = 512  # the paper is silent
    state_width: int = 256  # between the encoder and the tokens; the paper is silent
    action_width: int = 32  # of a joint action's embedding; the paper is silent
    look_back: int = 16  # stream, the attention window: timesteps that a layer sees, the current one included
    dropout: float = 0.1  # while training

    @property
    def memory(self) -> int:
        """How many past timesteps can influence a prediction."""
        return HISTORY if self.form == "window" else self.layers * (self.look_back - 1) + 1


def intention_config(config: Mapping[str, Any]) -> IntentionConfig | None:
    """Return the decoder of intentions that a checkpoint's config names; None for a predictor without one."""
    return IntentionConfig(**config["intentions"]) if "intentions" in config else None
