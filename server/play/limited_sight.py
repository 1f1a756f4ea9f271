"""Limited sight: the part of the kitchen that one person sees now, and what was last seen of the rest.

A person sees the cells at most `radius` columns and `radius` rows from their own chef (Chebyshev distance). Walls and
stations are known from the start; what is in pots and on counters is known once it was in view, and stays as last seen.
The other chef is seen in view only. Agents always see the whole kitchen.
"""

from collections.abc import Sequence
from itertools import accumulate
from operator import and_

from msgspec import structs

from overcooked.constants import NORTH, NOTHING
from overcooked.layout import Layout
from server.play.marks import NOTHING_SHOWN, Displayed
from server.play.messages import KitchenState
from server.play.walked_path import Cell, walked


class Sight:
    """What one person sees and remembers."""

    def __init__(self, layout: Layout, seat: int, radius: int) -> None:
        self._layout, self._seat, self._radius = layout, seat, radius
        self._pots: list[Cell] = [(x, y) for x, y in layout.pots.tolist()]
        self._counters: list[Cell] = [(x, y) for x, y in layout.counters.tolist()]
        self._seen: dict[Cell, tuple[int, ...] | None] = {}  # contents as last seen; None: it was empty
        self._own: Cell = (0, 0)

    def look(self, kitchen: KitchenState) -> None:
        """Update what was seen with this state."""
        x, y, *_ = kitchen.players[self._seat]
        self._own = (x, y)
        inside: dict[Cell, tuple[int, ...]] = {(each[0], each[1]): each for each in (*kitchen.pots, *kitchen.counters)}
        for cell in (*self._pots, *self._counters):
            if self.sees(*cell):
                self._seen[cell] = inside.get(cell)

    def sees(self, x: int, y: int) -> bool:
        """Return whether the cell is in view."""
        return max(abs(x - self._own[0]), abs(y - self._own[1])) <= self._radius

    def sees_partner(self, kitchen: KitchenState) -> bool:
        x, y, *_ = kitchen.players[1 - self._seat]
        return self.sees(x, y)

    @property
    def unknown(self) -> tuple[Cell, ...]:
        """The counters and pots that were never in view."""
        return tuple(cell for cell in (*self._pots, *self._counters) if cell not in self._seen)

    def masked(self, kitchen: KitchenState) -> KitchenState:
        """Return the state as the person knows it. A chef out of view gets the position of the person's own chef, as
        there must be one."""
        players = list(kitchen.players)
        if not self.sees_partner(kitchen):
            players[1 - self._seat] = (*self._own, NORTH, NOTHING)
        return structs.replace(
            kitchen, players=tuple(players), counters=self._known(self._counters), pots=self._known(self._pots)
        )

    def _known(self, cells: Sequence[Cell]) -> tuple[tuple[int, ...], ...]:
        found = (self._seen.get(cell) for cell in cells)
        return tuple(content for content in found if content is not None)

    def cut(self, displayed: Displayed, kitchen: KitchenState) -> Displayed:
        """Return the partner's marks up to the first step that leaves the view. Moves are followed as the page draws
        them: the own chef blocks the way where it stands now."""
        x, y, *_ = kitchen.players[1 - self._seat]
        path = walked(self._layout, (x, y), self._own, (action for action, _ in displayed))
        inside = list(accumulate((self.sees(*cell) for cell in [(x, y), *path]), and_))
        return tuple(
            (action if seen else NOTHING_SHOWN, opacity)
            for (action, opacity), seen in zip(displayed, inside, strict=False)
        )
