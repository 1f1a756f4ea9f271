"""One simulated participant of `server.bots.foresight` in one game, called by the bots' game client."""

from collections.abc import Sequence

import numpy as np

from overcooked.constants import STAY
from overcooked.layout import Layout, load_layout
from overcooked.state import Kitchens
from server.bots.cook import Cook, Traits
from server.bots.foresight.participants import NO_ARROW, SimulatedParticipants
from server.bots.foresight.people import ARROWS, Variant, person


class ForesightCook(Cook):
    """Act as the person drawn from the traits' seed. A state that is shown again gets the same action again."""

    def __init__(self, layout: Layout, seat: int, traits: Traits, episode_seed: int) -> None:
        super().__init__(layout, seat, traits, episode_seed)
        mind = person(traits.seed, seat, Variant(credulous=traits.cook == "credulous"), traits.tick_ms)
        mind["seed"] = (traits.seed ^ episode_seed) & (2**63 - 1)  # the same person, another game
        self._participant = SimulatedParticipants(layout, [mind])
        self._last = (-1, STAY)  # timestep, action

    def choose(self, now: Kitchens, actions: tuple[int, int], arrows: Sequence[int], horizon: int) -> int:  # noqa: ARG002
        """Return the action on this state."""
        timestep = int(now.timestep[0])
        if timestep != self._last[0]:
            shown = [*arrows, *[NO_ARROW] * ARROWS][:ARROWS]
            action = self._participant.act(now, np.array([actions], np.int64), np.array([shown], np.int64))
            self._last = (timestep, int(action[0]))
        return self._last[1]


def cook(layout: Layout, seat: int, traits: Traits, episode_seed: int) -> Cook:
    """Return the cook named by the traits."""
    kind = ForesightCook if traits.cook in ("foresight", "credulous") else Cook
    return kind(layout, seat, traits, episode_seed)


def prepare() -> None:
    """Compile the cooks' kernels, which takes a few seconds once per machine, so that no game has to wait for it."""
    layout = load_layout("practice")
    ForesightCook(layout, 0, Traits.drawn(0), 0).act(Kitchens.start(layout), 0, (STAY, STAY), (), 1)
