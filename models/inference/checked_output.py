"""Check what an agent or a predictor returned before it is used: shape, finite, and rows that sum to 1."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from models.protocols import STEPS, Predictions, Probabilities
from overcooked.constants import ACTIONS

ROWS_SUM_TO_ONE: Final = 1e-2  # within this


class WrongOutput(ValueError):
    """A model gave something that is not probabilities of the right shape."""


def checked_probabilities(probabilities: Probabilities, rows: int) -> Probabilities:
    """Return the action probabilities (rows, 6) of an agent. Raises WrongOutput."""
    given = np.asarray(probabilities, np.float32)
    if given.shape != (rows, ACTIONS):
        raise WrongOutput(f"gave an array of shape {given.shape}, wanted {(rows, ACTIONS)}")
    return _checked_rows(given)


def checked_predictions(predictions: Predictions, rows: int) -> Predictions:
    """Return the predicted probabilities (rows, 3, 6) of a predictor. Raises WrongOutput."""
    given = np.asarray(predictions, np.float32)
    if given.shape != (rows, STEPS, ACTIONS):
        raise WrongOutput(f"gave an array of shape {given.shape}, wanted {(rows, STEPS, ACTIONS)}")
    return _checked_rows(given)


def _checked_rows(given: NDArray[np.float32]) -> NDArray[np.float32]:
    if not np.isfinite(given).all() or (given < 0).any():
        raise WrongOutput("gave NaN, infinite or negative probabilities")
    if (np.abs(given.sum(axis=-1) - 1) > ROWS_SUM_TO_ONE).any():
        raise WrongOutput("gave probabilities that do not sum to 1")
    return given
