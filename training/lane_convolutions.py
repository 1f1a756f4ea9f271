"""The CNN's second and third convolution on the CPU with the batch innermost, so that a vector register holds samples.

With 25 filters neither a matrix product nor a library's convolution fills vectors of 8 or 16 numbers. Samples do. A
block of samples is laid out as (width, filters, height, lanes): one kernel weight meets a run of `height * lanes`
neighbouring numbers, and places outside the grid are never multiplied. Float32 only.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numba import njit
from numpy.typing import NDArray
from torch import Tensor

from models.networks.config import LEAK

Floats = NDArray[np.float32]

LANES = 128  # samples in a block: measured fastest of 32, 64, 128 and 256 on AVX2 for grids of 5 x 5 and 9 x 7
_ROWS_AT_ONCE = 16
_SIDE = 3
_FORWARD, _INPUT_GRADIENT, _KERNEL_GRADIENT = 0, 1, 2

# numba makes a float of uint64 + int64, and only with unsigned indices can it skip the check for negative ones.
_1, _2, _3, _4, _5 = (np.uint64(n) for n in range(1, 6))


class LaneConvolutions(torch.autograd.Function):
    """Compute leaky ReLU, 3 x 3 "same", leaky ReLU, 3 x 3 "valid", leaky ReLU.

    `first` (rows, width, height * filters) is what the first convolution gave, before its leaky ReLU; kernels and
    biases are those of a Conv2d. Returns (rows, filters * (width - 2) * (height - 2)) in a Conv2d's order.
    """

    @staticmethod
    def forward(ctx: Any, first: Tensor, kernel_2: Tensor, bias_2: Tensor, kernel_3: Tensor, bias_3: Tensor) -> Tensor:
        filters = len(bias_2)
        rows, width, height = len(first), first.shape[1], first.shape[2] // filters
        sizes = (width * height, width * height, (width - 2) * (height - 2))
        lanes = [torch.empty(rows * filters * size) for size in sizes]
        out = torch.empty(rows, filters, width - 2, height - 2)
        _forward(
            first.detach().view(rows, width, height, filters).numpy(),
            (_packed(kernel_2, False), _packed(kernel_3, False)),
            (bias_2.detach().numpy(), bias_3.detach().numpy()),
            [layer.numpy() for layer in lanes],
            out.numpy(),
        )
        ctx.save_for_backward(kernel_2, kernel_3, *lanes)
        ctx.shapes = first.shape, out.shape
        return out.flatten(1)

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
        kernel_2, kernel_3, *lanes = ctx.saved_tensors
        first_shape, out_shape = ctx.shapes
        filters = len(kernel_2)
        before = torch.empty(first_shape)
        kernels = torch.zeros(2, _SIDE * _SIDE * filters * filters)
        biases = torch.zeros(2, filters)
        _backward(
            gradient.contiguous().view(out_shape).numpy(),
            [layer.numpy() for layer in lanes],
            (_packed(kernel_2, True), _packed(kernel_3, True)),
            (kernels.numpy(), biases.numpy()),
            before.view(*first_shape[:2], -1, filters).numpy(),
        )
        in_order = kernels.view(2, _SIDE, _SIDE, filters, filters).permute(0, 3, 4, 1, 2).contiguous()
        return before, in_order[0], biases[0], in_order[1], biases[1]


def _packed(kernel: Tensor, transposed: bool) -> Floats:
    """Return the kernel flat in the order in which it is read: (3, 3, outputs, inputs) or, transposed, (3, 3, inputs,
    outputs)."""
    order = (2, 3, 1, 0) if transposed else (2, 3, 0, 1)
    return kernel.detach().permute(order).contiguous().flatten().numpy()


# These two call one compiled function after the other: compiled as one they take four times as long to compile.


def _forward(
    first: Floats, kernels: tuple[Floats, Floats], biases: tuple[Floats, Floats], lanes: Sequence[Floats], out: Floats
) -> None:
    rows, width, height, filters = first.shape
    for start in range(0, rows, LANES):
        end = min(rows, start + LANES)
        x_1, x_2, x_3 = (_block(layer, start, end, rows) for layer in lanes)
        _to_lanes(first[start:end], x_1)
        _leaky(x_1)
        _set_to_bias(biases[0], x_2, width)
        _convolve(_FORWARD, kernels[0], x_1, x_2, width, height, filters, end - start, 1)
        _leaky(x_2)
        _set_to_bias(biases[1], x_3, width - 2)
        _convolve(_FORWARD, kernels[1], x_2, x_3, width, height, filters, end - start, 0)
        _leaky(x_3)
        _from_lanes(x_3, out[start:end].transpose(0, 2, 3, 1))


def _backward(
    gradient: Floats,
    lanes: Sequence[Floats],
    kernels: tuple[Floats, Floats],
    found: tuple[Floats, Floats],
    before: Floats,
) -> None:
    """Add to `found`, the gradients of both kernels (2, 3 * 3 * filters * filters) and biases (2, filters)."""
    rows, width, height, filters = before.shape
    for start in range(0, rows, LANES):
        end = min(rows, start + LANES)
        x_1, x_2, x_3 = (_block(layer, start, end, rows) for layer in lanes)
        g_1, g_2, g_3 = np.zeros_like(x_1), np.zeros_like(x_2), np.empty_like(x_3)
        _to_lanes(gradient[start:end].transpose(0, 2, 3, 1), g_3)
        _leaky_gradient(x_3, g_3, found[1][1], width - 2)
        _convolve(_KERNEL_GRADIENT, found[0][1], x_2, g_3, width, height, filters, end - start, 0)
        _convolve(_INPUT_GRADIENT, kernels[1], g_2, g_3, width, height, filters, end - start, 0)
        _leaky_gradient(x_2, g_2, found[1][0], width)
        _convolve(_KERNEL_GRADIENT, found[0][0], x_1, g_2, width, height, filters, end - start, 1)
        _convolve(_INPUT_GRADIENT, kernels[0], g_1, g_2, width, height, filters, end - start, 1)
        _leaky_gradient(x_1, g_1, np.zeros(filters, np.float32), width)
        _from_lanes(g_1, before[start:end])


def _block(layer: Floats, start: int, end: int, rows: int) -> Floats:
    size = len(layer) // rows
    return layer[start * size : end * size]


@njit(cache=True, fastmath=True, error_model="numpy")
def _to_lanes(rows, block):  # type: ignore[no-untyped-def]
    """Copy `rows` (lanes, width, height, filters) to a block.

    A few rows at a time: 128 rows lie on more pages than the processor's first address table (TLB) holds.
    """
    lanes, width, height, filters = rows.shape
    for first in range(0, lanes, _ROWS_AT_ONCE):
        end = min(lanes, first + _ROWS_AT_ONCE)
        for x in range(width):
            for y in range(height):
                for f in range(filters):
                    place = ((x * filters + f) * height + y) * lanes
                    for lane in range(first, end):
                        block[place + lane] = rows[lane, x, y, f]


@njit(cache=True, fastmath=True, error_model="numpy")
def _from_lanes(block, rows):  # type: ignore[no-untyped-def]
    """The inverse of `_to_lanes`."""
    lanes, width, height, filters = rows.shape
    for first in range(0, lanes, _ROWS_AT_ONCE):
        end = min(lanes, first + _ROWS_AT_ONCE)
        for x in range(width):
            for y in range(height):
                for f in range(filters):
                    place = ((x * filters + f) * height + y) * lanes
                    for lane in range(first, end):
                        rows[lane, x, y, f] = block[place + lane]


@njit(cache=True, fastmath=True, error_model="numpy")
def _leaky(x):  # type: ignore[no-untyped-def]
    for i in range(len(x)):
        x[i] = max(x[i], np.float32(LEAK) * x[i])


@njit(cache=True, fastmath=True, error_model="numpy")
def _leaky_gradient(x, gradient, bias_gradient, width):  # type: ignore[no-untyped-def]
    """`x` is what the leaky ReLU gave: it has the sign of what it got. The sums are the gradient of the bias."""
    filters = len(bias_gradient)
    run = len(x) // (width * filters)
    for k in range(width * filters):
        values, gradients = x[k * run : (k + 1) * run], gradient[k * run : (k + 1) * run]
        total = np.float32(0)
        for i in range(run):
            gradients[i] *= np.float32(1.0) if values[i] > 0 else np.float32(LEAK)
            total += gradients[i]
        bias_gradient[k % filters] += total


@njit(cache=True, fastmath=True, error_model="numpy")
def _set_to_bias(bias, out, width):  # type: ignore[no-untyped-def]
    run = len(out) // (width * len(bias))
    for k in range(width * len(bias)):
        out[k * run : (k + 1) * run] = bias[k % len(bias)]


@njit(cache=True, fastmath=True, error_model="numpy")
def _convolve(what, weights, inside, outside, width, height, filters, lanes, margin):  # type: ignore[no-untyped-def]
    """Add one 3 x 3 convolution of a block to `outside`, or one of its gradients to `inside` or `weights`.

    `inside` (width, filters, height, lanes) is on the input's side, `outside` on the output's, both flat.
    """
    out_width, out_height = width + 2 * margin - _SIDE + 1, height + 2 * margin - _SIDE + 1
    count, in_stride, out_stride = np.uint64(filters), np.uint64(height * lanes), np.uint64(out_height * lanes)
    source, source_stride, target, target_stride = inside, in_stride, outside, out_stride
    if what == _INPUT_GRADIENT:
        source, source_stride, target, target_stride = outside, out_stride, inside, in_stride
    for out_x in range(out_width):
        for dx in range(_SIDE):
            x = out_x + dx - margin
            if x < 0 or x >= width:
                continue
            for dy in range(_SIDE):
                first, end = max(0, margin - dy), min(out_height, height + margin - dy)
                run = np.uint64((end - first) * lanes)
                i = np.uint64((x * filters * height + first + dy - margin) * lanes)
                o = np.uint64((out_x * filters * out_height + first) * lanes)
                w = np.uint64((dx * _SIDE + dy) * filters * filters)
                if what == _KERNEL_GRADIENT:
                    _add_outer(outside, o, out_stride, inside, i, in_stride, weights, w, count, run)
                    continue
                if what == _INPUT_GRADIENT:
                    i, o = o, i
                _add_product(weights, w, count, source, i, source_stride, target, o, target_stride, run)


@njit(cache=True, fastmath=True, error_model="numpy")
def _add_product(weights, w, count, x, x_start, x_stride, out, out_start, out_stride, run):  # type: ignore[no-untyped-def]
    """Add: `out[r, :run] += sum over c of weights[r, c] * x[c, :run]` for `count` rows r and c.

    Two rows and five columns at a time: their ten weights and the numbers in flight just fill 16 registers.
    """
    fives = count - count % _5
    for r in range(np.uint64(0), count, _2):
        two = r + _1 < count
        a = out_start + r * out_stride
        b = a + out_stride if two else a
        u = w + r * count
        v = u + count if two else u
        for c in range(np.uint64(0), fives if two else np.uint64(0), _5):
            p0, p1, p2, p3, p4 = (
                weights[u + c], weights[u + c + _1], weights[u + c + _2], weights[u + c + _3], weights[u + c + _4]
            )  # fmt: skip
            q0, q1, q2, q3, q4 = (
                weights[v + c], weights[v + c + _1], weights[v + c + _2], weights[v + c + _3], weights[v + c + _4]
            )  # fmt: skip
            x0 = x_start + c * x_stride
            x1, x2, x3, x4 = x0 + x_stride, x0 + _2 * x_stride, x0 + _3 * x_stride, x0 + _4 * x_stride
            for i in range(run):
                e0, e1, e2, e3, e4 = x[x0 + i], x[x1 + i], x[x2 + i], x[x3 + i], x[x4 + i]
                out[a + i] += p0 * e0 + p1 * e1 + p2 * e2 + p3 * e3 + p4 * e4
                out[b + i] += q0 * e0 + q1 * e1 + q2 * e2 + q3 * e3 + q4 * e4
        for row in range(r, r + _2 if two else r + _1):
            place = out_start + row * out_stride
            for c in range(fives if two else np.uint64(0), count):
                weight, x0 = weights[w + row * count + c], x_start + c * x_stride
                for i in range(run):
                    out[place + i] += weight * x[x0 + i]


@njit(cache=True, fastmath=True, error_model="numpy")
def _add_outer(gradient, g, g_stride, x, x_start, x_stride, weights, w, count, run):  # type: ignore[no-untyped-def]
    """Add: `weights[r, c] += sum over i < run of gradient[r, i] * x[c, i]` for `count` rows r and c, in such tiles."""
    zero = np.float32(0)
    fives = count - count % _5
    for r in range(np.uint64(0), count, _2):
        two = r + _1 < count
        a = g + r * g_stride
        b = a + g_stride
        u = w + r * count
        v = u + count
        for c in range(np.uint64(0), fives if two else np.uint64(0), _5):
            x0 = x_start + c * x_stride
            x1, x2, x3, x4 = x0 + x_stride, x0 + _2 * x_stride, x0 + _3 * x_stride, x0 + _4 * x_stride
            p0, p1, p2, p3, p4, q0, q1, q2, q3, q4 = zero, zero, zero, zero, zero, zero, zero, zero, zero, zero
            for i in range(run):
                e0, e1, e2, e3, e4 = x[x0 + i], x[x1 + i], x[x2 + i], x[x3 + i], x[x4 + i]
                first, second = gradient[a + i], gradient[b + i]
                p0, p1, p2, p3, p4 = p0 + first * e0, p1 + first * e1, p2 + first * e2, p3 + first * e3, p4 + first * e4
                q0, q1, q2, q3, q4 = (
                    q0 + second * e0, q1 + second * e1, q2 + second * e2, q3 + second * e3, q4 + second * e4
                )  # fmt: skip
            for k, value in enumerate((p0, p1, p2, p3, p4)):
                weights[u + c + np.uint64(k)] += value
            for k, value in enumerate((q0, q1, q2, q3, q4)):
                weights[v + c + np.uint64(k)] += value
        for row in range(r, r + _2 if two else r + _1):
            for c in range(fives if two else np.uint64(0), count):
                x0, place, total = x_start + c * x_stride, g + row * g_stride, zero
                for i in range(run):
                    total += gradient[place + i] * x[x0 + i]
                weights[w + row * count + c] += total
