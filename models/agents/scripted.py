"""Simple scripted agents: `random`, `stay`, and the tutorial's `guide`, whose next actions are easy to predict."""

import numpy as np
from numpy.typing import NDArray

from models.agents.observation_parser import Cell, ParsedObservation, certain, parse_observation
from models.protocols import INTENTION, INTENTIONS, STEPS, Intentions, Mode, Observations, Predictions, Probabilities
from overcooked.constants import ACTIONS, STAY, STEP_X, STEP_Y
from overcooked.interactions import NO_INTERACTION

PLAIN = Mode(temperature=1.0, stuck_after=1, stuck_mix=0.0)
SURE = Mode(temperature=0.0, stuck_after=1, stuck_mix=0.0)

_NORTH, _SOUTH = 0, 1


class UniformPolicy:
    """Draw every action with equal probability."""

    def probabilities(self, observations: Observations) -> Probabilities:
        return np.full((len(observations), ACTIONS), 1 / ACTIONS, np.float32)


class StayPolicy:
    """Wait in every timestep."""

    def probabilities(self, observations: Observations) -> Probabilities:
        return np.tile(certain(STAY), (len(observations), 1))


class GuidePolicy:
    """Pace up and down a column: straight on while the next cell is free, otherwise turn round. It uses no station. It
    decides by the current state alone, so its next steps can be predicted. A cell that the other chef faces counts as
    blocked: two chefs that keep walking into the same cell would both stand still.
    """

    def probabilities(self, observations: Observations) -> Probabilities:
        return np.stack([certain(_pace(*_where(parse_observation(planes)))) for planes in observations])


class GuidePredictor:
    """Predict the guide only."""

    memory = 1

    def begin(self, slots: NDArray[np.intp]) -> None:
        """Do nothing: this predictor keeps no state."""

    def predict(
        self,
        slots: NDArray[np.intp],  # noqa: ARG002 - a single state is enough
        observations: Observations,
        last_actions: NDArray[np.int8],  # noqa: ARG002
    ) -> Predictions:
        return guide_ahead(observations)

    def intentions(
        self,
        slots: NDArray[np.intp],
        observations: Observations,  # noqa: ARG002
        last_actions: NDArray[np.int8],  # noqa: ARG002
    ) -> Intentions:
        """Return that the guide uses no station, nearly certainly."""
        answer = np.zeros((len(slots), INTENTIONS), INTENTION)
        answer[:, 0] = (*NO_INTERACTION, 0, 0.99)
        return answer


def guide_ahead(observations: Observations) -> Predictions:
    """Return the guide's next actions if the other chef stands still: (games, STEPS, 6), nearly certain."""
    action_distributions = np.full((len(observations), STEPS, ACTIONS), 0.01 / (ACTIONS - 1), np.float32)
    for game, planes in enumerate(observations):
        seen = parse_observation(planes)
        me, facing, is_free = _where(seen)
        for step in range(STEPS):
            action = _pace(me, facing, is_free)
            action_distributions[game, step, action] = 0.99
            if action < STAY:
                ahead = (me[0] + STEP_X[action], me[1] + STEP_Y[action])
                me, facing = (ahead if is_free[ahead] else me), action
    return action_distributions


def _where(seen: ParsedObservation) -> tuple[Cell, int, np.ndarray[tuple[int, int], np.dtype[np.bool_]]]:
    is_free = seen.floor.copy()
    is_free[seen.other] = is_free[seen.other_ahead] = False
    return seen.me, seen.facing, is_free.reshape(is_free.shape[0], is_free.shape[1])


def _pace(me: Cell, facing: int, is_free: np.ndarray[tuple[int, int], np.dtype[np.bool_]]) -> int:
    """Continue in the facing direction, otherwise turn back, otherwise wait."""
    direction = facing if facing in (_NORTH, _SOUTH) else _NORTH
    for way in (direction, 1 - direction):
        if is_free[me[0], me[1] + STEP_Y[way]]:
            return way
    return STAY
