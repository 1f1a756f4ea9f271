"""Decode an observation into chefs, items and stations, for scripted agents. The inverse of `overcooked.observe`; a
test compares the two.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overcooked.constants import ACTIONS, DISH, NOTHING, ONION, SOUP, STEP_X, STEP_Y

Cell = tuple[int, int]

# Places in the encoding, as the engine's `observe` writes them.
_ME, _OTHER, _MY_FACING, _OTHER_FACING = 0, 1, 2, 6
_POT, _COUNTER, _ONION_DISPENSER, _DISH_DISPENSER, _EXIT = 10, 11, 12, 14, 15
_ONIONS_IN_POT, _ONIONS_IN_SOUP, _COOKING_LEFT, _READY, _DISH, _ONION = 16, 18, 20, 21, 22, 23


@dataclass(frozen=True)
class Pot:
    """A pot's state: raw onions in it, or the timesteps until its soup is ready (0: ready), or empty."""

    cell: Cell
    onions: int
    left: int | None


@dataclass(frozen=True)
class ParsedObservation:
    """One chef's decoded observation."""

    me: Cell
    facing: int
    held: int
    other: Cell
    other_held: int
    other_ahead: Cell  # the cell that the other chef faces, and enters next if it keeps walking
    floor: NDArray[np.bool_]  # (width, height)
    pots: tuple[Pot, ...]
    items: dict[Cell, int]  # items on counters
    free_counters: tuple[Cell, ...]
    onions: tuple[Cell, ...]  # dispensers
    dishes: tuple[Cell, ...]
    exits: tuple[Cell, ...]


def parse_observation(planes: NDArray[np.int8]) -> ParsedObservation:
    """Read one observation (width, height, 26)."""
    me, other = _cells(planes[..., _ME])[0], _cells(planes[..., _OTHER])[0]
    turned = int(planes[other][_OTHER_FACING : _OTHER_FACING + 4].argmax())
    counters = _cells(planes[..., _COUNTER])
    items = {cell: item for cell in counters if (item := _item(planes[cell])) != NOTHING}
    return ParsedObservation(
        me=me,
        facing=int(planes[me][_MY_FACING : _MY_FACING + 4].argmax()),
        held=_item(planes[me]),
        other=other,
        other_held=_item(planes[other]),
        other_ahead=(other[0] + int(STEP_X[turned]), other[1] + int(STEP_Y[turned])),
        floor=np.asarray(~planes[..., _POT : _EXIT + 1].any(axis=-1)),
        pots=tuple(_pot(planes, cell) for cell in _cells(planes[..., _POT])),
        items=items,
        free_counters=tuple(cell for cell in counters if cell not in items),
        onions=_cells(planes[..., _ONION_DISPENSER]),
        dishes=_cells(planes[..., _DISH_DISPENSER]),
        exits=_cells(planes[..., _EXIT]),
    )


@dataclass(frozen=True)
class Walk:
    """A path to a station: the station's cell, the steps until the chef stands next to it, and the first action."""

    cell: Cell
    steps: int
    action: int


def distances(floor: NDArray[np.bool_], start: Cell, blocked: Cell | None) -> dict[Cell, tuple[int, int]]:
    """Return cell -> (steps, first direction) for every reachable cell; the start itself has (0, -1)."""
    reached = {start: (0, -1)}
    queue = deque([start])
    while queue:
        cell = queue.popleft()
        steps, first = reached[cell]
        for direction in range(4):
            to = (cell[0] + STEP_X[direction], cell[1] + STEP_Y[direction])
            if floor[to] and to != blocked and to not in reached:
                reached[to] = (steps + 1, direction if first < 0 else first)
                queue.append(to)
    return reached


def certain(action: int) -> NDArray[np.float32]:
    """Return probabilities (6,) of a deterministic action."""
    action_distribution = np.zeros(ACTIONS, np.float32)
    action_distribution[action] = 1
    return action_distribution


def _cells(plane: NDArray[np.int8]) -> tuple[Cell, ...]:
    return tuple((int(x), int(y)) for x, y in np.argwhere(plane))


def _item(entries: NDArray[np.int8]) -> int:
    if entries[_ONION]:
        return ONION
    if entries[_DISH]:
        return DISH
    return SOUP if entries[_READY] else NOTHING


def _pot(planes: NDArray[np.int8], cell: Cell) -> Pot:
    cooking = planes[cell][_ONIONS_IN_SOUP] > 0
    return Pot(cell, int(planes[cell][_ONIONS_IN_POT]), int(planes[cell][_COOKING_LEFT]) if cooking else None)
