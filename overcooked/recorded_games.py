"""Games recorded state by state as JSON lines (see `tests/data/README.md`): read, and compared with the rules.

A line `layout` has a grid, `ep` begins an episode, `s` is a state before the joint action `a` that was taken in it.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from overcooked.constants import ACTIONS, PLAYERS
from overcooked.layout import Layout, bundled_layout, parse_layout
from overcooked.state import Kitchens

_RULES = (
    "Only games that began in the standard start state and were played by overcooked_ai's old dynamics can be shown. "
    'To show the actions alone, write them as one line {"layout": ..., "joint_actions": [[a0, a1], ...]}.'
)


class RecordingError(ValueError):
    """A recorded game that does not follow these rules, or a line that is not part of one."""


class RecordedGames:
    """Parse the lines of a file in order."""

    def __init__(self) -> None:
        self._layouts: dict[str, Layout] = {}
        self._layout: Layout | None = None
        self._kitchen: Kitchens | None = None
        self._actions: list[list[int]] = []
        self._is_over = False  # the last state, which has no action, was read

    def add(self, line: Mapping[str, Any]) -> tuple[Layout, list[list[int]]] | None:
        """Add a line; return the episode that it ends, if it ends one. Raises RecordingError, LayoutError."""
        try:
            if line["k"] == "layout":
                layout = parse_layout("\n".join(line["grid"]), str(line["name"]))
                self._layouts[layout.name] = layout
                return None
            if line["k"] == "ep":
                before = self.end()
                self._begin(str(line["layout"]))
                return before
            if line["k"] == "s":
                self._state(line)
                return None
        except (KeyError, TypeError) as error:
            raise RecordingError(f"the line {line['k']!r:.40} is incomplete ({error!r})") from None
        raise RecordingError(f'"k" is {line["k"]!r:.40}; in a recorded game it is layout, ep or s')

    def end(self) -> tuple[Layout, list[list[int]]] | None:
        """Return the episode that the lines so far ended with."""
        found = None if self._layout is None or not self._actions else (self._layout, self._actions)
        self._layout, self._kitchen, self._actions, self._is_over = None, None, [], False
        return found

    def _begin(self, name: str) -> None:
        self._layout = self._layouts.get(name) or bundled_layout(name)
        self._kitchen = Kitchens.start(self._layout)

    def _state(self, line: Mapping[str, Any]) -> None:
        if self._kitchen is None:
            raise RecordingError('a state comes before its episode (a line with "k": "ep")')
        if self._is_over:
            raise RecordingError("a state follows a state without an action")
        ours = self._kitchen.record()
        theirs = {"t": line["t"], "p": line["p"], "c": sorted(line["c"]), "pots": sorted(line["pots"])}
        if ours != theirs:
            raise RecordingError(f"the state of timestep {line['t']} does not follow from these rules. {_RULES}")
        joint_action = line.get("a")
        self._is_over = joint_action is None
        if joint_action is None:
            return
        if len(joint_action) != PLAYERS or not all(
            type(action) is int and 0 <= action < ACTIONS for action in joint_action
        ):
            raise RecordingError(f'"a" is {joint_action!r:.60}; it is two actions from 0 to {ACTIONS - 1}')
        self._kitchen.step(np.array([joint_action]), np.zeros((1, PLAYERS), np.int32))
        self._actions.append(joint_action)
