"""Where a participant with limited sight believes the partner to be, from the messages to the page alone. The server
sends pots and counters out of view as the participant last saw them, and no position of a partner out of view. The
belief is the partner's last seen position, or otherwise a cell out of view.
"""

import numpy as np
from numpy.typing import NDArray

from overcooked.constants import FACING, HELD, NORTH, NOTHING, PLAYERS
from overcooked.layout import Layout
from overcooked.state import Kitchens


class PartnerMemory:
    """One participant's memory of the partner in one game."""

    def __init__(self, layout: Layout, seat: int, radius: int) -> None:
        self._seat, self._other, self._radius = seat, PLAYERS - 1 - seat, radius
        self._floor: NDArray[np.intp] = np.argwhere(layout.tiles == 0)  # column and row of each cell
        self._last: NDArray[np.int8] | None = None  # place, facing and hand when it was last seen

    def complete(self, seen: Kitchens, partner_seen: bool) -> Kitchens:
        """Return the kitchen as the participant believes it to be."""
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
