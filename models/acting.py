"""Turn an agent's probabilities into actions, in collected data, evaluation and the live game. Numpy only."""

import numpy as np
from numpy.typing import NDArray

from models.protocols import Mode, Probabilities
from overcooked.constants import ACTIONS, STAY

GREEDY = Mode(temperature=0.0, stuck_mix=0.0)
SAMPLED = Mode(temperature=1.0, stuck_mix=0.0)


def distribution(probabilities: Probabilities, stuck: NDArray[np.integer], mode: Mode) -> Probabilities:
    """Return action distributions (games, 6). `stuck` (games,) as `Stuck` counts it; rules in `Mode`."""
    if mode.temperature > 0:
        logs = np.log(np.maximum(probabilities, 1e-30)) / mode.temperature
        action_distribution = np.exp(logs - logs.max(axis=1, keepdims=True))
        action_distribution /= action_distribution.sum(axis=1, keepdims=True)
    else:
        action_distribution = np.zeros_like(probabilities)
        action_distribution[np.arange(len(action_distribution)), probabilities.argmax(axis=1)] = 1
    jammed = stuck >= mode.stuck_after
    if mode.stuck_mix > 0 and jammed.any():
        moves = np.zeros(ACTIONS)
        moves[:STAY] = mode.stuck_mix / STAY  # the four moves are the actions below STAY
        action_distribution[jammed] = (1 - mode.stuck_mix) * action_distribution[jammed] + moves
    return np.asarray(action_distribution, np.float32)


def draw(action_distribution: Probabilities, uniform: NDArray[np.floating]) -> NDArray[np.int8]:
    """Return actions (games,) drawn by inverse transform of `uniform` (games,) in [0, 1): the same number gives the
    same action."""
    reached = np.cumsum(action_distribution, axis=1, dtype=np.float64)
    # rounding must not leave the last action out
    threshold = np.asarray(uniform, np.float64)[:, None] * reached[:, -1:]
    return np.asarray((reached <= threshold).sum(axis=1), np.int8)


class Stuck:
    """Count, per game, the timesteps since a chef's own cell, facing or hand last changed."""

    def __init__(self, own: NDArray[np.int8]) -> None:
        """`own` (games, 4): the chef's rows of the state (x, y, facing, held) at the start."""
        self.counts = np.zeros(len(own), np.int32)
        self._own = own.copy()

    def update(self, own: NDArray[np.int8]) -> None:
        """Count one timestep; `own` (games, 4) is the state after it."""
        changed = (own != self._own).any(axis=1)
        self.counts += 1
        self.counts[changed] = 0
        self._own[:] = own

    def begin(self, games: NDArray[np.integer] | NDArray[np.bool_], own: NDArray[np.int8]) -> None:
        """Restart the count of these games; `own` (all games, 4)."""
        self.counts[games] = 0
        self._own[games] = own[games]
