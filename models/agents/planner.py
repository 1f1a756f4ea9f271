"""A scripted cook that needs no training: fetch onions, fill a pot, take a dish, serve. Greedy, one step ahead. It uses
only the observation, and of its partner only the position and the held item.
"""

import numpy as np

from models.agents import kitchen_needs
from models.agents.observation_parser import Cell, ParsedObservation, Walk, certain, distances, parse_observation
from models.agents.planner_handover import goals as handing_over_goals
from models.agents.planner_handover import must_hand_over
from models.protocols import Mode, Observations, Probabilities
from overcooked.constants import ACTIONS, DISH, INTERACT, NOTHING, ONION, SOUP, STAY, STEP_X, STEP_Y

MODE = Mode(temperature=0.0, stuck_after=3, stuck_mix=0.6)


class PlannerPolicy:
    """The `planner` of the catalogue; a Policy for any layout."""

    def probabilities(self, observations: Observations) -> Probabilities:
        action_distributions = np.empty((len(observations), ACTIONS), np.float32)
        for game, planes in enumerate(observations):
            action_distributions[game] = certain(_action(parse_observation(planes)))
        return action_distributions


def _action(seen: ParsedObservation) -> int:
    """Return the next action; with nothing to do, the cook waits out of the way."""
    walk = next_walk(seen)
    return STAY if walk is None else walk.action


def next_walk(seen: ParsedObservation) -> Walk | None:
    """Return the path to the nearest useful station: that of the first goal that can be reached."""
    around = distances(seen.floor, seen.me, seen.other)
    through = distances(seen.floor, seen.me, None)  # as if the other chef stepped aside
    goals = _goals(seen)
    if must_hand_over(seen, through):
        goals = handing_over_goals(seen, through, distances(seen.floor, seen.other, None))
    for goal in goals:
        for reached in (around, through):
            walk = _nearest(seen, reached, goal)
            if walk is not None:
                return walk
    return None


def _goals(seen: ParsedObservation) -> list[tuple[Cell, ...]]:
    """Return groups of cells to use, the most useful first."""
    if seen.held == NOTHING:
        return _goals_of_an_empty_hand(seen)
    places = kitchen_needs.places_for_what_is_held(seen)
    return [*places, seen.free_counters] if seen.held == ONION or not places else places


def _goals_of_an_empty_hand(seen: ParsedObservation) -> list[tuple[Cell, ...]]:
    lying = {item: tuple(cell for cell, here in seen.items.items() if here == item) for item in (ONION, DISH, SOUP)}
    missing = kitchen_needs.missing_onions(seen)
    goals = [lying[SOUP]] if lying[SOUP] else []
    if kitchen_needs.soups_without_dish(seen) > 0 and (kitchen_needs.is_dish_urgent(seen) or missing <= 0):
        return [*goals, lying[DISH] + seen.dishes]
    if missing > 0:
        return [*goals, seen.onions + lying[ONION]]
    return goals


def _nearest(seen: ParsedObservation, reached: dict[Cell, tuple[int, int]], cells: tuple[Cell, ...]) -> Walk | None:
    """Return the path to the nearest of `cells`, ending with its use."""
    best: Walk | None = None
    for x, y in cells:
        for direction in range(4):
            neighbour = (x - STEP_X[direction], y - STEP_Y[direction])
            if neighbour not in reached:
                continue
            steps, first = reached[neighbour]
            if best is None or steps < best.steps:
                best = Walk((x, y), steps, first if steps else _use(seen, direction, (x, y)))
    return best


def _use(seen: ParsedObservation, direction: int, cell: Cell) -> int:
    """Return the action of a chef next to a station: turn to it, wait for a soup, or use it."""
    if seen.facing != direction:
        return direction
    cooking = any(pot.cell == cell and pot.left for pot in seen.pots)
    return STAY if cooking and seen.held != NOTHING else INTERACT
