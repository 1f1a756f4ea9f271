"""The observations of a rollout, filled on the CPU and read on the device that learns; the actions drawn in it."""

import numpy as np
import torch
from numba import njit
from numpy.typing import NDArray
from torch import Tensor


class Entries:
    """(timesteps, rows, columns) int8. On the CPU there is one copy; for a GPU each timestep is sent once, from
    page-locked memory, and stays there for learning."""

    host: NDArray[np.int8]

    def __init__(self, shape: tuple[int, ...], device: str) -> None:
        self._host = torch.zeros(shape, dtype=torch.int8, pin_memory=device == "cuda")
        self.host = self._host.numpy()
        self._device = self._host if device == "cpu" else torch.zeros(shape, dtype=torch.int8, device=device)

    def on_device(self, timestep: int) -> Tensor:
        """Return one timestep's (rows, columns), where the network is."""
        here = self._device[timestep]
        if self._device is not self._host:
            here.copy_(self._host[timestep], non_blocking=True)
        return here

    def samples(self) -> Tensor:
        """Return all but the last timestep, (timesteps * rows, columns)."""
        return self._device[:-1].flatten(0, 1)


@njit(cache=True)
def gather(flat, rows, columns, out):  # type: ignore[no-untyped-def]
    """Copy some columns of some rows of all flat observations to `out`, (rows, columns)."""
    for i in range(len(rows)):
        for j in range(len(columns)):
            out[i, j] = flat[rows[i], columns[j]]


@njit(cache=True)
def draw(logits, uniform, rows, joint, actions, log_probabilities):  # type: ignore[no-untyped-def]
    """Draw an action a row by inverse transform and note its logarithm of probability."""
    for i in range(len(rows)):
        largest = logits[i].max()
        total = 0.0
        for a in range(logits.shape[1]):
            total += np.exp(logits[i, a] - largest)
        left = uniform[rows[i]] * total
        action = 0
        while action < logits.shape[1] - 1:
            left -= np.exp(logits[i, action] - largest)
            if left < 0:
                break
            action += 1
        joint[rows[i]] = action
        actions[i] = action
        log_probabilities[i] = logits[i, action] - largest - np.log(total)


def draw_only(
    logits: NDArray[np.float32], uniform: NDArray[np.float64], rows: NDArray[np.int64], joint: NDArray[np.int8]
) -> None:
    """Draw actions without noting them: the partners' are not learned from."""
    draw(logits, uniform, rows, joint, np.empty(len(rows), np.int64), np.empty(len(rows), np.float32))
