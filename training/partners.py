"""Frozen agents that play with a learner: all of them answer in one batched product. It must not know who learns."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from models.checkpoint import CheckpointError, load_checkpoint
from models.policy import MlpPolicy, network_of
from overcooked.layout import Layout

# Half of a partner's games are played as its probabilities say, half nearly decided: people meet decided agents.
TEMPERATURES = (1.0, 1.0, 0.2, 0.2)


class PartnerPool:
    """`partners` agents, each in `games` games of their own: (partners, games) observations to actions."""

    def __init__(self, networks: Sequence[MlpPolicy], games: int) -> None:
        heads = [network.head for network in networks]
        self.count, self.games = len(heads), games
        self.columns = networks[0].columns.numpy()  # which entries of the flat encoding they want
        first = [network.scaled_first() for network in networks]
        rest = [[(layer.weight, layer.bias) for layer in (*head.layers[1:], head.policy)] for head in heads]
        self._layers = [_stacked(first), *(_stacked(layer) for layer in zip(*rest, strict=True))]
        self._temperature = torch.tensor([TEMPERATURES[game % 4] for game in range(games)])[None, :, None]

    @torch.inference_mode()
    def logits(self, entries: NDArray[np.int8]) -> NDArray[np.float32]:
        """`entries` (partners * games, columns) to logits (partners * games, 6), already at each game's temperature."""
        x = torch.from_numpy(entries).float().view(self.count, self.games, -1)
        for k, (weight, bias) in enumerate(self._layers):
            x = torch.baddbmm(bias, x, weight)
            if k < len(self._layers) - 1:
                x = torch.nn.functional.leaky_relu(x)
        return (x / self._temperature).flatten(0, 1).numpy()


def _stacked(layers: Sequence[tuple[torch.Tensor, torch.Tensor]]) -> tuple[torch.Tensor, torch.Tensor]:
    """Weights (partners, inputs, outputs) and biases (partners, 1, outputs)."""
    weights = torch.stack([weight.detach().t() for weight, _ in layers]).contiguous()
    return weights, torch.stack([bias.detach()[None] for _, bias in layers]).contiguous()


def load_partners(folders: Sequence[Path], layout: Layout) -> list[MlpPolicy]:
    """The networks of a population. Raises CheckpointError where one is for another layout or no `mlp`."""
    networks = []
    for folder in folders:
        network, trained_on, _ = network_of(load_checkpoint(folder))
        if trained_on.text != layout.text or not isinstance(network, MlpPolicy):
            raise CheckpointError(f"{folder}: partners must be mlp agents of {layout.name}. Leave it out of the pool.")
        networks.append(network)
    return networks
