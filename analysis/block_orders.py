"""Weights of the orders in which people met blocks, so that no level comes earlier than another on average.

With all rows of a balanced Latin square, every order counts the same. Where an order is lost, equal weights would count
a steady change over the blocks, such as practice, as an effect of the levels that are then left earlier or later. The
orders that are there are weighted instead, as equally as that allows.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

Array = NDArray[np.float64]
Order = tuple[tuple[str, ...], ...]  # combinations of levels, as their blocks came
NEAR = 1e-8
WEIGHTED = "orders of the blocks weighted"  # in the note of a test
WHY = "so that no level comes earlier than others on average"  # after that, in a sentence


def order_weights(orders: Sequence[Order]) -> Array | None:
    """Return weights of the orders, at least 0 with sum 1, under which every combination has the same average place:
    those nearest to equal ones. None where there are no such weights."""
    equal = np.full(len(orders), 1 / len(orders))
    if not all(orders):  # unknown
        return equal
    places = np.array([[order.index(levels) for levels in sorted(orders[0])] for order in orders], dtype=np.float64)
    apart = (places - places.mean(axis=1, keepdims=True)).T  # (combinations, orders)
    if np.abs(apart @ equal).max() < NEAR:
        return equal
    wanted = np.concatenate([np.zeros(len(apart)), np.ones(1)])
    return _nearest(np.concatenate([apart, np.ones((1, len(orders)))]), wanted, equal)


def _nearest(system: Array, wanted: Array, start: Array) -> Array | None:
    """Return the x at least 0 with system @ x = wanted that is nearest to `start`; None if there is none.

    The conditions weigh a million times as much as the distance; what is left of their error is then taken away among
    the entries above 0."""
    found = optimize.nnls(np.concatenate([1e6 * system, np.eye(len(start))]), np.concatenate([1e6 * wanted, start]))[0]
    kept = found > NEAR
    exact = np.zeros(len(start))
    exact[kept] = found[kept] + np.linalg.lstsq(system[:, kept], wanted - system[:, kept] @ found[kept])[0]
    is_solution = np.abs(system @ exact - wanted).max() < NEAR and exact.min() >= 0
    return exact if is_solution else None
