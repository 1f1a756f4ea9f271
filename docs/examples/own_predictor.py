"""A predictor from outside the project: it predicts the last action again, with less confidence at every step.

PYTHONPATH=docs/examples kitchenmind agent check own_predictor:LastAction --predictor --layout coordination_ring
"""

import numpy as np

STEPS, ACTIONS, STAY = 3, 6, 4


class LastAction:
    """Repeat the agent's last action. It has no state, so `begin` has nothing to reset."""

    def __init__(self, layout: object) -> None:
        self.layout = layout

    def begin(self, slots: np.ndarray) -> None:
        """Start new games in these slots."""

    def predict(self, slots: np.ndarray, observations: np.ndarray, last_actions: np.ndarray) -> np.ndarray:  # noqa: ARG002
        """Return probabilities (games, 3, 6) of the next actions, from the last joint actions (games, 2)."""
        last = np.where(last_actions[:, 0] < 0, STAY, last_actions[:, 0])  # -1: the game has just begun
        answer = np.zeros((len(slots), STEPS, ACTIONS), np.float32)
        for step, sure in enumerate((0.6, 0.5, 0.4)):
            answer[:, step] = (1 - sure) / ACTIONS
            answer[np.arange(len(slots)), step, last] += sure
        return answer
