"""Many simulated participants of one layout at once, each in its own game: their minds and memories."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from overcooked.constants import ACTIONS, PLAYERS
from overcooked.layout import Layout
from overcooked.state import Kitchens
from server.bots.foresight.beliefs import FRAMES, Memory
from server.bots.foresight.kitchen_map import kitchen_map
from server.bots.foresight.mind import think_all
from server.bots.foresight.people import ARROWS

NO_ARROW: Final = -1


class SimulatedParticipants:
    """One participant per game. Their actions are a pure function of the frames and of their seeds."""

    def __init__(self, layout: Layout, people: Sequence[NDArray[np.void]]) -> None:
        """`people`: as `person` draws them, one a game."""
        self._layout, self._map = layout, kitchen_map(layout)
        self.minds = np.concatenate(people)
        games, size = len(self.minds), (layout.width, layout.height)
        self._memory = Memory(
            np.zeros((games, FRAMES, PLAYERS, 4), np.int8),
            np.zeros((games, FRAMES, *size), np.int8),
            np.zeros((games, FRAMES, PLAYERS), np.int64),
            np.zeros((games, FRAMES, ARROWS), np.int64),
        )
        self.probabilities = np.zeros((games, ACTIONS))  # of the actions that were drawn last

    def act(self, now: Kitchens, actions: NDArray[np.int64], arrows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the actions (games,) on these states, all at the same timestep.

        `actions` (games, 2): what led to the states; `arrows` (games, 3): the partner's predicted actions that are
        shown with them, `NO_ARROW` for none.
        """
        out = np.empty(len(self.minds), np.int64)
        # Always the same memory order: numba compiles everything again for another one.
        players, contents = np.ascontiguousarray(now.players), np.ascontiguousarray(now.contents)
        did, shown = np.ascontiguousarray(actions, np.int64), np.ascontiguousarray(arrows, np.int64)
        think_all(
            self._map, self.minds, self._memory, players, contents, int(now.timestep[0]), did, shown,
            self.probabilities, out,
        )  # fmt: skip
        return out

    def show(self, timestep: int, arrows: NDArray[np.int64]) -> None:
        """Replace the arrows that were shown at a timestep (no participant notices them before the next one)."""
        self._memory.arrows[:, timestep % FRAMES] = arrows

    def copy(self) -> "SimulatedParticipants":
        """Return a copy with the same memories, to try out actions."""
        other = SimulatedParticipants(self._layout, [self.minds.copy()])
        kept = self._memory
        other._memory = Memory(kept.players.copy(), kept.contents.copy(), kept.actions.copy(), kept.arrows.copy())
        return other
