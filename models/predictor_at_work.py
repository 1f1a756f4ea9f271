"""The predictor's two forms at work: timestep by timestep, many games at once, everything that can be kept is kept.

`models.predictor` has the network; a test holds the two to the same answers. It must not know who asks.
"""

from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from models.checkpoint import CheckpointError, load_checkpoint
from models.predictor import PredictorNetwork, one_hot, predictor_network, rotated, rotations
from models.protocols import HISTORY, Observations, Predictions, Predictor
from overcooked.constants import ACTIONS
from overcooked.layout import Layout

_SLOTS_AT_ONCE = 64
_ROWS_THAT_PAY = 16  # from so many rows on a product in 16 bits is faster


class _Games:
    """What both forms keep: tensors with a row a slot, which grow when a slot beyond the last is begun."""

    def __init__(self, network: PredictorNetwork) -> None:
        self.network = network.eval().requires_grad_(False)
        self.memory = network.config.memory
        width = network.config.state_width
        of_state, of_action = network.token.weight[:, :width], network.token.weight[:, width:]
        self._token_of_state = of_state.contiguous()
        # What each joint action adds to its token: (49, hidden).
        embedded = network.action(torch.from_numpy(one_hot(_ALL_JOINT)))
        self._token_of_action = functional.linear(embedded, of_action, network.token.bias)

    def _state_tokens(self, observations: Observations) -> Tensor:
        """(B, hidden): what a state adds to its token."""
        features = self.network.eyes(torch.from_numpy(np.ascontiguousarray(observations)))
        return functional.linear(functional.relu(self.network.state(features)), self._token_of_state)

    def _probabilities(self, x: Tensor) -> Predictions:
        return self.network.decode(x).softmax(-1).numpy()


_ALL_JOINT = np.stack(np.meshgrid(np.arange(-1, ACTIONS), np.arange(-1, ACTIONS), indexing="ij"), -1).reshape(-1, 2)


def _joint_index(actions: NDArray[np.integer[Any]]) -> Tensor:
    """Joint actions (B, 2) to rows of `_ALL_JOINT`."""
    return torch.from_numpy((actions[:, 0].astype(np.int64) + 1) * (ACTIONS + 1) + actions[:, 1] + 1)


class StreamPredictor(_Games):
    """The stream form at work: a ring of keys and values a layer and game, one token a timestep."""

    def __init__(self, network: PredictorNetwork) -> None:
        super().__init__(network)
        config = network.config
        self._look_back, self._dim = config.look_back, config.hidden // config.heads
        self._rings = [torch.zeros(0, config.look_back, 2, config.heads, self._dim) for _ in network.layers]
        self._timesteps = torch.zeros(0, dtype=torch.long)

    def begin(self, slots: NDArray[np.intp]) -> None:
        missing = int(slots.max(initial=-1)) + 1 - len(self._timesteps)
        if missing > 0:
            missing = max(missing, _SLOTS_AT_ONCE)
            self._rings = [torch.cat([ring, torch.zeros(missing, *ring.shape[1:])]) for ring in self._rings]
            self._timesteps = torch.cat([self._timesteps, torch.zeros(missing, dtype=torch.long)])
        self._timesteps[torch.from_numpy(slots)] = 0

    @torch.inference_mode()
    def predict(
        self, slots: NDArray[np.intp], observations: Observations, last_actions: NDArray[np.int8]
    ) -> Predictions:
        chosen = torch.from_numpy(slots)
        now = self._timesteps[chosen]
        self._timesteps[chosen] = now + 1
        place = now % self._look_back
        rotation = rotations(now, self._dim)[:, None]  # (B, 1, dim / 2, 2)
        empty = torch.arange(self._look_back) > now[:, None]  # (B, look_back)
        hidden_places = empty[..., None] if bool(empty.any()) else None
        x = self._state_tokens(observations) + self._token_of_action[_joint_index(last_actions)]
        for layer, ring in zip(self.network.layers, self._rings, strict=True):
            x = x + self._attention(layer, ring, x, chosen, place, rotation, hidden_places)
            x = x + layer.feed_forward(x)  # type: ignore[operator]
        return self._probabilities(x)

    def _attention(
        self,
        layer: Any,
        ring: Tensor,
        x: Tensor,
        chosen: Tensor,
        place: Tensor,
        rotation: Tensor,
        hidden_places: Tensor | None,
    ) -> Tensor:
        """The new token (B, hidden) looks at itself and what the ring keeps; its key and value join the ring."""
        q, k, v = layer.qkv(layer.before_attention(x)).unflatten(-1, (3, layer.heads, self._dim)).unbind(1)
        ring[chosen, place] = torch.stack([rotated(k, rotation), v], 1)
        keys, values = ring[chosen].unbind(2)  # (B, look_back, heads, dim)
        scores = (rotated(q, rotation)[:, None] * keys).sum(-1) * self._dim**-0.5  # (B, look_back, heads)
        if hidden_places is not None:
            scores = scores.masked_fill(hidden_places, -torch.inf)
        seen = (scores.softmax(1)[..., None] * values).sum(1)  # (B, heads, dim)
        return layer.out(seen.flatten(1))  # type: ignore[no-any-return]


class WindowPredictor(_Games):
    """The window form at work: what each state adds to its token is kept, the transformer runs over ten tokens anew."""

    def __init__(self, network: PredictorNetwork) -> None:
        super().__init__(network)
        self._states = torch.zeros(0, HISTORY, network.config.hidden)
        self._actions = torch.zeros(0, HISTORY, dtype=torch.long)  # rows of `_ALL_JOINT`; 0: none
        self._seen = torch.zeros(0, dtype=torch.long)

    def begin(self, slots: NDArray[np.intp]) -> None:
        missing = int(slots.max(initial=-1)) + 1 - len(self._seen)
        if missing > 0:
            missing = max(missing, _SLOTS_AT_ONCE)
            self._states = torch.cat([self._states, torch.zeros(missing, *self._states.shape[1:])])
            self._actions = torch.cat([self._actions, torch.zeros(missing, HISTORY, dtype=torch.long)])
            self._seen = torch.cat([self._seen, torch.zeros(missing, dtype=torch.long)])
        chosen = torch.from_numpy(slots)
        self._states[chosen] = 0
        self._actions[chosen] = 0
        self._seen[chosen] = 0

    @torch.inference_mode()
    def predict(
        self, slots: NDArray[np.intp], observations: Observations, last_actions: NDArray[np.int8]
    ) -> Predictions:
        chosen = torch.from_numpy(slots)
        states = torch.cat([self._states[chosen, 1:], self._state_tokens(observations)[:, None]], 1)
        joint = _joint_index(last_actions)[:, None]
        actions = torch.cat([self._actions[chosen, 1:-1], joint, torch.zeros_like(joint)], 1)
        seen = (self._seen[chosen] + 1).clamp(max=HISTORY)
        self._states[chosen], self._actions[chosen], self._seen[chosen] = states, actions, seen
        assert self.network.position is not None  # noqa: S101 the window form has positions
        x = states + self._token_of_action[actions] + self.network.position
        present = torch.arange(HISTORY) >= HISTORY - seen[:, None]
        mask = None if bool(present.all()) else present[:, None, None, :]
        *before, last = self.network.layers
        for layer in before:
            x = layer(x, mask, None)
        return self._probabilities(self._last_token(last, x, mask))

    def _last_token(self, layer: Any, x: Tensor, mask: Tensor | None) -> Tensor:
        """The last layer for the last token alone, (B, hidden): nobody reads the others."""
        q, k, v = layer.split(layer.qkv(layer.before_attention(x)))
        seen = functional.scaled_dot_product_attention(q[:, :, -1:], k, v, attn_mask=mask)
        x = x[:, -1] + layer.out(seen.flatten(1))
        return x + layer.feed_forward(x)  # type: ignore[no-any-return]


class HalfLinear(nn.Module):
    """A linear layer at work that multiplies in 16 bits where many rows come at once; what is added up stays in 32."""

    def __init__(self, layer: nn.Linear) -> None:
        super().__init__()
        self.full = layer
        self.weight, self.bias = layer.weight.detach().bfloat16(), layer.bias.detach().bfloat16()

    def forward(self, x: Tensor) -> Tensor:
        if x.numel() < _ROWS_THAT_PAY * x.shape[-1]:
            return self.full(x)  # type: ignore[no-any-return]
        return functional.linear(x.bfloat16(), self.weight, self.bias).float()


def at_work(network: PredictorNetwork, half: bool = False) -> Predictor:
    """A network as a `Predictor`. `half`: large products in 16 bits, about twice as fast where the processor can; the
    network is changed by it."""
    if half:
        for layer in network.layers:
            for name in ("qkv", "out", "widen", "narrow"):
                setattr(layer, name, HalfLinear(getattr(layer, name)))
    return StreamPredictor(network) if network.config.form == "stream" else WindowPredictor(network)


def multiplies_in_half() -> bool:
    """Whether this processor has instructions for 16-bit products (AVX-512 BF16, AMX); without, they are slower."""
    return bool(torch.ops.mkldnn._is_mkldnn_bf16_supported()) and "avx512_bf16" in _processor_flags()


def _processor_flags() -> str:
    try:
        return Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return ""


def load_trained_predictor(folder: Path, layout: Layout) -> tuple[Predictor, float]:
    """A predictor ready to watch games on `layout`, and its measured mean accuracy (0-1). Raises CheckpointError."""
    checkpoint = load_checkpoint(folder)
    network, trained_on = predictor_network(checkpoint)
    if trained_on.text != layout.text:
        remedy = "Choose a predictor of this layout."
        raise CheckpointError(f"{folder}: was trained on another grid than {layout.name}. {remedy}")
    return at_work(network, multiplies_in_half()), float(checkpoint.config.get("accuracy", {}).get("mean", 1.0))
