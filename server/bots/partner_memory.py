"""Where a participant with limited sight takes the partner to be, from nothing but what the page was sent.

The server keeps pots and counters out of view as the participant last saw them, and sends no place for a partner out of
view. A person still has one in mind: where the partner was last, or else somewhere out of view.
"""

import numpy as np
from numpy.typing import NDArray

from overcooked.constants import FACING, HELD, NORTH, NOTHING, PLAYERS
from overcooked.layout import Layout
from overcooked.state import Kitchens


class PartnerMemory:
    """The partner as one participant remembers it in one game."""

    def __init__(self, layout: Layout, seat: int, radius: int) -> None:
        self._seat, self._other, self._radius = seat, PLAYERS - 1 - seat, radius
        self._floor: NDArray[np.intp] = np.argwhere(layout.tiles == 0)  # column and row of each cell
        self._last: NDArray[np.int8] | None = None  # place, facing and hand when it was last seen

    def complete(self, seen: Kitchens, partner_seen: bool) -> Kitchens:
        """Return the kitchen as the participant has it in mind."""
        if partner_seen:
            self._last = seen.players[0, self._other].copy()
            return seen
        own = seen.players[0, self._seat, :FACING].astype(np.intp)
        hidden = self._floor[np.abs(self._floor - own).max(axis=1) > self._radius]
        if not len(hidden):
            return seen
        last = own if self._last is None else self._last[:FACING].astype(np.intp)
        nearest = hidden[np.abs(hidden - last).sum(axis=1).argmin()]
        mind = seen.copy()
        mind.players[0, self._other, :FACING] = nearest
        facing, held = (NORTH, NOTHING) if self._last is None else self._last[FACING : HELD + 1]
        mind.players[0, self._other, FACING], mind.players[0, self._other, HELD] = facing, held
        return mind
