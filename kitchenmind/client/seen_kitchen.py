"""Rebuild the kitchen's state as arrays from the messages of a game."""

from functools import cache

import numpy as np

from models.protocols import Policy
from overcooked.constants import ITEM_NAMES, PLAYERS
from overcooked.layout import Layout, bundled_layout, parse_layout
from overcooked.state import Kitchens
from server.play import messages


class SeenKitchen:
    """A game's state rebuilt from its messages: a chef's observation, and the state's hash."""

    def __init__(self, welcome: messages.Welcome) -> None:
        self.layout: Layout = parse_layout("\n".join(welcome.grid), welcome.layout)
        self.seat, self.horizon = welcome.seat, welcome.horizon
        self._state = Kitchens.start(self.layout)

    def show(self, state: messages.KitchenState) -> str:
        """Set the state of a message; return its hash."""
        self._state.restore(
            {
                "t": state.t,
                "p": [(x, y, facing, ITEM_NAMES[held]) for x, y, facing, held in state.players],
                "c": [(x, y, ITEM_NAMES[item]) for x, y, item in state.counters],
                "pots": state.pots,
            }
        )
        return self._state.hash()

    @property
    def now(self) -> Kitchens:
        """Return a copy of the state shown last."""
        return self._state.copy()

    def decide(self, policy: Policy) -> int:
        """Return what an agent with this policy would do now."""
        seen = self._state.encode(horizon=self.horizon)[:, max(0, self.seat)]
        return int(np.argmax(policy.probabilities(seen)[0]))


@cache
def compile_rules() -> None:
    """Compile the rules, which takes seconds the first time on a machine. During a game, the server would drop the
    client, because it answers no ping while it compiles."""
    kitchens = Kitchens.start(bundled_layout("practice"))
    kitchens.step(np.zeros((1, PLAYERS), np.int8), np.zeros((1, PLAYERS), np.int32))
    kitchens.encode(horizon=1)
    kitchens.hash()
