"""The same networks, arranged for speed in training: inputs are the varying entries only, products are in bfloat16.

It must not know how anything is learned; the weights stay in the network it is given.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, Protocol, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from models.columns import varying_columns
from models.network_config import LEAK
from models.policy import CnnPolicy, MlpPolicy, Network
from overcooked.layout import Layout


class FastPath(Protocol):
    """A network on entries (rows, columns) int8: logits (rows, 6) and values (rows,)."""

    columns: NDArray[np.int64]  # which entries of the flat encoding it wants

    def __call__(self, entries: Tensor) -> tuple[Tensor, Tensor]: ...

    def frozen(self) -> Callable[[Tensor], tuple[Tensor, Tensor]]:
        """The same function with the weights as they are now, for many calls without learning."""
        ...


class FastMlp:
    """The MLP with its wide first layer in bfloat16."""

    def __init__(self, network: MlpPolicy) -> None:
        self.network, self.columns = network, network.columns.numpy()

    def __call__(self, entries: Tensor) -> tuple[Tensor, Tensor]:
        return self.network.from_columns(entries.to(torch.bfloat16))

    def frozen(self) -> Callable[[Tensor], tuple[Tensor, Tensor]]:
        return self


class FastCnn:
    """The CNN with each convolution as one dense product in bfloat16: on small grids a processor does that sooner.

    The matrix of a convolution has a row for every (filter, cell) it gives and a column for every entry it takes.
    """

    def __init__(self, network: CnnPolicy, layout: Layout) -> None:
        self.network = network
        self.columns, _ = varying_columns(layout, distinct=False)
        width, height = layout.width, layout.height
        first, second, third = (cast(nn.Conv2d, layer) for layer in network.features.convolutions)
        self._first = DenseConvolution(first, width, height, self.columns, planes_last=True)
        self._second = DenseConvolution(second, width, height)
        self._third = DenseConvolution(third, width, height)
        constant = torch.from_numpy(layout.static_planes.copy()).float()  # what never changes is a bias of the first
        constant.view(-1)[torch.from_numpy(self.columns)] = 0
        self._constant = constant.permute(2, 0, 1)[None]  # (1, 26, width, height)

    def _prepared(self) -> list[tuple[Tensor, Tensor]]:
        """The dense matrices and biases of the weights as they are now."""
        constant = self.network.features.convolutions[0](self._constant).flatten()  # with the bias in it
        first = (self._first.matrix(), constant)
        later = [(layer.matrix(), layer.bias()) for layer in (self._second, self._third)]
        return [first, *later]

    def __call__(self, entries: Tensor) -> tuple[Tensor, Tensor]:
        return self._forward(self._prepared(), entries)

    def frozen(self) -> Callable[[Tensor], tuple[Tensor, Tensor]]:
        return partial(self._forward, self._prepared())

    def _forward(self, matrices: list[tuple[Tensor, Tensor]], entries: Tensor) -> tuple[Tensor, Tensor]:
        x = entries.to(torch.bfloat16)
        for matrix, bias in matrices:
            x = nn.functional.leaky_relu(nn.functional.linear(x, matrix, bias.to(torch.bfloat16)), LEAK)
        logits, values = self.network.head(x.float())
        return logits, values


class DenseConvolution:
    """One convolution as a matrix (outputs, inputs), built from the kernel by a list of places; gradients flow back."""

    def __init__(
        self,
        layer: nn.Conv2d,
        width: int,
        height: int,
        columns: NDArray[np.int64] | None = None,
        planes_last: bool = False,
    ) -> None:
        self._kernel, self._bias = layer.weight, cast(Tensor, layer.bias)
        kernel = np.arange(layer.weight.numel()).reshape(layer.weight.shape)  # the number of each weight
        filters, planes, side, _ = kernel.shape
        margin = side // 2 if layer.padding == "same" else 0
        out_width, out_height = width + 2 * margin - side + 1, height + 2 * margin - side + 1
        full = np.full((filters, out_width, out_height, planes, width, height), -1, np.int64)
        for x in range(out_width):
            for y in range(out_height):
                for dx in range(side):
                    for dy in range(side):
                        from_x, from_y = x + dx - margin, y + dy - margin
                        if 0 <= from_x < width and 0 <= from_y < height:
                            full[:, x, y, :, from_x, from_y] = kernel[:, :, dx, dy]
        if planes_last:
            full = full.transpose(0, 1, 2, 4, 5, 3)
        table = full.reshape(filters * out_width * out_height, -1)
        if columns is not None:
            table = table[:, columns]
        self._shape = table.shape
        self._cells = out_width * out_height
        self._places = torch.from_numpy(np.flatnonzero(table.ravel() >= 0))
        self._weights = torch.from_numpy(table.ravel()[self._places.numpy()])

    def matrix(self) -> Tensor:
        return Scattered.apply(self._kernel, self._places, self._weights, self._shape)  # type: ignore[no-untyped-call, no-any-return]

    def bias(self) -> Tensor:
        return self._bias.repeat_interleave(self._cells)


class Scattered(torch.autograd.Function):
    """Kernel to dense bfloat16 matrix; backwards, each weight gathers the gradients of all its places."""

    @staticmethod
    def forward(ctx: Any, kernel: Tensor, places: Tensor, weights: Tensor, shape: tuple[int, int]) -> Tensor:
        ctx.save_for_backward(places, weights)
        ctx.kernel_shape = kernel.shape
        matrix = torch.zeros(shape[0] * shape[1], dtype=torch.bfloat16)
        matrix[places] = kernel.flatten().to(torch.bfloat16)[weights]
        return matrix.view(shape)

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None, None, None]:
        places, weights = ctx.saved_tensors
        count = ctx.kernel_shape.numel()
        summed = torch.bincount(weights, gradient.flatten()[places].float(), count)
        return summed.view(ctx.kernel_shape), None, None, None


def fast_path(network: Network, layout: Layout) -> FastPath:
    """The quickest arrangement that computes the same function."""
    return FastMlp(network) if isinstance(network, MlpPolicy) else FastCnn(network, layout)
