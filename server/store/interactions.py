"""The watched chef's actual next interactions, re-simulated from the stored actions, and how often they were
predicted.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import Connection, select

from overcooked.constants import FACING, STEP_X, STEP_Y, X, Y
from overcooked.interactions import InteractionKind, interaction_kind
from overcooked.layout import Layout, parse_layout
from overcooked.state import Kitchens
from server.play.intentions import HORIZON, Intention
from server.store import packed_intentions
from server.store.tables import episodes, ticks

UNKNOWN: Final = -1  # the episode ended before anything was done, and before the horizon
Place = tuple[int, int, int]  # kind, x, y


def next_interactions(layout: Layout, joint_actions: Sequence[Sequence[int]], seat: int) -> NDArray[np.int16]:
    """Return what the chef does next in each state of an episode: (states, 4), kind, x, y, timesteps until it is done.

    The timestep that begins in the state is the first. NONE (0, -1, -1, 0): nothing within the horizon; UNKNOWN
    everywhere: the episode ended before that could be said.
    """
    states = len(joint_actions) + 1
    found = np.full((states, 4), UNKNOWN, np.int16)
    found[: max(0, states - HORIZON)] = (InteractionKind.NONE, -1, -1, 0)
    for timestep, (kind, x, y) in _interactions(layout, joint_actions, seat).items():
        for state in range(timestep, max(-1, timestep - HORIZON), -1):
            if found[state, 0] > 0:
                break
            found[state] = (kind, x, y, timestep - state + 1)
    return found


def _interactions(layout: Layout, joint_actions: Sequence[Sequence[int]], seat: int) -> dict[int, Place]:
    """Return what the chef did, by timestep."""
    kitchen, events = Kitchens.start(layout), np.zeros((1, 2), np.int32)
    done: dict[int, Place] = {}
    for timestep, actions in enumerate(joint_actions):
        chef = kitchen.players[0, seat]
        x, y, facing = int(chef[X]), int(chef[Y]), int(chef[FACING])
        kitchen.step(np.array([actions], np.int8), events)
        kind = interaction_kind(int(events[0, seat]))
        if kind is not InteractionKind.NONE:
            done[timestep] = (int(kind), x + int(STEP_X[facing]), y + int(STEP_Y[facing]))
    return done


def next_in_episode(connection: Connection, episode_id: str) -> NDArray[np.int16]:
    """Return the `next_interactions` of the watched chef in a stored episode."""
    e = episodes.c
    row = connection.execute(select(e.grid, e.layout, e.watched_seat).where(e.id == episode_id)).one()
    query = select(ticks.c.action_0, ticks.c.action_1).where(ticks.c.episode_id == episode_id)
    actions = connection.execute(query.order_by(ticks.c.timestep)).all()[1:]
    return next_interactions(_layout(row.grid, row.layout), [tuple(pair) for pair in actions], row.watched_seat)


def hits_of(connection: Connection, episode_id: str) -> tuple[int, int]:
    """Return how often an intention was predicted that came within the horizon, and how often kind and station were
    right. (0, 0) without intentions."""
    query = select(ticks.c.intentions).where(ticks.c.episode_id == episode_id).order_by(ticks.c.timestep)
    stored = list(connection.execute(query).scalars())
    if not any(stored):
        return 0, 0
    predicted = [packed_intentions.unpack(blob) for blob in stored]
    return hits(next_in_episode(connection, episode_id), [each[0] if each else None for each in predicted])


def hits(came: NDArray[np.int16], predicted: Sequence[Intention | None]) -> tuple[int, int]:
    """Return `hits_of` for the intentions of each state."""
    pairs = [
        ((one.kind, one.x, one.y), tuple(row[:3]))
        for one, row in zip(predicted, came.tolist(), strict=True)
        if one is not None and row[0] > InteractionKind.NONE
    ]
    return len(pairs), sum(said == happened for said, happened in pairs)


@lru_cache(maxsize=64)
def _layout(grid: str, name: str) -> Layout:
    return parse_layout(grid, name)
