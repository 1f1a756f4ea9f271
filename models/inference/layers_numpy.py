"""Layers of a network in numpy, and a checkpoint's tensors by name."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.inference.attention import norm

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class Linear:
    weight: Floats  # (inputs, outputs)
    bias: Floats

    def __call__(self, x: Floats) -> Floats:
        out = x @ self.weight
        out += self.bias
        return out


@dataclass(frozen=True)
class Norm:
    weight: Floats
    bias: Floats

    def __call__(self, x: Floats) -> Floats:
        normed: Floats = norm(x, self.weight, self.bias)
        return normed


class NamedWeights:
    """A checkpoint's tensors by name, as the parts of a network. Raises KeyError for one that is missing."""

    def __init__(self, tensors: Mapping[str, NDArray[Any]]) -> None:
        self._tensors = tensors

    def array(self, name: str) -> Floats:
        return np.ascontiguousarray(self._tensors[name], np.float32)

    def linear(self, name: str) -> Linear:
        return Linear(np.ascontiguousarray(self.array(f"{name}.weight").T), self.array(f"{name}.bias"))

    def norm(self, name: str) -> Norm:
        return Norm(self.array(f"{name}.weight"), self.array(f"{name}.bias"))
