"""What a worker answers as arrays, one entry a row: made once, packed into an `Answer` and read out of it again."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from models.inference.wire import Answer, ModelFault
from models.protocols import INTENTION, INTENTIONS, STEPS, Intentions, Predictions, Probabilities
from overcooked.constants import ACTIONS


@dataclass(frozen=True)
class AnswerArrays:
    """The fields of an `Answer` that have a row each."""

    acted: NDArray[np.int8]
    action_distributions: Probabilities
    predicted: NDArray[np.int8]
    predictions: Predictions
    intentions: Intentions

    @classmethod
    def unanswered(cls, rows: int) -> Self:
        """Return arrays to be filled in, in which nothing is answered."""
        return cls(
            np.full(rows, -1, np.int8),
            np.zeros((rows, ACTIONS), np.float32),
            np.zeros(rows, np.int8),
            np.zeros((rows, STEPS, ACTIONS), np.float32),
            np.zeros((rows, INTENTIONS), INTENTION),
        )

    @classmethod
    def read(cls, answer: Answer) -> Self:
        """Return the arrays of an answer."""
        like = vars(cls.unanswered(0))
        return cls(**{name: _read(getattr(answer, name), empty) for name, empty in like.items()})

    def rows(self, some: slice) -> Self:
        """Return some of the rows."""
        return type(self)(**{name: array[some] for name, array in vars(self).items()})

    def packed(self, number: int, model_ms: float, faults: list[ModelFault]) -> Answer:
        """Return the answer to question `number`."""
        return Answer(number, model_ms, faults=faults, **{name: array.tobytes() for name, array in vars(self).items()})


def _read(content: bytes, empty: NDArray[Any]) -> NDArray[Any]:
    return np.frombuffer(content, empty.dtype).reshape(-1, *empty.shape[1:])
