"""Check what an agent or a predictor returned before it is used: shape, finite, and rows that sum to 1."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from models.protocols import (
    INTENTION,
    INTENTION_HORIZON,
    INTENTIONS,
    STEPS,
    Intentions,
    Observations,
    Predictions,
    Predictor,
    Probabilities,
)
from overcooked.constants import ACTIONS
from overcooked.interactions import InteractionKind

ROWS_SUM_TO_ONE: Final = 1e-2  # within this
_LAST_KIND: Final = max(InteractionKind)


class WrongOutput(ValueError):
    """A model's output is not probabilities of the right shape."""


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


def usable_rows(given: Probabilities, shape: tuple[int, ...]) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return a model's output of this shape and which games (the first dimension) have probabilities; the others get
    equal ones. Raises WrongOutput for another shape or if no game has any."""
    given = np.asarray(given, np.float32)
    if given.shape != shape:
        raise WrongOutput(f"gave an array of shape {given.shape}, wanted {shape}")
    inner = tuple(range(1, given.ndim))
    sums = given.sum(axis=-1).reshape(len(given), -1)
    usable = np.isfinite(given).all(inner) & (given >= 0).all(inner) & (np.abs(sums - 1) <= ROWS_SUM_TO_ONE).all(1)
    if not usable.any():
        _checked_rows(given)
    if not usable.all():
        given = given.copy()
        given[~usable] = 1 / given.shape[-1]
    return given, usable


def checked_intentions(
    predictor: Predictor, slots: NDArray[np.intp], observations: Observations, last_actions: NDArray[np.int8]
) -> Intentions:
    """Return the intentions (games, 2) that a predictor gives after `predict`; if it has none, all have probability 0.
    Raises WrongOutput."""
    wanted = (len(slots), INTENTIONS)
    say = getattr(predictor, "intentions", None)  # `isinstance` with a protocol takes 50 us, in every batch
    if say is None:
        return np.zeros(wanted, INTENTION)
    given = np.asarray(say(slots, observations, last_actions))
    if given.shape != wanted or given.dtype != INTENTION:
        raise WrongOutput(f"gave intentions of shape {given.shape} and type {given.dtype}, wanted {wanted} {INTENTION}")
    probability = given["probability"]
    if not ((probability >= 0) & (probability <= 1)).all():
        raise WrongOutput("gave an intention whose probability is not between 0 and 1")
    width, height = observations.shape[1:3]
    at_station = (given["x"] >= 0) & (given["x"] < width) & (given["y"] >= 0) & (given["y"] < height)
    soon = (given["steps"] >= 1) & (given["steps"] <= INTENTION_HORIZON)
    known = (given["kind"] > InteractionKind.NONE) & (given["kind"] <= _LAST_KIND) & at_station & soon
    if not (known | (given["kind"] == InteractionKind.NONE)).all():
        raise WrongOutput(f"gave an intention of an unknown kind, beyond the kitchen or not in 1-{INTENTION_HORIZON}")
    return given


def _checked_rows(given: NDArray[np.float32]) -> NDArray[np.float32]:
    if not np.isfinite(given).all() or (given < 0).any():
        raise WrongOutput("gave NaN, infinite or negative probabilities")
    if (np.abs(given.sum(axis=-1) - 1) > ROWS_SUM_TO_ONE).any():
        raise WrongOutput("gave probabilities that do not sum to 1")
    return given
