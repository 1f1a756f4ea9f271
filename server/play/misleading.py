"""The most plausible wrong prediction for the watched chef: likely actions that it will not take."""

from collections.abc import Sequence
from heapq import heappop, heappush
from itertools import count
from math import prod

from overcooked.constants import ACTIONS, STAY
from server.play.simulation import Moment, Simulation


def wrong_future(
    simulation: Simulation, seat: int, prediction: Sequence[Sequence[float]], decided: int | None
) -> tuple[int, ...]:
    """Return the most probable sequence of actions whose first one is not what the chef will do.

    `prediction` (steps, 6): probabilities. `decided`: the chef's action for the coming timestep; where nobody knows it
    (a person, or no answer), the most probable one is taken for it. Only sequences count in which every action has an
    effect by the rules, or waits: no walking into walls, no use of what cannot be used. The other chef stands still.
    """
    avoided = max(range(ACTIONS), key=prediction[0].__getitem__) if decided is None else decided
    best_rest = [prod(max(row) for row in prediction[step:]) for step in range(len(prediction) + 1)]
    order = count()  # of equal probabilities, the one found first
    waiting: list[tuple[float, int, float, tuple[int, ...], Moment]] = []
    heappush(waiting, (-best_rest[0], next(order), 1.0, (), simulation.moment()))
    while waiting:
        _, _, probability, path, moment = heappop(waiting)
        step = len(path)
        if step == len(prediction):
            return path
        for action in range(ACTIONS):
            after = None if step == 0 and action == avoided else _after(simulation, moment, seat, action)
            if after is not None:
                likely = probability * prediction[step][action]
                heappush(waiting, (-likely * best_rest[step + 1], next(order), likely, (*path, action), after))
    return ()


def _after(simulation: Simulation, moment: Moment, seat: int, action: int) -> Moment | None:
    """Return the kitchen after the chef's action; None if it has no effect."""
    if action == STAY:
        return moment
    actions = (action, STAY) if seat == 0 else (STAY, action)
    after = simulation.imagine(moment, actions)
    return None if after.same_place(moment) else after
