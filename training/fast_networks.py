"""The same networks, arranged for fast training: they read only the entries that can change, in one of several forms.

Which form and number format is fast depends on the processor: `choose_compute` measures them. The weights stay in the
network that is given.
"""

from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any, Protocol, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from models.networks.columns import varying_columns
from models.networks.config import LEAK, NetworkConfig
from models.networks.policy import CnnPolicy, Head, MlpPolicy, Network, build_network
from overcooked.layout import Layout, parse_layout
from overcooked.planes import PLANES
from training.compute import Compute, Request, autocast, quickest, requested
from training.lane_convolutions import LaneConvolutions
from training.sparse_layer import ColumnPlaces, SparseConvolution, SparseLinear, linear_forward

_MEASURED_ROWS = 256
_SET_ENTRIES = 10  # about as many entries of an observation are not zero
_FORMS = {"mlp": ("sparse", "dense"), "cnn": ("lanes", "sparse", "sparse_dense", "dense")}
_FLOAT32_FORMS = ("lanes", "sparse")

Function = Callable[[Tensor], tuple[Tensor, Tensor]]


class FastPath(Protocol):
    """A network applied to entries (rows, columns) int8: logits (rows, 6) and values (rows,), both float32."""

    columns: NDArray[np.int64]  # which entries of the flat encoding it wants
    compute: Compute  # its device takes the entries

    def __call__(self, entries: Tensor) -> tuple[Tensor, Tensor]: ...

    def frozen(self) -> Function:
        """Return the same function with the weights as they are now, for many calls without learning."""
        ...


class FastMlp:
    """The MLP, in which only the wide first layer is expensive."""

    def __init__(self, network: MlpPolicy, layout: Layout, compute: Compute) -> None:
        self.network, self.compute = network, compute
        self.columns, _ = varying_columns(layout)

    def __call__(self, entries: Tensor) -> tuple[Tensor, Tensor]:
        if self.compute.form != "sparse":
            return self.network.from_columns(entries.to(self.compute.dtype))
        first = SparseLinear.apply(entries, *self.network.scaled_first())  # type: ignore[no-untyped-call]
        logits, values = self.network.head.after_first(first)
        return logits, values

    def frozen(self) -> Function:
        if self.compute.form != "sparse":
            return self
        weight, bias = self.network.scaled_first()
        by_column, bias = weight.detach().t().contiguous(), bias.detach()
        rest = frozen_head(self.network.head)

        def function(entries: Tensor) -> tuple[Tensor, Tensor]:
            first = torch.empty(len(entries), len(bias))
            linear_forward(entries.numpy(), by_column.numpy(), bias.numpy(), first.numpy())
            return rest(first)

        return function


def frozen_head(head: Head) -> Function:
    """Return `Head.after_first` with the weights as they are now: fewer and wider products, no gradient."""
    layers = [cast(nn.Linear, layer) for layer in head.layers[1:]]
    middle = [(layer.weight.detach(), layer.bias.detach()) for layer in layers]
    last = torch.cat([head.policy.weight, head.value.weight]).detach()
    last_bias = torch.cat([head.policy.bias, head.value.bias]).detach()

    def function(x: Tensor) -> tuple[Tensor, Tensor]:
        """Answer for `x`, which is overwritten."""
        for weight, bias in middle:
            x = nn.functional.linear(nn.functional.leaky_relu_(x, LEAK), weight, bias)
        x = nn.functional.linear(nn.functional.leaky_relu_(x, LEAK), last, last_bias)
        return x[:, :-1], x[:, -1]

    return function


class FastCnn:
    """The CNN; what the static planes and the bias add to the first convolution is computed once for all rows."""

    def __init__(self, network: CnnPolicy, layout: Layout, compute: Compute) -> None:
        self.network, self.compute = network, compute
        self.columns, _ = varying_columns(layout, distinct=False)
        width, height = layout.width, layout.height
        first, second, third = self._convolutions()
        if compute.form == "dense":
            self._first = DenseConvolution(first, width, height, self.columns, planes_last=True)
        if compute.form in ("dense", "sparse_dense"):
            # The sparse first layer gives (width, height, filters), the dense one (filters, width, height).
            self._second = DenseConvolution(second, width, height, planes_last=compute.form == "sparse_dense")
            self._third = DenseConvolution(third, width, height)
        self._places = ColumnPlaces(self.columns, height, PLANES)
        self._on_device = torch.from_numpy(self.columns).to(compute.device)
        constant = torch.from_numpy(layout.static_planes.copy()).float()
        constant.view(-1)[torch.from_numpy(self.columns)] = 0
        self._static = constant.to(compute.device)  # (width, height, 26): the entries that never change

    def _convolutions(self) -> tuple[nn.Conv2d, nn.Conv2d, nn.Conv2d]:
        return tuple(cast(nn.Conv2d, layer) for layer in self.network.features.convolutions)  # type: ignore[return-value]

    def __call__(self, entries: Tensor) -> tuple[Tensor, Tensor]:
        return self._forward(self._prepared(), entries)

    def frozen(self) -> Function:
        return partial(self._forward, self._prepared())

    def _prepared(self) -> tuple[Tensor, list[tuple[Tensor, Tensor]]]:
        """Return what depends on the weights alone: the first layer's constant part and the dense matrices with
        biases."""
        form = self.compute.form
        if form == "direct":
            return self._static, []
        constant = self._convolutions()[0](self._static.permute(2, 0, 1)[None])[0]  # (filters, width, height)
        if form in ("sparse", "lanes"):
            return constant.permute(1, 2, 0), []
        later = [(layer.matrix(self.compute.dtype), layer.bias()) for layer in (self._second, self._third)]
        if form == "sparse_dense":
            return constant.permute(1, 2, 0), later
        return constant, [(self._first.matrix(self.compute.dtype), constant.flatten()), *later]

    def _forward(self, prepared: tuple[Tensor, list[tuple[Tensor, Tensor]]], entries: Tensor) -> tuple[Tensor, Tensor]:
        constant, matrices = prepared
        form, dtype = self.compute.form, self.compute.dtype
        if form == "direct":
            return self._direct(entries)
        x = entries.to(dtype)
        if form != "dense":
            first = SparseConvolution.apply(entries, self._convolutions()[0].weight, constant, self._places)  # type: ignore[no-untyped-call]
            x = first if form == "lanes" else nn.functional.leaky_relu(first, LEAK)
        if form == "lanes":
            later = [parameter for layer in self._convolutions()[1:] for parameter in (layer.weight, layer.bias)]
            x = LaneConvolutions.apply(x, *later)  # type: ignore[no-untyped-call]
        elif form == "sparse":
            x = x.view(len(x), *constant.shape).permute(0, 3, 1, 2)  # (rows, filters, W, H), channels_last in memory
            for layer in self._convolutions()[1:]:
                x = nn.functional.leaky_relu(layer(x), LEAK)
        else:
            x = x.flatten(1).to(dtype)
            for matrix, bias in matrices:
                x = nn.functional.leaky_relu(nn.functional.linear(x, matrix, bias.to(dtype)), LEAK)
        logits, values = self.network.head(x.flatten(1).float())
        return logits, values

    def _direct(self, entries: Tensor) -> tuple[Tensor, Tensor]:
        """Apply the network as it is written, to whole observations: the fastest form on a GPU."""
        seen = self._static.to(self.compute.dtype).expand(len(entries), *self._static.shape).flatten(1).clone()
        seen[:, self._on_device] = entries.to(self.compute.dtype)
        with autocast(self.compute.device, self.compute.precision):
            logits, values = self.network(seen.view(len(entries), *self._static.shape))
        return logits.float(), values.float()


class DenseConvolution:
    """One convolution as a matrix (outputs, inputs), built from the kernel by a list of places; gradients flow back.
    The matrix has a row for every output (filter, cell) and a column for every input entry.
    """

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
        device = layer.weight.device
        self._places = torch.from_numpy(np.flatnonzero(table.ravel() >= 0)).to(device)
        self._weights = torch.from_numpy(table.ravel()[table.ravel() >= 0]).to(device)

    def matrix(self, dtype: torch.dtype) -> Tensor:
        return Scattered.apply(self._kernel, self._places, self._weights, self._shape, dtype)  # type: ignore[no-untyped-call, no-any-return]

    def bias(self) -> Tensor:
        return self._bias.repeat_interleave(self._cells)


class Scattered(torch.autograd.Function):
    """Kernel to dense matrix; backwards, each weight gathers the gradients of all its places."""

    @staticmethod
    def forward(
        ctx: Any, kernel: Tensor, places: Tensor, weights: Tensor, shape: tuple[int, int], dtype: torch.dtype
    ) -> Tensor:
        ctx.save_for_backward(places, weights)
        ctx.kernel_shape = kernel.shape
        matrix = torch.zeros(shape[0] * shape[1], dtype=dtype, device=kernel.device)
        matrix[places] = kernel.flatten().to(dtype)[weights]
        return matrix.view(shape)

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None, None, None, None]:
        places, weights = ctx.saved_tensors
        count = ctx.kernel_shape.numel()
        summed = torch.bincount(weights, gradient.flatten()[places].float(), count)
        return summed.view(ctx.kernel_shape), None, None, None, None


def fast_path(network: Network, layout: Layout, compute: Compute) -> FastPath:
    """Return the network in the given form; it must already be on the device."""
    kind = FastMlp if isinstance(network, MlpPolicy) else FastCnn
    return kind(network, layout, compute)  # type: ignore[arg-type]


def choose_compute(config: NetworkConfig, layout: Layout) -> tuple[Compute, dict[str, float]]:
    """Return the fastest way to train such a network here, and the milliseconds of each candidate (empty if there is
    only one).

    Raises ComputeError for a device that does not exist.
    """
    return _chosen(config, layout.text, requested())


@lru_cache(maxsize=16)  # a process often asks for the same network: a population, a test
def _chosen(config: NetworkConfig, grid: str, wanted: Request) -> tuple[Compute, dict[str, float]]:
    layout, device = parse_layout(grid, "grid"), wanted.chosen_device()
    formats = wanted.precisions(device)
    forms = _FORMS[config.kind] if device == "cpu" else ("direct" if config.kind == "cnn" else "dense",)
    candidates = [
        Compute(device, precision, form)
        for form in forms
        for precision in formats
        if precision == "float32"
        or form not in _FLOAT32_FORMS  # the sparse kernels are float32, as is all of the network then
    ]
    if len(candidates) == 1:
        return candidates[0], {}
    with torch.random.fork_rng():
        torch.manual_seed(0)
        network = build_network(config, layout).to(device)
        return quickest(candidates, lambda candidate: _learning(network, layout, candidate), device)


def _learning(network: Network, layout: Layout, compute: Compute) -> Callable[[], object]:
    """Return a function that does one forward and backward pass on made-up observations, as sparse as real ones."""
    path = fast_path(network, layout, compute)
    random = np.random.default_rng(0)
    entries = (random.random((_MEASURED_ROWS, len(path.columns))) < _SET_ENTRIES / len(path.columns)).astype(np.int8)
    rows = torch.from_numpy(entries).to(compute.device)

    def learn() -> None:
        network.zero_grad()
        logits, values = path(rows)
        torch.autograd.backward(logits.square().mean() + values.square().mean())

    return learn
