"""Path of a simulated participant to its target: all paths of three timesteps around the partner, then as if alone.
Compiled. Costs are in timesteps.
"""

from typing import Final

import numpy as np

from overcooked.compiled import kernel
from overcooked.constants import ACTIONS, INTERACT, STAY
from server.bots.foresight.beliefs import AHEAD
from server.bots.foresight.kitchen_map import FAR

NEVER: Final = 1e6
_MAX_DETOUR: Final = 12  # ticks: instead of walking more, one waits until the partner has moved
_OPTIONS: Final = STAY + 1  # four moves and waiting
_WAYS: Final = _OPTIONS**AHEAD


@kernel
def chance_of_meeting(ahead, mind, cell, step, seen_cell, cells, sures):
    """Return the probability that the partner is in that cell after that step: the believed cell, or a cell near where
    it was seen."""
    sure = sures[step]
    likely = sure if cell == cells[step + 1] else 0.0
    elsewhere = mind.doubt * (1.0 - sure)
    if cell == seen_cell:
        return likely + elsewhere * mind.still_there
    for d in range(STAY):
        if ahead[seen_cell, d] == cell:
            return likely + elsewhere * (1.0 - mind.still_there) / STAY
    return likely


@kernel
def _step(ahead, mind, cell, action, step, seen_cell, cells, sures):
    """Return (the cell after one action, its cost). `seen_cell`, `cells`, `sures`: the partner's way."""
    to = ahead[cell, action] if action < STAY else cell
    cost = 1.0 + (mind.effort if action < STAY else 0.0)
    if to != cell:
        swaps = to == cells[step] and cell == cells[step + 1]
        meets = chance_of_meeting(ahead, mind, to, step, seen_cell, cells, sures)
        cost += mind.collision * max(meets, sures[step] if swaps else 0.0)
        if to == mind.bump and mind.now + step < mind.bump_until:
            cost += mind.bump_cost
        if swaps or to == cells[step + 1]:
            to = cell
    if to == cell and cell == cells[step + 1]:
        cost += mind.in_the_way * sures[step]
    return to, cost


@kernel
def ticks_past(kitchen, mind, station, cell, facing, partner):
    """Return the ticks until the station is faced, partly as if the partner's cell were blocked."""
    alone = kitchen.reach[station, cell, facing]
    if kitchen.around.shape[0] == 0 or alone >= FAR:
        return float(alone)
    detour = min(kitchen.around[partner, station, cell, facing], alone + _MAX_DETOUR)
    return alone + mind.detour * (detour - alone)


@kernel
def action_costs(kitchen, mind, me, target, wait, seen_cell, cells, sures, costs):
    """Fill `costs` (6,) with the cost of the best way that begins with each action.

    `me`: (cell, facing); `target` -1: none; `wait`: the ticks before which using the target has no
    effect; `seen_cell`, `cells`, `sures`: where the partner was seen, and its way as `imagine_ahead` gives it.
    """
    for action in range(ACTIONS):
        costs[action] = NEVER
    ahead, alone = kitchen.ahead, kitchen.reach[max(target, 0)]
    for way in range(_WAYS):
        here, faced, cost, rest, begins, used = me[0], me[1], 0.0, way, way % _OPTIONS, False
        for step in range(AHEAD):
            if target >= 0 and step >= wait and alone[here, faced] == 0:
                begins, used = (INTERACT if step == 0 else begins), True
                break
            action = rest % _OPTIONS
            rest //= _OPTIONS
            here, more = _step(ahead, mind, here, action, step, seen_cell, cells, sures)
            faced = action if action < STAY else faced
            cost += more
        if target < 0 or wait > AHEAD:  # nothing to do yet: wait where it blocks least
            cost += kitchen.crowded[here]
        if target >= 0 and not used:
            ticks = ticks_past(kitchen, mind, target, here, faced, cells[AHEAD])
            cost += max(ticks, wait - AHEAD) + mind.effort * ticks
        costs[begins] = min(costs[begins], cost)
    if costs[INTERACT] < NEVER:  # using the target at once; a timestep later; or after a step away and back
        for action in range(INTERACT):
            costs[action] = costs[INTERACT] + (1 if action == STAY else 2)


@kernel
def soft_choice(costs, temperature, probabilities):
    """Fill `probabilities` (6,) with a softmax of the negative costs."""
    least, total = NEVER, 0.0
    for action in range(ACTIONS):
        least = min(least, costs[action])
    for action in range(ACTIONS):
        probabilities[action] = np.exp(-(costs[action] - least) / temperature)
        total += probabilities[action]
    for action in range(ACTIONS):
        probabilities[action] /= total
