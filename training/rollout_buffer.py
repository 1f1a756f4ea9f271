"""The observations of a rollout, filled on the CPU and read on the device that learns."""

import numpy as np
import torch
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
        """One timestep's (rows, columns), where the network is."""
        here = self._device[timestep]
        if self._device is not self._host:
            here.copy_(self._host[timestep], non_blocking=True)
        return here

    def samples(self) -> Tensor:
        """All but the last timestep, (timesteps * rows, columns)."""
        return self._device[:-1].flatten(0, 1)
