"""Let two planners play a kitchen to measure its points and how often the chefs block each other."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.acting import Stuck, distribution, draw
from models.agents.planner import MODE, PlannerPolicy
from overcooked.constants import FLOOR, HORIZON, PLAYERS, STAY, STEP_X, STEP_Y, X, Y
from overcooked.layout import Layout
from overcooked.score import sparse_reward
from overcooked.state import Kitchens


@dataclass(frozen=True)
class KitchenTrial:
    """`points` of each episode. `blocked`: the share of steps onto floor that failed because of the other chef."""

    points: tuple[int, ...]
    steps: int
    blocked: float


def try_kitchen(layout: Layout, episodes: int, seed: int = 0, horizon: int = HORIZON) -> KitchenTrial:
    """Let two planners play; the same seed gives the same result."""
    kitchens, events = Kitchens.start(layout, episodes), np.zeros((episodes, PLAYERS), np.int32)
    stuck = [Stuck(kitchens.players[:, chef]) for chef in range(PLAYERS)]
    draws, policy = np.random.default_rng(seed), PlannerPolicy()
    points = np.zeros(episodes, np.int64)
    wanted = failed = 0
    for _ in range(horizon):
        seen = kitchens.encode(horizon=horizon)  # (episodes, 2, width, height, 26)
        actions = np.empty((episodes, PLAYERS), np.int8)
        for chef in range(PLAYERS):
            chances = distribution(policy.probabilities(seen[:, chef].copy()), stuck[chef].counts, MODE)
            actions[:, chef] = draw(chances, draws.random(episodes))
        before = kitchens.players.copy()
        kitchens.step(actions, events)
        walks = _walks(layout, before, actions)
        stayed = (kitchens.players[..., [X, Y]] == before[..., [X, Y]]).all(-1)
        wanted, failed = wanted + int(walks.sum()), failed + int((walks & stayed).sum())
        for chef in range(PLAYERS):
            stuck[chef].update(kitchens.players[:, chef])
        points += [sum(sparse_reward(int(bits)) for bits in both) for both in events]
    return KitchenTrial(tuple(int(one) for one in points), wanted, failed / wanted if wanted else 0.0)


def _walks(layout: Layout, players: NDArray[np.int8], actions: NDArray[np.int8]) -> NDArray[np.bool_]:
    """Return which actions (episodes, 2) are steps onto a floor cell, not turns to a counter or waiting."""
    moves = actions < STAY
    direction = np.where(moves, actions, 0)
    x = players[..., X] + np.array(STEP_X)[direction]
    y = players[..., Y] + np.array(STEP_Y)[direction]
    return np.asarray(moves & (layout.tiles[x, y] == FLOOR))
