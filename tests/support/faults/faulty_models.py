"""Faulty agents, loaded by module and class as a researcher's own would be; well while they are tried."""

import os
import time

import numpy as np

from overcooked.constants import ACTIONS

_TRIALS = 2  # calls before the games begin


class Slow:
    """Half a second for every answer."""

    def __init__(self, layout: object) -> None:
        self.calls = 0

    def probabilities(self, observations: np.ndarray) -> np.ndarray:
        self.calls += 1
        if self.calls > _TRIALS:
            time.sleep(0.5)
        return np.full((len(observations), ACTIONS), 1 / ACTIONS, np.float32)


class SometimesNothing(Slow):
    """NaN, the wrong shape, an exception, and in between an answer."""

    def probabilities(self, observations: np.ndarray) -> np.ndarray:
        self.calls += 1
        answer = np.full((len(observations), ACTIONS), 1 / ACTIONS, np.float32)
        match self.calls % 4 if self.calls > _TRIALS else 0:
            case 1:
                return answer * np.nan
            case 2:
                return answer[:, :3]
            case 3:
                raise MemoryError("pretends to have none")
        return answer


class Dying(Slow):
    """Takes its whole process along now and then."""

    def probabilities(self, observations: np.ndarray) -> np.ndarray:
        self.calls += 1
        if self.calls == _TRIALS + 12:
            os._exit(1)
        return np.full((len(observations), ACTIONS), 1 / ACTIONS, np.float32)
