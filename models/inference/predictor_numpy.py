"""Run the predictor's two forms timestep by timestep, for many games at once, with caches. Numpy and a few compiled
loops: for the few rows of a tick, torch's overhead would cost more than the network. `models.networks.predictor` has
the network; a test compares the results of the two.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.inference.attention import cached_attention, window_attention
from models.inference.convolutions_numpy import NumpyConvolutions
from models.inference.intentions_numpy import NumpyIntentions
from models.inference.layers_numpy import Floats, Linear, NamedWeights
from models.networks.checkpoint import Checkpoint, CheckpointError, load_checkpoint
from models.networks.columns import varying_columns
from models.networks.config import ROTARY_BASE, IntentionConfig, PredictorConfig, intention_config
from models.protocols import (
    HISTORY,
    INTENTION,
    INTENTIONS,
    STEPS,
    IntentionPredictor,
    Intentions,
    Observations,
    Predictions,
)
from overcooked.constants import ACTIONS
from overcooked.layout import Layout, parse_layout

_SLOTS_AT_ONCE = 64


class _Layer:
    def __init__(self, weights: NamedWeights, name: str) -> None:
        self._before_attention = weights.norm(f"{name}.before_attention")
        self._qkv, self._out = weights.linear(f"{name}.qkv"), weights.linear(f"{name}.out")
        self._before_feed_forward = weights.norm(f"{name}.before_feed_forward")
        self._fc1, self._fc2 = weights.linear(f"{name}.widen"), weights.linear(f"{name}.narrow")

    def qkv(self, x: Floats) -> Floats:
        return self._qkv(self._before_attention(x))

    def apply_residual(self, x: Floats, seen: Floats) -> Floats:
        """Add the attention's output, then the feed-forward part's, to the layer's input; all (rows, hidden)."""
        x = x + self._out(seen)
        wide = self._fc1(self._before_feed_forward(x))
        np.maximum(wide, 0, out=wide)
        x += self._fc2(wide)
        return x


class _Games:
    """What both forms share: the network around its layers, and arrays with one row per slot, which grow if a slot
    beyond the last is used."""

    def __init__(self, config: PredictorConfig, tensors: Mapping[str, NDArray[Any]], encoder: "_Encoder") -> None:
        weights = NamedWeights(tensors)
        self._encoder, self._heads, self._hidden = encoder, config.heads, config.hidden
        self.memory = config.memory
        state, token, action = (weights.linear(name) for name in ("state", "token", "action"))
        self._state = Linear(state.weight * encoder.scale[:, None], state.bias)
        self._token_of_state = token.weight[: config.state_width]
        # What each joint action adds to its token, (49, hidden), see `_joint_index`; -1 (none) is all zeros.
        hot = np.concatenate([np.zeros((1, ACTIONS), np.float32), np.eye(ACTIONS, dtype=np.float32)])
        joint = np.concatenate([hot.repeat(ACTIONS + 1, 0), np.tile(hot, (ACTIONS + 1, 1))], 1)
        self._token_of_action = action(joint) @ token.weight[config.state_width :] + token.bias
        self._layers = [_Layer(weights, f"layers.{k}") for k in range(config.layers)]
        self._norm = weights.norm("norm")
        self._first, self._second = weights.linear("decoder.0"), weights.linear("decoder.2")
        self._temperature = weights.array("temperature")[:, None]
        self._kept: list[NDArray[Any]] = []
        self._intentions: NumpyIntentions | None = None
        self._tokens: list[Floats] = []  # what each layer made of the newest timestep, if there is a decoder for it

    def begin(self, slots: NDArray[np.intp]) -> None:
        missing = int(slots.max(initial=-1)) + 1 - len(self._kept[0])
        if missing > 0:
            more = max(missing, _SLOTS_AT_ONCE, len(self._kept[0]) // 2)
            self._kept = [np.concatenate([kept, np.zeros((more, *kept.shape[1:]), kept.dtype)]) for kept in self._kept]
        self._kept[0][slots] = 0

    def add_intentions(self, decoder: NumpyIntentions) -> None:
        """Let `intentions` return what this decoder predicts from the tokens; `predict` stays as it is."""
        self._intentions = decoder

    def intentions(
        self,
        slots: NDArray[np.intp],
        observations: Observations,  # noqa: ARG002 - the tokens of the last `predict` are enough
        last_actions: NDArray[np.int8],  # noqa: ARG002
    ) -> Intentions:
        if self._intentions is None:
            return np.zeros((len(slots), INTENTIONS), INTENTION)
        return self._intentions(np.concatenate(self._tokens, -1))

    def _state_tokens(self, observations: Observations) -> Floats:
        """(games, hidden): what a state adds to its token."""
        state = self._state(self._encoder.encode(observations))
        np.maximum(state, 0, out=state)
        return state @ self._token_of_state

    def _probabilities(self, x: Floats) -> Predictions:
        inside = self._first(self._norm(x))
        np.maximum(inside, 0, out=inside)
        logits = self._second(inside).reshape(-1, STEPS, ACTIONS) / self._temperature
        logits -= logits.max(-1, keepdims=True)
        np.exp(logits, out=logits)
        return np.asarray(logits / logits.sum(-1, keepdims=True), np.float32)


def _joint_index(actions: NDArray[np.integer[Any]]) -> NDArray[np.intp]:
    """Joint actions (games, 2), -1 for none, to rows of `_token_of_action`."""
    return (actions[:, 0].astype(np.intp) + 1) * (ACTIONS + 1) + actions[:, 1] + 1


class StreamPredictor(_Games):
    """Run the stream form: a ring of keys and values for each layer and game, one token a timestep."""

    def __init__(self, config: PredictorConfig, tensors: Mapping[str, NDArray[Any]], encoder: "_Encoder") -> None:
        super().__init__(config, tensors, encoder)
        dim = config.hidden // config.heads
        self._speeds = np.exp(-np.log(ROTARY_BASE) * np.arange(dim // 2) / (dim // 2)).astype(np.float32)
        keys = np.zeros((0, config.heads, dim, config.look_back), np.float32)
        values = np.zeros((0, config.heads, config.look_back, dim), np.float32)
        self._kept = [np.zeros(0, np.int64), *(keys, values) * config.layers]  # timesteps, then two rings a layer

    def predict(
        self, slots: NDArray[np.intp], observations: Observations, last_actions: NDArray[np.int8]
    ) -> Predictions:
        self._tokens = []
        timesteps, *rings = self._kept
        now = timesteps[slots]
        timesteps[slots] += 1
        angles = now[:, None] * self._speeds
        cosine, sine = np.cos(angles, dtype=np.float32), np.sin(angles, dtype=np.float32)
        x = self._state_tokens(observations) + self._token_of_action[_joint_index(last_actions)]
        for layer, keys, values in zip(self._layers, rings[::2], rings[1::2], strict=True):
            qkv = layer.qkv(x).reshape(len(x), 3, self._heads, -1)
            x = layer.apply_residual(x, cached_attention(qkv, keys, values, slots, now, cosine, sine))
            self._tokens.append(x)
        return self._probabilities(x)


class WindowPredictor(_Games):
    """Run the window form: keep what each state adds to its token, and run the transformer over ten tokens again."""

    def __init__(self, config: PredictorConfig, tensors: Mapping[str, NDArray[Any]], encoder: "_Encoder") -> None:
        super().__init__(config, tensors, encoder)
        self._position = NamedWeights(tensors).array("position")
        states, actions = np.zeros((0, HISTORY, config.hidden), np.float32), np.zeros((0, HISTORY), np.intp)
        self._kept = [np.zeros(0, np.int64), states, actions]  # how many of the last states there are, these, actions

    def predict(
        self, slots: NDArray[np.intp], observations: Observations, last_actions: NDArray[np.int8]
    ) -> Predictions:
        self._tokens = []
        counts, states, actions = self._kept
        counts[slots] = np.minimum(counts[slots] + 1, HISTORY)
        states[slots] = np.concatenate([states[slots, 1:], self._state_tokens(observations)[:, None]], 1)
        joint = _joint_index(last_actions)[:, None]
        actions[slots] = np.concatenate([actions[slots, 1:-1], joint, np.zeros_like(joint)], 1)
        x = states[slots] + self._token_of_action[actions[slots]] + self._position
        *before, last = self._layers
        for layer in before:
            flat = x.reshape(-1, self._hidden)
            seen = self._attend(layer.qkv(flat), counts[slots], 0)
            x = layer.apply_residual(flat, seen.reshape(-1, self._hidden)).reshape(x.shape)
            self._tokens.append(x[:, -1])
        # Only the last token is read after this layer.
        seen = self._attend(last.qkv(x.reshape(-1, self._hidden)), counts[slots], HISTORY - 1)
        self._tokens.append(last.apply_residual(x[:, -1], seen[:, 0]))
        return self._probabilities(self._tokens[-1])

    def _attend(self, qkv: Floats, present: NDArray[np.int64], first_query: int) -> Floats:
        seen: Floats = window_attention(qkv.reshape(len(present), HISTORY, 3, self._heads, -1), present, first_query)
        return seen


@dataclass(frozen=True)
class _Encoder:
    """Observations (games, width, height, 26) to features (games, size), still to be multiplied by `scale`."""

    encode: Callable[[Observations], Floats]
    scale: Floats


def _encoder_of(config: PredictorConfig, tensors: Mapping[str, NDArray[Any]], layout: Layout) -> _Encoder:
    if config.eyes == "cnn":
        return _pretrained_encoder(tensors, layout)
    columns, largest = varying_columns(layout)
    return _Encoder(lambda seen: seen.reshape(len(seen), -1)[:, columns].astype(np.float32), np.float32(1) / largest)


def _pretrained_encoder(tensors: Mapping[str, NDArray[Any]], layout: Layout) -> _Encoder:
    prefix = "eyes.convolutions.convolutions."
    mine = {name.removeprefix(prefix): array for name, array in tensors.items() if name.startswith(prefix)}
    features = NumpyConvolutions(mine, layout.width, layout.height)
    return _Encoder(features, np.ones(features.size, np.float32))


def numpy_predictor(
    config: PredictorConfig,
    tensors: Mapping[str, NDArray[Any]],
    layout: Layout,
    intentions: IntentionConfig | None = None,
) -> IntentionPredictor:
    """Return a network, given by its weights, as a predictor; `intentions`: its decoder of intentions. Raises KeyError
    or ValueError if they do not fit together."""
    form = StreamPredictor if config.form == "stream" else WindowPredictor
    predictor = form(config, tensors, _encoder_of(config, tensors, layout))
    if intentions is not None:
        predictor.add_intentions(NumpyIntentions(NamedWeights(tensors), layout))
    return predictor


def load_trained_predictor(folder: Path, layout: Layout) -> tuple[IntentionPredictor, float]:
    """Return a predictor ready to watch games on `layout`, and its measured mean accuracy (0-1). Raises
    CheckpointError."""
    checkpoint = load_checkpoint(folder)
    config, trained_on = _described(checkpoint)
    if trained_on.text != layout.text:
        remedy = "Choose a predictor of this layout."
        raise CheckpointError(f"{folder}: was trained on another grid than {layout.name}. {remedy}")
    try:
        predictor = numpy_predictor(config, checkpoint.tensors, layout, intention_config(checkpoint.config))
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise CheckpointError(f"{folder}: not a readable predictor ({error}). Fetch it again.") from error
    return predictor, float(checkpoint.config.get("accuracy", {}).get("mean", 1.0))


def _described(checkpoint: Checkpoint) -> tuple[PredictorConfig, Layout]:
    """Return what the checkpoint says it is, and the layout that it was trained on."""
    config = checkpoint.config
    try:
        return PredictorConfig(**config["network"]), parse_layout(config["grid"], config["layout"])
    except (KeyError, TypeError, ValueError) as error:
        raise CheckpointError(f"{checkpoint.folder}: not a readable predictor ({error}). Fetch it again.") from error
