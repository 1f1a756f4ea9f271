"""Call somebody else's model in a worker: what it raises becomes a fault, and only that model rests after repeated
ones.
"""

import numpy as np
from numpy.typing import NDArray

from models.inference.circuit_breaker import Breaker
from models.inference.wire import ModelFault, Name


class WatchedCall:
    """Guard one call of a model: an exception becomes a fault and counts for its circuit breaker."""

    def __init__(self, name: Name, breaker: Breaker, faults: list[ModelFault]) -> None:
        self._name, self._breaker, self._faults = name, breaker, faults

    def __enter__(self) -> bool:
        """Return whether the model is to be asked."""
        self._asked = self._breaker.closed
        return self._asked

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: object) -> bool:
        if not self._asked:
            self._faults.append(ModelFault("/".join(self._name), "resting after repeated faults"))
        elif error is None:
            self._breaker.worked()
        elif isinstance(error, Exception):
            self._breaker.failed()
            self._faults.append(ModelFault("/".join(self._name), f"{type(error).__name__}: {error}"))
        return isinstance(error, Exception)


def some_unusable(name: Name, usable: NDArray[np.bool_]) -> list[ModelFault]:
    """Return the fault of a model whose answer is unusable for some of its games."""
    return [] if usable.all() else [ModelFault("/".join(name), "WrongOutput: not probabilities in some of its games")]
