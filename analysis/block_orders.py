"""Weights of means by order and level, where some orders in which people met blocks are missing.

With all rows of a balanced Latin square, every order counts the same, and what a block adds to each level cancels.
Where an order is lost, what the blocks add, such as practice, would count as an effect of the levels that are then left
earlier or later. Levels are then estimated next to effects of the blocks and of people: with equal orders, these are
the estimates of least squares.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Order = tuple[tuple[str, ...], ...]  # combinations of levels, as their blocks came
NEAR = 1e-9
ADJUSTED = "levels adjusted for the block"  # in the note of a test
WHY = "as some orders of the blocks are missing"


def is_balanced(orders: Sequence[Order]) -> bool:
    """Return whether every combination has the same average block over the orders, or these are unknown."""
    if not all(orders):
        return True
    places = np.array([[order.index(levels) for levels in orders[0]] for order in orders])
    return len(set(places.sum(axis=0).tolist())) == 1


def by_order(weights: Array, inner: Sequence[tuple[str, ...]], orders: Sequence[Order]) -> Array | None:
    """Return weights of means, (orders, combinations), that add up to `weights` (combinations, in the order of `inner`)
    and to the same in each order; unless the orders are balanced, also to the same in each block. None where blocks and
    combinations cannot be told apart."""
    count, size = len(orders), len(inner)
    equal = np.tile(weights / count, (count, 1))
    if is_balanced(orders):
        return equal
    cells = np.arange(count * size).reshape(count, size)  # a column for each mean
    block = np.array([[order.index(levels) for levels in inner] for order in orders])
    sums = [cells[:, level] for level in range(size)] + list(cells)
    sums += [cells[block == place] for place in range(size)]
    system = np.zeros((len(sums), count * size))
    for row, chosen in enumerate(sums):
        system[row, chosen] = 1.0
    wanted = np.concatenate([weights, np.full(count, weights.sum() / count), np.full(size, weights.mean())])
    found = np.linalg.lstsq(system, wanted)[0]  # the shortest: the smallest error
    is_solution = np.abs(system @ found - wanted).max() <= NEAR * max(1.0, float(np.abs(weights).max()))
    return found.reshape(count, size) if is_solution else None


def can_separate(inner: Sequence[tuple[str, ...]], orders: Sequence[Order]) -> bool:
    """Return whether the differences between all combinations can be told apart from what the blocks add."""
    differences = np.eye(len(inner)) - 1 / len(inner)
    return all(by_order(weights, inner, orders) is not None for weights in differences)
