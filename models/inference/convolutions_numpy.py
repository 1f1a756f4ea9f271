"""Convolutions in numpy, for serving: the features of `models.networks.policy.ConvolutionalFeatures` without torch."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from models.networks.config import LEAK
from models.protocols import Observations

Floats = NDArray[np.float32]


class NumpyConvolutions:
    """Observations (rows, width, height, 26) to features (rows, `size`), in torch's order.

    `tensors`: weights and biases by torch's names (`0.weight`, ...). Each convolution is one matrix product over all
    neighbourhoods; all but the last keep the size of the grid. Raises KeyError, ValueError for unsuitable tensors.
    """

    def __init__(self, tensors: Mapping[str, NDArray[Any]], width: int, height: int) -> None:
        count = sum(name.endswith(".weight") for name in tensors)
        self._layers = []
        for k in range(count):
            kernel = np.asarray(tensors[f"{k}.weight"], np.float32)  # (filters, planes, side, side)
            filters, planes, side, _ = kernel.shape
            matrix = np.ascontiguousarray(kernel.reshape(filters, planes * side * side).T)
            margin = side // 2 if k < count - 1 else 0
            self._layers.append((matrix, np.asarray(tensors[f"{k}.bias"], np.float32), side, margin))
            width, height = width + 2 * margin - side + 1, height + 2 * margin - side + 1
        self.size = self._layers[-1][0].shape[1] * width * height

    def __call__(self, observations: Observations) -> Floats:
        x = observations.astype(np.float32)  # (rows, width, height, planes)
        for matrix, bias, side, margin in self._layers:
            padded = np.pad(x, ((0, 0), (margin, margin), (margin, margin), (0, 0)))
            around = sliding_window_view(padded, (side, side), axis=(1, 2))  # (rows, width, height, planes, side, side)
            x = around.reshape(*around.shape[:3], -1) @ matrix
            x += bias
            np.maximum(x, LEAK * x, out=x)
        return np.ascontiguousarray(x.transpose(0, 3, 1, 2)).reshape(len(x), -1)
