"""How many bits a checkpoint's numbers have on disk, and what comes back."""

import numpy as np
import pytest

from models.networks.stored_tensors import FACTOR, bits_of, restored, stored


def _matrix() -> np.ndarray:
    """Rows of very different size, one of them empty."""
    rows = np.random.default_rng(0).normal(size=(64, 128)).astype(np.float32)
    return rows * np.float32(10.0) ** np.arange(-40, 24)[:, None] * (np.arange(64) != 5)[:, None]


def test_eight_bits_round_each_weight_to_at_most_half_a_step_of_its_row() -> None:
    matrix = _matrix()[8:]  # the rows before are smaller than float32 can divide
    found = restored(stored({"w": matrix}, 8))["w"]
    assert found.dtype == np.float32
    step = np.abs(matrix).max(1, keepdims=True) / 127
    assert (np.abs(found - matrix) <= 0.501 * step).all()


def test_what_was_stored_with_eight_bits_stays_the_same_when_it_is_stored_again() -> None:
    once = stored({"w": _matrix()}, 8)
    again = stored(restored(once), 8)
    assert {name: array.tobytes() for name, array in once.items()} == {
        name: array.tobytes() for name, array in again.items()
    }


def test_small_tensors_and_integers_are_not_rounded_to_eight_bits() -> None:
    arrays = {"bias": np.linspace(0, 1, 4096, dtype=np.float32), "small": np.ones((63, 65)), "count": np.arange(5)}
    kept = stored(arrays, 8)
    assert {name: array.dtype.name for name, array in kept.items()} == {
        "bias": "float16",
        "small": "float16",
        "count": "int64",
    }
    assert restored(kept)["count"].tolist() == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("bits", [8, 16, 32])
def test_the_bits_are_known_from_the_arrays(bits: int) -> None:
    matrix = _matrix()[36:44]
    assert bits_of(stored({"w": matrix.repeat(8, 0), "bias": np.ones(3, np.float32)}, bits)) == bits


def test_a_matrix_without_the_factors_of_its_rows_is_refused() -> None:
    kept = stored({"w": _matrix()}, 8)
    del kept[f"w{FACTOR}"]
    with pytest.raises(ValueError, match="w: the factors of its rows are missing"):
        restored(kept)
