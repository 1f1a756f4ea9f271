"""How a checkpoint stores its numbers: as they are, as 16 bits, or with 8 bits for each weight of a large matrix.

With 8 bits, each row of a matrix is stored as integers from -127 to 127 and one factor, in a tensor of its own. The
rounding error is at most 1/254 of the row's largest weight. Small tensors, such as biases, have 16 bits.
"""

from collections.abc import Mapping
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

Tensors = dict[str, NDArray[Any]]
Bits = Literal[8, 16, 32]

FACTOR: Final = ".factor_of_row"  # the end of the factors' name
MAX_CODE: Final = 127  # of the whole number that stands for a weight
SMALL: Final = 4096  # a matrix with fewer weights has 16 bits
_FACTOR_BITS: Final = 12  # significant bits of a factor: MAX_CODE times it is exact, so storing twice changes nothing


def stored(tensors: Mapping[str, Any], bits: Bits) -> Tensors:
    """Return the arrays to write. Floats have `bits`; everything else stays as it is."""
    result: Tensors = {}
    for name, tensor in tensors.items():
        array = np.asarray(tensor)
        if array.dtype.kind != "f" or bits == 32:
            result[name] = array.astype(array.dtype, order="C")
        elif bits == 8 and array.ndim == 2 and array.size >= SMALL:
            result[name], result[name + FACTOR] = _rows(array.astype(np.float32))
        else:
            result[name] = array.astype(np.float16, order="C")
    return result


def restored(arrays: Mapping[str, NDArray[Any]]) -> Tensors:
    """Return what `stored` was given, floats as float32. Raises ValueError for a matrix without its factors."""
    result: Tensors = {}
    for name, array in arrays.items():
        if name.endswith(FACTOR):
            continue
        if array.dtype == np.int8:
            factors = arrays.get(name + FACTOR)
            if factors is None or factors.shape != (len(array), 1):
                raise ValueError(f"{name}: the factors of its rows are missing")
            result[name] = array.astype(np.float32) * factors
        else:
            result[name] = array.astype(np.float32) if array.dtype == np.float16 else array
    return result


def bits_of(arrays: Mapping[str, NDArray[Any]]) -> Bits:
    """Return the bits with which these arrays were stored."""
    kinds = {array.dtype for array in arrays.values()}
    return 8 if np.dtype(np.int8) in kinds else 16 if np.dtype(np.float16) in kinds else 32


def _rows(matrix: NDArray[np.float32]) -> tuple[NDArray[np.int8], NDArray[np.float32]]:
    """Return the integers of each row and the row's factor (rows, 1), rounded up to few bits."""
    fraction, exponent = np.frexp(np.abs(matrix).max(1, keepdims=True) / MAX_CODE)
    steps = np.float32(1 << _FACTOR_BITS)
    factors = np.ldexp(np.ceil(fraction * steps) / steps, exponent).astype(np.float32)
    factors[factors == 0] = 1
    return np.rint(matrix / factors).astype(np.int8), factors
