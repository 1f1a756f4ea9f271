"""Turn events into points: the sparse reward, the shaped reward, and the paper's progress credit at the end of a
game. `vector_env` compiles the two rewards.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overcooked.constants import (
    HELD,
    ONIONS_PER_SOUP,
    POTTING_ONION,
    SOUP,
    SOUP_DELIVERY,
    SOUP_FROM_POT,
    USEFUL_DISH_PICKUP,
)
from overcooked.layout import Layout

DELIVERY_REWARD = 20
PLACEMENT_REWARD = 3
DISH_REWARD = 3
SOUP_REWARD = 5


def sparse_reward(events: int) -> int:
    """Return the points of one chef's timestep: 20 for a delivered soup. Rewards are shared: add those of both
    chefs."""
    return DELIVERY_REWARD if events & SOUP_DELIVERY else 0


def shaped_reward(events: int) -> int:
    """Return overcooked_ai's default shaped reward of the chef that acted: 3 for an onion into a pot, 3 for a useful
    dish, 5 for a soup lifted."""
    reward = 0
    if events & POTTING_ONION:
        reward += PLACEMENT_REWARD
    if events & USEFUL_DISH_PICKUP:
        reward += DISH_REWARD
    if events & SOUP_FROM_POT:
        reward += SOUP_REWARD
    return reward


@dataclass(frozen=True)
class ProgressWeights:
    """Points for unfinished soups when the time is up (set in the study file)."""

    onion_in_pot: float = PLACEMENT_REWARD
    soup_on_dish: float = ONIONS_PER_SOUP * PLACEMENT_REWARD + DISH_REWARD + SOUP_REWARD


DEFAULT_PROGRESS = ProgressWeights()


def progress_credit(
    layout: Layout, players: NDArray[np.int8], contents: NDArray[np.int8], weights: ProgressWeights = DEFAULT_PROGRESS
) -> float:
    """Return the paper's "discount reward according to the process" for one game's last state; separate from the sparse
    reward.

    `players` (2, 4), `contents` (width, height). Each onion in a pot counts (a full pot is three, cooked or not), each
    soup on a dish counts, held or on a counter; an empty dish counts nothing.
    """
    onions = sum(min(int(contents[x, y]), ONIONS_PER_SOUP) for x, y in layout.pots)
    soups = int(np.count_nonzero(players[:, HELD] == SOUP))
    soups += sum(int(contents[x, y]) == SOUP for x, y in layout.counters)
    return onions * weights.onion_in_pot + soups * weights.soup_on_dish
