"""Step the games of one layout in several threads, so that the CPU cores keep up with a GPU.

With one thread it is the plain `VectorEnv`. Each thread has games of its own; results do not depend on timing, but the
number of threads decides which random stream a game gets.
"""

import itertools
import os
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overcooked.layout import Layout
from overcooked.vector_env import Finished, Starts, VectorEnv

_MAX_THREADS = 16


def threads_for(device: str) -> int:
    """Return how many threads step the games: one on the CPU, whose cores train other agents; all cores for a GPU."""
    return 1 if device == "cpu" else min(os.cpu_count() or 1, _MAX_THREADS)


def threaded_env(
    layout: Layout, games: int, starts: Starts | None, seed: int, threads: int
) -> "VectorEnv | ThreadedEnv":
    """Return an environment of `games` games on at most one thread per game."""
    threads = min(threads, games)
    if threads == 1:
        return VectorEnv(layout, games, starts=starts, seed=seed)
    return ThreadedEnv(layout, games, starts, seed, threads)


class ThreadedEnv:
    """The interface of `VectorEnv`, with the games divided over threads in ranges."""

    def __init__(self, layout: Layout, games: int, starts: Starts | None, seed: int, threads: int) -> None:
        edges = [games * k // threads for k in range(threads + 1)]
        self._ranges = [slice(first, last) for first, last in itertools.pairwise(edges)]
        seeds = np.random.SeedSequence(seed).generate_state(threads).tolist()
        self.parts = [
            VectorEnv(layout, games_here.stop - games_here.start, starts=starts, seed=own)
            for games_here, own in zip(self._ranges, seeds, strict=True)
        ]
        self.games, self.horizon = games, self.parts[0].horizon
        self.observation_shape = self.parts[0].observation_shape
        self._threads = ThreadPoolExecutor(threads, thread_name_prefix="engine")

    @property
    def events(self) -> NDArray[np.int32]:
        """(games, 2): of the last timestep."""
        return np.concatenate([part.events for part in self.parts])

    def step(
        self,
        actions: NDArray[np.integer[Any]],
        sparse: NDArray[Any],
        shaped: NDArray[Any],
        dones: NDArray[np.bool_],
        observations: NDArray[Any],
    ) -> None:
        """Play one timestep of every game, like `VectorEnv.step`."""

        def step(part: VectorEnv, here: slice) -> None:
            part.step(actions[here], sparse[here], shaped[here], dones[here], observations[here])

        list(self._threads.map(step, self.parts, self._ranges))

    def encode(self, observations: NDArray[Any]) -> None:
        """Encode the current states as the chefs see them: `observations` (games, 2, width, height, 26) out."""
        for part, here in zip(self.parts, self._ranges, strict=True):
            part.encode(observations[here])

    def state(self) -> dict[str, NDArray[Any]]:
        """Return everything that determines how the games continue, in the form of one `VectorEnv`: a stored run can
        continue with any number of threads."""
        states = [part.state() for part in self.parts]
        return {name: np.concatenate([state[name] for state in states]) for name in states[0]}

    def restore(self, state: dict[str, NDArray[Any]]) -> None:
        """Continue from a `state`, with this or another number of threads."""
        for part, here in zip(self.parts, self._ranges, strict=True):
            part.restore({name: array[here] for name, array in state.items()})

    def take_finished(self) -> Finished:
        """Return the episodes that ended since the last call."""
        finished = [part.take_finished() for part in self.parts]
        return Finished(*(np.concatenate(columns) for columns in zip(*finished, strict=True)))
