"""The actor-critic networks of our agents, and an agent that is such a network.

`cnn` is the paper's: convolutions 5x5, 3x3 (same size) and 3x3 (valid) of 25 filters, then a 3-layer MLP of 64.
`mlp` reads the flat encoding, but only the entries that can change in its layout: small, quick, bound to that layout.
"""

from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

import torch
from torch import Tensor, nn

from models.networks.checkpoint import Checkpoint, CheckpointError, load_checkpoint, save_checkpoint
from models.networks.columns import varying_columns
from models.networks.config import LEAK, NetworkConfig
from models.protocols import Mode, Observations, Probabilities
from overcooked.constants import ACTIONS
from overcooked.layout import Layout, parse_layout
from overcooked.planes import PLANES


class Head(nn.Module):
    """Fully connected layers, then the logits of the six actions and the value of the state."""

    def __init__(self, inputs: int, hidden: tuple[int, ...]) -> None:
        super().__init__()
        widths = (inputs, *hidden)
        self.layers = nn.ModuleList(nn.Linear(a, b) for a, b in pairwise(widths))
        self.policy = nn.Linear(widths[-1], ACTIONS)
        self.value = nn.Linear(widths[-1], 1)
        for layer in self.layers:
            nn.init.orthogonal_(layer.weight, 2**0.5)  # type: ignore[arg-type]
            nn.init.zeros_(layer.bias)  # type: ignore[arg-type]
        nn.init.orthogonal_(self.policy.weight, 0.01)  # a nearly uniform first policy explores
        nn.init.orthogonal_(self.value.weight, 1.0)
        nn.init.zeros_(self.policy.bias)
        nn.init.zeros_(self.value.bias)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        return self.after_first(self.layers[0](x))

    def after_first(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Apply all layers after the first."""
        for layer in self.layers[1:]:
            x = layer(nn.functional.leaky_relu(x, LEAK))
        x = nn.functional.leaky_relu(x, LEAK)
        return self.policy(x), self.value(x).squeeze(-1)


class ConvolutionalFeatures(nn.Module):
    """Observations (B, width, height, 26) to features (B, `size`); also the predictors' pretrained encoder."""

    def __init__(self, width: int, height: int, filters: int = 25) -> None:
        super().__init__()
        self.size = filters * (width - 2) * (height - 2)
        self.convolutions = nn.ModuleList(
            [
                nn.Conv2d(PLANES, filters, 5, padding="same"),
                nn.Conv2d(filters, filters, 3, padding="same"),
                nn.Conv2d(filters, filters, 3, padding="valid"),
            ]
        )
        for layer in self.convolutions:
            nn.init.orthogonal_(layer.weight, 2**0.5)  # type: ignore[arg-type]
            nn.init.zeros_(layer.bias)  # type: ignore[arg-type]

    def forward(self, observations: Tensor) -> Tensor:
        x = observations.float().permute(0, 3, 1, 2)  # (B, 26, W, H), channels_last in memory
        for layer in self.convolutions:
            x = nn.functional.leaky_relu(layer(x), LEAK)
        return x.flatten(1)


class CnnPolicy(nn.Module):
    """The paper's network: (B, width, height, 26) int8 to logits (B, 6) and values (B,)."""

    def __init__(self, layout: Layout, config: NetworkConfig) -> None:
        super().__init__()
        self.features = ConvolutionalFeatures(layout.width, layout.height, config.filters)
        self.head = Head(self.features.size, config.hidden)

    def forward(self, observations: Tensor) -> tuple[Tensor, Tensor]:
        logits, values = self.head(self.features(observations))
        return logits, values


class MlpPolicy(nn.Module):
    """Fully connected layers on the entries that can change. Its inputs and outputs are those of the CNN."""

    columns: Tensor  # (inputs,) places in the flat encoding
    scale: Tensor  # (inputs,) brings each entry to 0..1

    def __init__(self, layout: Layout, config: NetworkConfig) -> None:
        super().__init__()
        columns, largest = varying_columns(layout)
        self.register_buffer("columns", torch.from_numpy(columns), persistent=False)
        self.register_buffer("scale", torch.from_numpy(1 / largest), persistent=False)
        self.head = Head(len(columns), config.hidden)

    def forward(self, observations: Tensor) -> tuple[Tensor, Tensor]:
        logits, values = self.from_columns(observations.flatten(1)[:, self.columns].float())
        return logits, values

    def from_columns(self, entries: Tensor) -> tuple[Tensor, Tensor]:
        """Return the same from the chosen entries alone, (B, inputs): what training stores. bfloat16 entries are
        multiplied in bfloat16 (the entries are small integers, exact there)."""
        weight, bias = self.scaled_first()
        x = nn.functional.linear(entries, weight.to(entries.dtype)).float() + bias
        logits, values = self.head.after_first(x)
        return logits, values

    def scaled_first(self) -> tuple[Tensor, Tensor]:
        """Return the weight and bias of the first layer for entries as they are in the encoding."""
        first = cast(nn.Linear, self.head.layers[0])
        return first.weight * self.scale, first.bias


Network = CnnPolicy | MlpPolicy


def build_network(config: NetworkConfig, layout: Layout) -> Network:
    """Return an untrained network for a layout. Raises ValueError for an unknown kind."""
    kinds: dict[str, type[Network]] = {"cnn": CnnPolicy, "mlp": MlpPolicy}
    if config.kind not in kinds:
        raise ValueError(f"network kind {config.kind!r} is unknown. Known: {', '.join(kinds)}.")
    return kinds[config.kind](layout, config)


class NetworkPolicy:
    """A network as a `Policy`: numpy in, numpy out, computed on `device`."""

    def __init__(self, network: Network, device: str = "cpu") -> None:
        self.network, self.device = network.eval().requires_grad_(False).to(device), device

    @torch.inference_mode()
    def probabilities(self, observations: Observations) -> Probabilities:
        logits, _ = self.network(torch.from_numpy(observations).to(self.device))
        return logits.softmax(-1).float().cpu().numpy()  # type: ignore[no-any-return]


def save_agent(
    folder: Path, network: Network, config: NetworkConfig, layout: Layout, mode: Mode, card: str, **facts: Any
) -> str:
    """Write an agent's checkpoint folder (weights as 16 bits); `facts` join its config. Returns its sha256."""
    settings = {
        "format": "kitchenmind agent 1",
        "layout": layout.name,
        "grid": layout.text,
        "planes": PLANES,
        "network": asdict(config),
        "mode": asdict(mode),
        **facts,
    }
    return save_checkpoint(folder, settings, dict(network.state_dict()), card, bits=16)


def network_of(checkpoint: Checkpoint) -> tuple[Network, Layout, NetworkConfig]:
    """Load the network of an agent's checkpoint, its layout and config. Raises CheckpointError if it is not one."""
    config = checkpoint.config
    try:
        layout = parse_layout(config["grid"], config["layout"])
        settings = NetworkConfig(**{**config["network"], "hidden": tuple(config["network"]["hidden"])})
        network = build_network(settings, layout)
        network.load_state_dict({name: torch.from_numpy(array) for name, array in checkpoint.tensors.items()})
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise CheckpointError(f"{checkpoint.folder}: not a readable agent ({error}). Fetch it again.") from error
    return network, layout, settings


def load_network(folder: Path | str) -> Network:
    """Load the network alone, e.g. to use its features."""
    return network_of(load_checkpoint(folder))[0]
