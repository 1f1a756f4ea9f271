"""Somebody else's predictor: the agent will go on as it did last, surely at first and less so with every step.

PYTHONPATH=docs/examples kitchenmind agent check own_predictor:LastAction --predictor --layout coordination_ring
"""

import numpy as np

STEPS, ACTIONS, STAY = 3, 6, 4


class LastAction:
    """Made with the layout; keeps nothing about a game, so there is nothing to forget."""

    def __init__(self, layout: object) -> None:
        self.layout = layout

    def begin(self, slots: np.ndarray) -> None:
        """The games in these slots begin."""

    def predict(self, slots: np.ndarray, observations: np.ndarray, last_actions: np.ndarray) -> np.ndarray:  # noqa: ARG002
        """Probabilities (games, 3, 6) of the agent's next actions, from the joint actions (games, 2) that led here."""
        last = np.where(last_actions[:, 0] < 0, STAY, last_actions[:, 0])  # -1: the game has just begun
        answer = np.zeros((len(slots), STEPS, ACTIONS), np.float32)
        for step, sure in enumerate((0.6, 0.5, 0.4)):
            answer[:, step] = (1 - sure) / ACTIONS
            answer[np.arange(len(slots)), step, last] += sure
        return answer
