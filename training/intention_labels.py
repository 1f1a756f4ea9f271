"""The labels of intentions: the target's next interaction, from recorded states and actions."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from models.protocols import INTENTION_HORIZON
from overcooked.constants import FACING, HORIZON, PLAYERS, STEP_X, STEP_Y, X, Y
from overcooked.interactions import InteractionKind, PossibleInteraction, interaction_kind, possible_interactions
from overcooked.layout import Layout
from overcooked.state import Kitchens
from training.collect import Shard

UNKNOWN: Final = -1  # the game ends before the horizon
NOTHING_HAPPENS: Final = 0  # the class of NO_INTERACTION


@dataclass(frozen=True)
class IntentionLabels:
    """The next interaction from every state of E episodes of T timesteps."""

    classes: NDArray[np.int64]  # (E, T): places in `possible_interactions(layout)`; UNKNOWN near the end
    steps: NDArray[np.int64]  # (E, T): in how many timesteps it is done, 1 being the coming one; 0 for none

    def __len__(self) -> int:
        return len(self.classes)


def labels_of(shard: Shard, layout: Layout) -> IntentionLabels:
    """Return the labels of one partner's games, cut into episodes as `training.dataset.episodes_of` does."""
    timesteps = min(HORIZON, shard["timestep"].shape[1])
    episodes = shard["timestep"].shape[1] // timesteps
    done = interactions_done(shard, layout)[:, : episodes * timesteps]
    return next_interactions(done.reshape(-1, timesteps))


def interactions_done(shard: Shard, layout: Layout) -> NDArray[np.int64]:
    """Return which interaction (a place in `possible_interactions(layout)`) the target does in every timestep: (G, T).

    The events are those of the rules, which play each recorded joint action once more in its recorded state.
    """
    games, timesteps = shard["timestep"].shape
    seat = np.repeat(shard["seat"], timesteps).astype(np.intp)
    number = np.arange(games * timesteps)
    contents = shard["contents"].reshape(-1, layout.width, layout.height).copy()
    kitchens = Kitchens(
        layout,
        shard["players"].reshape(-1, PLAYERS, 4).copy(),
        contents,
        shard["timestep"].reshape(-1).astype(np.int32),
    )
    target = kitchens.players[number, seat].copy()
    actions = shard["actions"].reshape(-1, PLAYERS)
    events = np.zeros((len(number), PLAYERS), np.int32)
    kitchens.step(np.take_along_axis(actions, np.stack([seat, 1 - seat], 1), 1), events)
    found = events[number, seat]
    kinds = {int(bits): interaction_kind(int(bits)) for bits in np.unique(found)}
    places = {interaction: place for place, interaction in enumerate(possible_interactions(layout))}
    done = np.full(len(number), NOTHING_HAPPENS, np.int64)
    for k in np.flatnonzero(found):
        kind = kinds[int(found[k])]
        if kind != InteractionKind.NONE:
            x, y, facing = (int(target[k, column]) for column in (X, Y, FACING))
            done[k] = places[PossibleInteraction(kind, x + STEP_X[facing], y + STEP_Y[facing])]
    return done.reshape(games, timesteps)


def next_interactions(done: NDArray[np.int64]) -> IntentionLabels:
    """Return the labels of episodes in which the target does `done` (E, T)."""
    episodes, timesteps = done.shape
    classes, steps = np.full_like(done, UNKNOWN), np.zeros_like(done)
    coming, within = np.zeros(episodes, np.int64), np.full(episodes, INTENTION_HORIZON + 1)
    for t in reversed(range(timesteps)):
        now = done[:, t] != NOTHING_HAPPENS
        coming = np.where(now, done[:, t], coming)
        within = np.where(now, 1, within + 1)
        if t + INTENTION_HORIZON <= timesteps:  # otherwise the recording ends before the horizon
            soon = within <= INTENTION_HORIZON
            classes[:, t], steps[:, t] = np.where(soon, coming, NOTHING_HAPPENS), np.where(soon, within, 0)
    return IntentionLabels(classes, steps)
