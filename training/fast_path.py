"""The same networks, arranged for speed in training: inputs are the varying entries only, products are in bfloat16."""

from typing import Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from models.policy import MlpPolicy, Network
from overcooked.layout import Layout


class FastPath(Protocol):
    """A network on entries (rows, columns) int8: logits (rows, 6) and values (rows,)."""

    columns: NDArray[np.int64]  # which entries of the flat encoding it wants

    def __call__(self, entries: Tensor) -> tuple[Tensor, Tensor]: ...


class FastMlp:
    """The MLP with its wide first layer in bfloat16."""

    def __init__(self, network: MlpPolicy) -> None:
        self.network, self.columns = network, network.columns.numpy()

    def __call__(self, entries: Tensor) -> tuple[Tensor, Tensor]:
        return self.network.from_columns(entries.to(torch.bfloat16))


def fast_path(network: Network, layout: Layout) -> FastPath:
    """The quickest arrangement that computes the same function."""
    if isinstance(network, MlpPolicy):
        return FastMlp(network)
    raise NotImplementedError(layout.name)
