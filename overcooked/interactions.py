"""Interactions of a chef with a station: their kinds, and those that a kitchen allows."""

from enum import IntEnum
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from overcooked.constants import (
    COUNTER,
    DISH_DISPENSER,
    DISH_DROP,
    DISH_PICKUP,
    EXIT,
    FLOOR,
    ONION_DISPENSER,
    ONION_DROP,
    ONION_PICKUP,
    POT,
    POTTING_ONION,
    SOUP_DELIVERY,
    SOUP_DROP,
    SOUP_FROM_POT,
    SOUP_PICKUP,
    STEP_X,
    STEP_Y,
)
from overcooked.layout import Layout


class InteractionKind(IntEnum):
    """What one use of a station does. Its lower-case name is used in data, messages and study files."""

    NONE = 0
    TAKE_ONION = 1  # from the crate or a counter
    TAKE_DISH = 2  # from the rack or a counter
    TAKE_SOUP = 3  # from a counter
    FILL = 4  # an onion into a pot
    PLATE = 5  # a soup out of a pot onto the dish in hand
    SERVE = 6
    PUT_DOWN = 7  # anything, on a counter


class PossibleInteraction(NamedTuple):
    """One kind of interaction at one cell; NONE is at (-1, -1)."""

    kind: InteractionKind
    x: int
    y: int


NO_INTERACTION: Final = PossibleInteraction(InteractionKind.NONE, -1, -1)

_KINDS_AT: Final = {
    COUNTER: (
        InteractionKind.TAKE_ONION,
        InteractionKind.TAKE_DISH,
        InteractionKind.TAKE_SOUP,
        InteractionKind.PUT_DOWN,
    ),
    ONION_DISPENSER: (InteractionKind.TAKE_ONION,),
    DISH_DISPENSER: (InteractionKind.TAKE_DISH,),
    POT: (InteractionKind.FILL, InteractionKind.PLATE),
    EXIT: (InteractionKind.SERVE,),
}
# The first match counts: a soup lifted from a pot is also a soup pickup.
_KIND_OF_EVENT: Final = (
    (SOUP_FROM_POT, InteractionKind.PLATE),
    (SOUP_DELIVERY, InteractionKind.SERVE),
    (POTTING_ONION, InteractionKind.FILL),
    (ONION_PICKUP, InteractionKind.TAKE_ONION),
    (DISH_PICKUP, InteractionKind.TAKE_DISH),
    (SOUP_PICKUP, InteractionKind.TAKE_SOUP),
    (ONION_DROP | DISH_DROP | SOUP_DROP, InteractionKind.PUT_DOWN),
)


def possible_interactions(layout: Layout) -> tuple[PossibleInteraction, ...]:
    """Return every interaction that the kitchen allows: NO_INTERACTION first, then by kind, x, y.

    Only cells next to a floor cell count. The place in this list is the class that a predictor of intentions learns.
    """
    cells = [(int(x), int(y)) for x, y in np.argwhere(layout.tiles != FLOOR) if _next_to_floor(layout.tiles, x, y)]
    found = [PossibleInteraction(kind, x, y) for x, y in cells for kind in _KINDS_AT[int(layout.tiles[x, y])]]
    return (NO_INTERACTION, *sorted(found))


def interaction_kind(events: int) -> InteractionKind:
    """Return the kind of interaction that one chef's events of one timestep (bits, see `overcooked.constants`) amount
    to."""
    return next((kind for bits, kind in _KIND_OF_EVENT if events & bits), InteractionKind.NONE)


def _next_to_floor(tiles: NDArray[np.int8], x: int, y: int) -> bool:
    around = ((x + dx, y + dy) for dx, dy in zip(STEP_X, STEP_Y, strict=True))
    return any(0 <= cx < tiles.shape[0] and 0 <= cy < tiles.shape[1] and tiles[cx, cy] == FLOOR for cx, cy in around)
