"""Baselines without a predictor: the nearest useful station, and the most frequent next interaction by hand and
pots.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from models.agents.observation_parser import ParsedObservation, parse_observation
from models.agents.planner import next_walk
from overcooked.constants import COOKING, DISH, HELD, NOTHING, ONION, PLAYERS, READY
from overcooked.interactions import NO_INTERACTION, InteractionKind, PossibleInteraction, possible_interactions
from overcooked.layout import Layout
from overcooked.state import Kitchens
from training.collect import Shard, whole_episodes
from training.intention_labels import UNKNOWN, labels_of

_POT_STATES: Final = COOKING + 2  # 0-3 onions, cooking, ready
_TAKE: Final = (
    InteractionKind.NONE,
    InteractionKind.TAKE_ONION,
    InteractionKind.TAKE_DISH,
    InteractionKind.TAKE_SOUP,
)  # by the item


def nearest_sensible(shard: Shard, layout: Layout, chosen: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return what the planner would do next in the target's place in the `chosen` (G, T) states: (states,), places in
    `possible_interactions(layout)`."""
    games, timesteps = np.nonzero(chosen)
    players, contents = shard["players"][games, timesteps].copy(), shard["contents"][games, timesteps].copy()
    kitchens = Kitchens(layout, players, contents, shard["timestep"][games, timesteps].astype(np.int32))
    seen = kitchens.encode()[np.arange(len(games)), shard["seat"][games]]
    places = {interaction: place for place, interaction in enumerate(possible_interactions(layout))}
    found = [places.get(_next_interaction(parse_observation(planes)), 0) for planes in seen]
    return np.array(found, np.int64)


def _next_interaction(seen: ParsedObservation) -> PossibleInteraction:
    walk = next_walk(seen)
    if walk is None:
        return NO_INTERACTION
    if walk.cell in seen.exits:
        kind = InteractionKind.SERVE
    elif any(pot.cell == walk.cell for pot in seen.pots):
        kind = InteractionKind.PLATE if seen.held == DISH else InteractionKind.FILL
    elif seen.held != NOTHING:
        kind = InteractionKind.PUT_DOWN
    elif walk.cell in seen.onions:
        kind = _TAKE[ONION]
    elif walk.cell in seen.dishes:
        kind = _TAKE[DISH]
    else:
        kind = _TAKE[seen.items[walk.cell]]
    return PossibleInteraction(kind, *walk.cell)


class FrequentNext:
    """The most frequent next interaction in training, for this state of the target's hand and of the pots."""

    def __init__(self, shards: Sequence[Shard], layout: Layout) -> None:
        self._layout = layout
        keys, classes = [], []
        for shard in map(whole_episodes, shards):
            labels = labels_of(shard, layout).classes
            known = labels != UNKNOWN
            keys.append(self._keys(shard).reshape(labels.shape)[known])
            classes.append(labels[known])
        # only the states that occurred: all of them are too many for the memory in a kitchen with eight pots
        self._seen, row = np.unique(np.concatenate(keys), return_inverse=True)
        counts = np.zeros((len(self._seen) + 1, len(possible_interactions(layout))), np.int64)
        np.add.at(counts, (row, np.concatenate(classes)), 1)
        counts[-1] = counts.sum(0)  # for states never seen in training: the most frequent of all
        self._most: NDArray[np.int64] = counts.argmax(1)

    def __call__(self, shard: Shard) -> NDArray[np.int64]:
        """(G, T): places in `possible_interactions(layout)`."""
        keys = self._keys(shard)
        row = np.searchsorted(self._seen, keys)
        is_seen = np.append(self._seen, -1)[row] == keys
        return self._most[np.where(is_seen, row, len(self._seen))]

    def _keys(self, shard: Shard) -> NDArray[np.int64]:
        games, timesteps = shard["timestep"].shape
        seat = np.broadcast_to(shard["seat"][:, None, None], (games, timesteps, PLAYERS)).astype(np.intp)
        key = np.take_along_axis(shard["players"][..., HELD], seat, 2)[..., 0].astype(np.int64)
        for x, y in self._layout.pots:
            inside = shard["contents"][:, :, x, y]
            pot = np.where(inside < COOKING, inside, np.where(inside < READY, COOKING, COOKING + 1))
            key = key * _POT_STATES + pot
        return key
