"""A scripted cook that needs no training: fetch onions, fill a pot, take a dish, serve. Greedy, one step ahead.

It knows its layout only through what it sees, and its partner only by place and hand.
"""

import numpy as np

from models.agents.observation_parser import Cell, ParsedObservation, Walk, certain, distances, parse_observation
from models.agents.planner_handover import must_hand_over
from models.agents.planner_handover import wishes as handing_over_wishes
from models.protocols import Mode, Observations, Probabilities
from overcooked.constants import ACTIONS, DISH, INTERACT, NOTHING, ONION, ONIONS_PER_SOUP, SOUP, STAY, STEP_X, STEP_Y

MODE = Mode(temperature=0.0, stuck_after=3, stuck_mix=0.6)


class PlannerPolicy:
    """The `planner` of the catalogue; a Policy for any layout."""

    def probabilities(self, observations: Observations) -> Probabilities:
        action_distributions = np.empty((len(observations), ACTIONS), np.float32)
        for game, planes in enumerate(observations):
            action_distributions[game] = certain(_action(parse_observation(planes)))
        return action_distributions


def _action(seen: ParsedObservation) -> int:
    """The first wish that can be reached decides; with nothing to do, the cook makes room by waiting."""
    around = distances(seen.floor, seen.me, seen.other)
    through = distances(seen.floor, seen.me, None)  # as if the other would step aside
    wishes = _wishes(seen)
    if must_hand_over(seen, through):
        wishes = handing_over_wishes(seen, through, distances(seen.floor, seen.other, None))
    for wish in wishes:
        for reached in (around, through):
            walk = _nearest(seen, reached, wish)
            if walk is not None:
                return walk.action
    return STAY


def _wishes(seen: ParsedObservation) -> list[tuple[Cell, ...]]:
    """Groups of cells to use, the most wanted first."""
    hungry = [pot for pot in seen.pots if pot.left is None]
    cooking = sorted((pot for pot in seen.pots if pot.left is not None), key=lambda pot: pot.left or 0)
    ready = tuple(pot.cell for pot in cooking if pot.left == 0)
    fullest = sorted(hungry, key=lambda pot: -pot.onions)
    if seen.held == SOUP:
        return [seen.exits]
    if seen.held == ONION:
        return [*((pot.cell,) for pot in fullest), seen.free_counters]
    if seen.held == DISH:
        waiting = tuple(pot.cell for pot in cooking)
        return [ready, waiting] if cooking else [seen.free_counters]
    return _wishes_of_an_empty_hand(seen, len(cooking), _missing_onions(seen))


def _wishes_of_an_empty_hand(seen: ParsedObservation, soups: int, missing: int) -> list[tuple[Cell, ...]]:
    lying = {item: tuple(cell for cell, here in seen.items.items() if here == item) for item in (ONION, DISH, SOUP)}
    fetch_dish = lying[DISH] + seen.dishes
    fetch_onion = seen.onions + lying[ONION]
    soups_without_dish = soups - (seen.other_held == DISH)
    soon = any(pot.left is not None and pot.left <= 8 for pot in seen.pots)
    wishes = [lying[SOUP]] if lying[SOUP] else []
    if soups_without_dish > 0 and (soon or missing <= 0):
        return [*wishes, fetch_dish]
    if missing > 0:
        return [*wishes, fetch_onion]
    return wishes


def _missing_onions(seen: ParsedObservation) -> int:
    wanted = sum(ONIONS_PER_SOUP - pot.onions for pot in seen.pots if pot.left is None)
    return wanted - (seen.other_held == ONION)


def _nearest(seen: ParsedObservation, reached: dict[Cell, tuple[int, int]], cells: tuple[Cell, ...]) -> Walk | None:
    """The way to the nearest of `cells`, ending with the use of it."""
    best: Walk | None = None
    for x, y in cells:
        for direction in range(4):
            beside = (x - STEP_X[direction], y - STEP_Y[direction])
            if beside not in reached:
                continue
            steps, first = reached[beside]
            if best is None or steps < best.steps:
                best = Walk(steps, first if steps else _use(seen, direction, (x, y)))
    return best


def _use(seen: ParsedObservation, direction: int, cell: Cell) -> int:
    """Standing beside a station: turn to it, wait for a soup, or use it."""
    if seen.facing != direction:
        return direction
    cooking = any(pot.cell == cell and pot.left for pot in seen.pots)
    return STAY if cooking and seen.held != NOTHING else INTERACT
