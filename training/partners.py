"""Frozen agents that play with the ego agent, computed in batches where possible."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from models.networks.checkpoint import CheckpointError, load_checkpoint
from models.networks.policy import MlpPolicy, Network, network_of
from overcooked.layout import Layout
from training.compute import Compute
from training.fast_networks import fast_path
from training.sparse_layer import linear_forward

# A partner samples in half of its games and is nearly deterministic in the other half, as agents in studies are.
TEMPERATURES = (1.0, 1.0, 0.2, 0.2)


class PartnerPool:
    """`partners` agents, each in `games` games of their own: (partners, games) observations to actions."""

    def __init__(self, networks: Sequence[Network], layout: Layout, games: int, compute: Compute | None = None) -> None:
        compute = compute or Compute()
        self._device = compute.device
        paths = [fast_path(network.to(compute.device), layout, compute) for network in networks]
        self.count, self.games = len(networks), games
        self.columns = paths[0].columns  # which entries of the flat encoding they want
        perceptrons = [network for network in networks if isinstance(network, MlpPolicy)]
        self._stack = _Stack(perceptrons) if len(perceptrons) == len(networks) else None
        with torch.inference_mode():
            self._frozen = [path.frozen() for path in paths]
        temperatures = torch.tensor([TEMPERATURES[game % 4] for game in range(games)])[None, :, None]
        self._temperature = temperatures.to(self._device)

    @torch.inference_mode()
    def logits(self, entries: NDArray[np.int8]) -> NDArray[np.float32]:
        """`entries` (partners * games, columns) to logits (partners * games, 6), already at each game's temperature."""
        x = torch.from_numpy(entries).to(self._device).view(self.count, self.games, -1)
        if self._stack is not None:
            answers = self._stack.logits(x)
        else:
            answers = torch.stack([frozen(rows)[0] for frozen, rows in zip(self._frozen, x, strict=True)])
        return np.asarray((answers / self._temperature).flatten(0, 1).cpu().numpy())


class _Stack:
    """Networks of equal shape in one batch: one batched product per layer instead of a call for each network."""

    def __init__(self, networks: Sequence[MlpPolicy]) -> None:
        heads = [network.head for network in networks]
        self._first = _stacked([network.scaled_first() for network in networks])
        rest = [[(layer.weight, layer.bias) for layer in (*head.layers[1:], head.policy)] for head in heads]
        self._rest = [_stacked(layer) for layer in zip(*rest, strict=True)]

    def logits(self, entries: torch.Tensor) -> torch.Tensor:
        """(networks, rows, columns) to (networks, rows, 6)."""
        x = self._first_layer(entries)
        for weight, bias in self._rest:
            x = torch.baddbmm(bias, torch.nn.functional.leaky_relu(x), weight)
        return x

    def _first_layer(self, entries: torch.Tensor) -> torch.Tensor:
        weight, bias = self._first
        if entries.device.type != "cpu":
            return torch.baddbmm(bias, entries.float(), weight)
        out = torch.empty(*entries.shape[:2], weight.shape[2])
        # only entries that are not zero: a partner has few rows and a wide layer
        for k, rows in enumerate(entries.numpy()):
            linear_forward(rows, weight[k].numpy(), bias[k, 0].numpy(), out[k].numpy())
        return out


def _stacked(layers: Sequence[tuple[torch.Tensor, torch.Tensor]]) -> tuple[torch.Tensor, torch.Tensor]:
    """Return the stacked weights (networks, inputs, outputs) and biases (networks, 1, outputs)."""
    weights = torch.stack([weight.detach().t() for weight, _ in layers]).contiguous()
    return weights, torch.stack([bias.detach()[None] for _, bias in layers]).contiguous()


def load_partners(folders: Sequence[Path], layout: Layout) -> list[Network]:
    """Load the networks of a population. Raises CheckpointError if one is for another layout, or they are of different
    kinds."""
    networks: list[Network] = []
    for folder in folders:
        network, trained_on, _ = network_of(load_checkpoint(folder))
        if trained_on.text != layout.text:
            raise CheckpointError(f"{folder}: was trained for {trained_on.name}, not {layout.name}. Leave it out.")
        if networks and type(network) is not type(networks[0]):
            raise CheckpointError(f"{folder}: all partners must be of one kind, mlp or cnn. Leave it out.")
        networks.append(network)
    return networks
