"""The cells to which a chef's next actions lead, as the page draws them."""

from collections.abc import Iterable

from overcooked.constants import FLOOR, STAY, STEP_X, STEP_Y
from overcooked.layout import Layout

Cell = tuple[int, int]


def walked(layout: Layout, start: Cell, other: Cell, actions: Iterable[int]) -> list[Cell]:
    """Return where the chef stands after each action. The other chef blocks the way where it stands now."""
    x, y = start
    path = []
    for action in actions:
        if action < STAY:
            there = (x + int(STEP_X[action]), y + int(STEP_Y[action]))
            if layout.tiles[there] == FLOOR and there != other:
                x, y = there
        path.append((x, y))
    return path
