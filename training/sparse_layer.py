"""The first layer of a network on sparse observations: only entries that are not zero are multiplied.

A kitchen's encoding has hundreds of entries of which about a dozen are set, so a first layer written as a matrix
product spends nearly all its time on zeros. These kernels run on the CPU, in float32.
"""

from typing import Any

import numpy as np
import torch
from numba import njit
from numpy.typing import NDArray
from torch import Tensor

_KERNEL = 5  # side of the first convolution


class ColumnPlaces:
    """Where the columns of the entries lie in the encoding (width, height, planes)."""

    def __init__(self, columns: NDArray[np.int64], height: int, planes: int) -> None:
        cells, self.planes = columns // planes, columns % planes
        self.x, self.y = cells // height, cells % height


class SparseLinear(torch.autograd.Function):
    """`entries` (rows, columns) int8 times `weight` (outputs, columns), plus `bias` (outputs,): (rows, outputs)."""

    @staticmethod
    def forward(ctx: Any, entries: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
        ctx.save_for_backward(entries)
        out = torch.empty(len(entries), len(bias))
        by_column = weight.detach().t().contiguous()
        linear_forward(entries.numpy(), by_column.numpy(), bias.detach().numpy(), out.numpy())
        return out

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[None, Tensor, Tensor]:
        (entries,) = ctx.saved_tensors
        by_column = torch.zeros(entries.shape[1], gradient.shape[1])
        linear_backward(entries.numpy(), gradient.contiguous().numpy(), by_column.numpy())
        return None, by_column.t(), gradient.sum(0)


class SparseConvolution(torch.autograd.Function):
    """The first convolution ("same" size, 5 x 5) of entries that are mostly zero.

    `entries` (rows, columns) int8 are places `cells` (columns,) and `planes` (columns,) of the encoding; `kernel`
    (filters, planes, 5, 5) is a Conv2d's weight; `constant` (width, height, filters) is what the static planes and the
    bias add to every row. Returns (rows, width, height * filters).
    """

    @staticmethod
    def forward(ctx: Any, entries: Tensor, kernel: Tensor, constant: Tensor, places: ColumnPlaces) -> Tensor:
        ctx.save_for_backward(entries)
        ctx.places, ctx.shape = places, kernel.shape
        width, height, filters = constant.shape
        out = torch.empty(len(entries), width, height * filters)
        convolution_forward(
            entries.numpy(), places.x, places.y, places.planes,
            _by_plane(kernel), constant.detach().contiguous().numpy(), out.numpy(),
        )  # fmt: skip
        return out

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[None, Tensor, Tensor, None]:
        (entries,) = ctx.saved_tensors
        filters, planes = ctx.shape[:2]
        width, height = gradient.shape[1], gradient.shape[2] // filters
        by_cell = gradient.contiguous()
        by_plane = torch.zeros(planes, _KERNEL, _KERNEL * filters)
        places: ColumnPlaces = ctx.places
        convolution_backward(entries.numpy(), places.x, places.y, places.planes, by_cell.numpy(), by_plane.numpy())
        in_order = by_plane.view(planes, _KERNEL, _KERNEL, filters).flip(2).permute(3, 0, 1, 2)
        return None, in_order, by_cell.sum(0).view(width, height, filters), None


def _by_plane(kernel: Tensor) -> NDArray[np.float32]:
    """Return a Conv2d's weight as (planes, 5, 5 * filters), the second axis of places reversed.

    The values that one entry adds to the cells of a column around it are then contiguous, ordered as in the output.
    """
    reordered = kernel.detach().permute(1, 2, 3, 0).flip(2).contiguous()
    return reordered.flatten(2).numpy()


@njit(cache=True, fastmath=True)
def _set_places(entries, r, places):  # type: ignore[no-untyped-def]
    """Write the columns that are not zero in row `r` to `places`; return how many. Without a branch: the set entries
    differ from row to row, and a mispredicted branch costs more than a write."""
    count = 0
    for c in range(entries.shape[1]):
        places[count] = c
        count += entries[r, c] != 0
    return count


@njit(cache=True, fastmath=True)
def linear_forward(entries, weight, bias, out):  # type: ignore[no-untyped-def]
    """`out[r] = bias + sum of entries[r, c] * weight[c]`, skipping zeros."""
    places = np.empty(entries.shape[1] + 1, np.int64)
    for r in range(entries.shape[0]):
        count = _set_places(entries, r, places)
        for k in range(out.shape[1]):
            out[r, k] = bias[k]
        for j in range(count):
            c = places[j]
            value = np.float32(entries[r, c])
            for k in range(out.shape[1]):
                out[r, k] += value * weight[c, k]


@njit(cache=True, fastmath=True)
def linear_backward(entries, gradient, weight_gradient):  # type: ignore[no-untyped-def]
    """Add each row's gradient to the lines of the weight that the row used."""
    places = np.empty(entries.shape[1] + 1, np.int64)
    for r in range(entries.shape[0]):
        for j in range(_set_places(entries, r, places)):
            c = places[j]
            value = np.float32(entries[r, c])
            for k in range(gradient.shape[1]):
                weight_gradient[c, k] += value * gradient[r, k]


@njit(cache=True, fastmath=True)
def convolution_forward(entries, xs, ys, planes, kernel, constant, out):  # type: ignore[no-untyped-def]
    """`out` (rows, width, height * filters): each entry adds its kernel column to the cells around its own."""
    width, height, filters = constant.shape
    margin = kernel.shape[1] // 2
    places = np.empty(entries.shape[1] + 1, np.int64)
    for r in range(entries.shape[0]):
        out[r] = constant.reshape(width, height * filters)
        for j in range(_set_places(entries, r, places)):
            c = places[j]
            value = np.float32(entries[r, c])
            first, end = max(0, ys[c] - margin), min(height, ys[c] + margin + 1)
            skipped = (first - ys[c] + margin) * filters
            for to_x in range(max(0, xs[c] - margin), min(width, xs[c] + margin + 1)):
                cells = out[r, to_x, first * filters : end * filters]
                weights = kernel[planes[c], xs[c] - to_x + margin, skipped : skipped + len(cells)]
                for k in range(len(cells)):
                    cells[k] += value * weights[k]


@njit(cache=True, fastmath=True)
def convolution_backward(entries, xs, ys, planes, gradient, kernel_gradient):  # type: ignore[no-untyped-def]
    """Add each row's gradient around an entry to the kernel column that the entry used."""
    filters = kernel_gradient.shape[2] // kernel_gradient.shape[1]
    width, height = gradient.shape[1], gradient.shape[2] // filters
    margin = kernel_gradient.shape[1] // 2
    places = np.empty(entries.shape[1] + 1, np.int64)
    for r in range(entries.shape[0]):
        for j in range(_set_places(entries, r, places)):
            c = places[j]
            value = np.float32(entries[r, c])
            first, end = max(0, ys[c] - margin), min(height, ys[c] + margin + 1)
            skipped = (first - ys[c] + margin) * filters
            for to_x in range(max(0, xs[c] - margin), min(width, xs[c] + margin + 1)):
                cells = gradient[r, to_x, first * filters : end * filters]
                weights = kernel_gradient[planes[c], xs[c] - to_x + margin, skipped : skipped + len(cells)]
                for k in range(len(cells)):
                    weights[k] += value * cells[k]
