"""The Theory-of-Mind predictor: the paper's transformer, in two forms behind one interface. `window`, the paper's: the
last 10 states through the encoder and 10 joint actions (the current one zero), encoder only; the prediction is decoded
from the last token. `stream`: causal, each layer attends to a fixed number of past timesteps, so that with cached keys
and values a timestep costs one token (models.inference.predictor_numpy).
"""

import math
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from models.networks.checkpoint import Checkpoint, CheckpointError, save_checkpoint
from models.networks.columns import varying_columns
from models.networks.config import ROTARY_BASE, IntentionConfig, PredictorConfig, intention_config
from models.networks.intentions import IntentionDecoder
from models.networks.policy import ConvolutionalFeatures
from models.protocols import HISTORY, STEPS
from overcooked.constants import ACTIONS, PLAYERS
from overcooked.interactions import possible_interactions
from overcooked.layout import Layout, parse_layout
from overcooked.planes import PLANES

JOINT = PLAYERS * ACTIONS  # a joint action, one-hot


class Encoder(nn.Module):
    """Observations (N, width, height, 26) to features (N, `size`); never trained here, so that features can be
    cached."""

    columns: Tensor
    scale: Tensor

    def __init__(self, layout: Layout, config: PredictorConfig) -> None:
        super().__init__()
        self.convolutions: ConvolutionalFeatures | None = None
        if config.eyes == "cnn":
            self.convolutions = ConvolutionalFeatures(layout.width, layout.height, config.filters)
            self.size = self.convolutions.size
        elif config.eyes == "columns":
            columns, largest = varying_columns(layout)
            self.register_buffer("columns", torch.from_numpy(columns), persistent=False)
            self.register_buffer("scale", torch.from_numpy(1 / largest), persistent=False)
            self.size = len(columns)
        else:
            raise ValueError(f"encoder {config.eyes!r} is unknown. Known: columns, cnn.")
        self.requires_grad_(False)

    def forward(self, observations: Tensor) -> Tensor:
        if self.convolutions is not None:
            return self.convolutions(observations)  # type: ignore[no-any-return]
        return observations.flatten(1)[:, self.columns].float() * self.scale


class Layer(nn.Module):
    """One transformer layer: attention, then a feed-forward part, each after a norm and added to what came in."""

    def __init__(self, config: PredictorConfig) -> None:
        super().__init__()
        self.heads, self.dropout, self.look_back = config.heads, config.dropout, config.look_back
        self.before_attention = nn.LayerNorm(config.hidden)
        self.qkv = nn.Linear(config.hidden, 3 * config.hidden)
        self.out = nn.Linear(config.hidden, config.hidden)
        self.before_feed_forward = nn.LayerNorm(config.hidden)
        # These two names and `eyes` below are stored with the weights and cannot change.
        self.widen = nn.Linear(config.hidden, config.feed_forward)
        self.narrow = nn.Linear(config.feed_forward, config.hidden)

    def forward(self, x: Tensor, mask: Tensor | None, rotation: Tensor | None) -> Tensor:
        """`x` (B, T, hidden). Stream: `rotation` (T, dim / 2, 2). Window: `mask` (B, 1, 1, T), True where to look."""
        q, k, v = self.split(self.qkv(self.before_attention(x)))  # (B, heads, T, dim)
        if rotation is None:
            return self.changed(x, full_attention(q, k, v, mask))
        return self.changed(x, banded_attention(rotated(q, rotation), rotated(k, rotation), v, self.look_back))

    def last(self, x: Tensor, mask: Tensor | None) -> Tensor:
        """Window: return the last token after this layer only, (B, 1, hidden); all that the last layer is asked for."""
        q, k, v = self.split(self.qkv(self.before_attention(x)))
        return self.changed(x[:, -1:], full_attention(q[:, :, -1:], k, v, mask))

    def changed(self, x: Tensor, seen: Tensor) -> Tensor:
        """Add to tokens what they attended to (B, heads, T, dim), and the feed-forward part."""
        x = x + self._dropped(self.out(seen.transpose(1, 2).flatten(2)))
        return x + self._dropped(self.feed_forward(x))

    def split(self, qkv: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """(B, T, 3 * hidden) to three of (B, heads, T, dim)."""
        q, k, v = qkv.view(*qkv.shape[:2], 3, self.heads, -1).permute(2, 0, 3, 1, 4).unbind(0)
        return q, k, v

    def feed_forward(self, x: Tensor) -> Tensor:
        return self.narrow(functional.relu(self.widen(self.before_feed_forward(x))))  # type: ignore[no-any-return]

    def _dropped(self, x: Tensor) -> Tensor:
        return functional.dropout(x, self.dropout, self.training)


class PredictorNetwork(nn.Module):
    """Features (B, T, size) and joint actions (B, T, 12) to logits of the next actions: (B, T, 3, 6) in the stream
    form, (B, 3, 6) in the window form, whose T is 10."""

    temperature: Tensor  # (STEPS,): logits are divided by it, so that probabilities are calibrated

    def __init__(self, layout: Layout, config: PredictorConfig, intentions: IntentionConfig | None = None) -> None:
        super().__init__()
        if config.form not in ("window", "stream"):
            raise ValueError(f"form {config.form!r} is unknown. Known: window, stream.")
        self.config = config
        self.eyes = Encoder(layout, config)
        self.state = nn.Linear(self.encoder.size, config.state_width)
        self.action = nn.Linear(JOINT, config.action_width)
        self.token = nn.Linear(config.state_width + config.action_width, config.hidden)
        self.position = nn.Parameter(torch.zeros(HISTORY, config.hidden)) if config.form == "window" else None
        self.layers = nn.ModuleList(Layer(config) for _ in range(config.layers))
        self.norm = nn.LayerNorm(config.hidden)
        self.decoder = nn.Sequential(
            nn.Linear(config.hidden, config.hidden), nn.ReLU(), nn.Linear(config.hidden, STEPS * ACTIONS)
        )
        self.register_buffer("temperature", torch.ones(STEPS))
        self.intentions: IntentionDecoder | None = None
        if intentions is not None:
            self.intentions = intention_decoder(layout, config, intentions)

    @property
    def encoder(self) -> Encoder:
        """Return the network that makes features of observations; its name `eyes` is stored with the weights."""
        return self.eyes

    def forward(self, features: Tensor, actions: Tensor, present: Tensor | None = None) -> Tensor:
        """`present` (B, T), window form: False for steps before the start of the game."""
        return self.decode(self.tokens(features, actions, present))

    def tokens(self, features: Tensor, actions: Tensor, present: Tensor | None = None) -> Tensor:
        """Return the last layer's output for a game, to be decoded: (B, T, hidden), in the window form (B, hidden)."""
        *_, last = self._after_layers(features, actions, present)
        return last

    def tokens_of_all_layers(self, features: Tensor, actions: Tensor, present: Tensor | None = None) -> Tensor:
        """Return each layer's output for a game, concatenated: (B, T, layers * hidden), in the window form (B, ...).

        The last `hidden` entries are `tokens`."""
        return torch.cat(list(self._after_layers(features, actions, present)), -1)

    def _after_layers(self, features: Tensor, actions: Tensor, present: Tensor | None) -> Iterator[Tensor]:
        x: Tensor = self.token(torch.cat([functional.relu(self.state(features)), self.action(actions)], -1))
        if self.position is not None:
            mask = None if present is None else present[:, None, None, :]
            x, rotation = x + self.position, None
        else:
            mask = None
            rotation = rotations(torch.arange(x.shape[1], device=x.device), self.config.hidden // self.config.heads)
        if self.position is None:
            for layer in self.layers:
                x = layer(x, mask, rotation)
                yield x
            return
        for layer in self.layers[:-1]:
            x = layer(x, mask, rotation)
            yield x[:, -1]
        last: Tensor = self.layers[-1].last(x, mask)  # type: ignore[operator]
        yield last[:, 0]

    def decode(self, x: Tensor) -> Tensor:
        """Map tokens (..., hidden) to logits (..., 3, 6)."""
        logits: Tensor = self.decoder(self.norm(x))
        return logits.view(*x.shape[:-1], STEPS, ACTIONS) / self.temperature[:, None]


def intention_decoder(layout: Layout, config: PredictorConfig, intentions: IntentionConfig) -> IntentionDecoder:
    """Return an untrained decoder of intentions for a predictor of this shape."""
    return IntentionDecoder(config.layers * config.hidden, len(possible_interactions(layout)), intentions)


def full_attention(q: Tensor, k: Tensor, v: Tensor, mask: Tensor | None) -> Tensor:
    """Return the attention of queries (B, heads, Q, dim) to all of (B, heads, T, dim); `mask` (B, 1, 1, T) is True
    where a query may look."""
    if q.dtype == torch.float32 or q.device.type != "cpu":
        return functional.scaled_dot_product_attention(q, k, v, attn_mask=mask)
    # On a CPU, for windows of ten tokens, the fused attention takes 1.7 times as long, in 16 bits and in 32.
    scores = (q @ k.transpose(-1, -2)).float() * q.shape[-1] ** -0.5
    if mask is not None:
        scores = scores.masked_fill(~mask, -torch.inf)
    seen: Tensor = scores.softmax(-1).to(v.dtype) @ v
    return seen


def banded_attention(q: Tensor, k: Tensor, v: Tensor, window: int) -> Tensor:
    """Attention of (B, heads, T, dim) in which a token attends to itself and the `window` - 1 before it. In blocks of
    `window`: each attends to its own block and the one before, which costs T * window instead of T * T.
    """
    timesteps = q.shape[2]
    blocks = -(-timesteps // window)
    spare = blocks * window - timesteps
    q, k, v = (functional.pad(x, (0, 0, 0, spare)).reshape(*x.shape[:2], blocks, window, -1) for x in (q, k, v))
    k, v = (torch.cat([functional.pad(x[:, :, :-1], (0, 0, 0, 0, 1, 0)), x], 3) for x in (k, v))
    place = torch.arange(2 * window, device=q.device)
    ages = place[:window, None] + window - place
    may = ((ages >= 0) & (ages < window)).repeat(blocks, 1, 1)  # (blocks, window, 2 * window)
    may[0, :, :window] = False  # before the beginning
    scores = (q @ k.transpose(-1, -2)).float() * q.shape[-1] ** -0.5
    weights = scores.masked_fill(~may, -torch.inf).softmax(-1).to(v.dtype)
    seen: Tensor = (weights @ v).flatten(2, 3)[:, :, :timesteps]
    return seen


def rotations(timesteps: Tensor, dim: int) -> Tensor:
    """Return the cosine and sine by which a query or key of each timestep is rotated: (T, dim / 2, 2). [rotary
    positions]"""
    speeds = torch.exp(-math.log(ROTARY_BASE) * torch.arange(dim // 2, device=timesteps.device) / (dim // 2))
    angles = timesteps[:, None] * speeds
    return torch.stack([angles.cos(), angles.sin()], -1)


def rotated(x: Tensor, rotation: Tensor) -> Tensor:
    """Rotate `x` (..., dim), whose two halves are the two axes of the rotation."""
    cosine, sine = rotation[..., 0], rotation[..., 1]
    first, second = x.chunk(2, -1)
    return torch.cat([first * cosine - second * sine, first * sine + second * cosine], -1).to(x.dtype)


def one_hot(actions: NDArray[np.integer[Any]]) -> NDArray[np.float32]:
    """Encode joint actions (..., 2), -1 for none, as (..., 12)."""
    table = np.concatenate([np.eye(ACTIONS, dtype=np.float32), np.zeros((1, ACTIONS), np.float32)])
    hot: NDArray[np.float32] = table[actions].reshape(*actions.shape[:-1], JOINT)
    return hot


def save_predictor(folder: Path, network: PredictorNetwork, layout: Layout, agent: str, card: str, **facts: Any) -> str:
    """Write a predictor's checkpoint folder (weights as 16 bits); `facts` join its config. Returns its sha256."""
    settings = {
        "format": "kitchenmind predictor 1",
        "layout": layout.name,
        "grid": layout.text,
        "planes": PLANES,
        "agent": agent,
        "network": asdict(network.config),
        **({} if network.intentions is None else {"intentions": asdict(network.intentions.config)}),
        **facts,
    }
    return save_checkpoint(folder, settings, dict(network.state_dict()), card, bits=16)


def predictor_network(checkpoint: Checkpoint) -> tuple[PredictorNetwork, Layout]:
    """Return the network of a predictor's checkpoint and its layout. Raises CheckpointError if it is not one."""
    config = checkpoint.config
    try:
        layout = parse_layout(config["grid"], config["layout"])
        network = PredictorNetwork(layout, PredictorConfig(**config["network"]), intention_config(config))
        network.load_state_dict({name: torch.from_numpy(array) for name, array in checkpoint.tensors.items()})
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise CheckpointError(f"{checkpoint.folder}: not a readable predictor ({error}). Fetch it again.") from error
    return network.eval(), layout
