"""Choose a simulated participant's next station: the one with the highest value per time. Compiled."""

from typing import Final

import numpy as np

from overcooked.compiled import kernel
from overcooked.constants import (
    COOK_TIME,
    COOKING,
    COUNTER,
    DISH,
    DISH_DISPENSER,
    EXIT,
    FACING,
    HELD,
    NOTHING,
    ONION,
    ONION_DISPENSER,
    ONIONS_PER_SOUP,
    POT,
    READY,
    SOUP,
    X,
    Y,
)
from server.bots.foresight.beliefs import pot_needs
from server.bots.foresight.kitchen_map import FAR
from server.bots.foresight.route import ticks_past

_ONION_TRIP: Final = 8  # ticks until the next onion arrives, if a pot is not full yet
_LOOSE_SOUP: Final = 4.0  # value of a soup that lies on a counter or is in the hand
_DROP_FIRST: Final = 25  # ticks that a change of plan costs
_WAIT_BLIND: Final = 5  # ticks after which to check again whether a full pot was emptied


@kernel
def ticks_until_ready(inside):
    """Return the ticks until the soup of a pot can be lifted; an estimate if onions are missing."""
    if inside >= COOKING:
        return READY - inside
    return COOK_TIME + _ONION_TRIP * (ONIONS_PER_SOUP - inside)


@kernel
def what_is_inside(kitchen, contents, inside):
    """Fill `inside` (s,) with the contents of each station."""
    height = contents.shape[1]
    for station in range(inside.shape[0]):
        inside[station] = contents[kitchen.cell[station] // height, kitchen.cell[station] % height]


@kernel
def _ticks_of_use(kind, inside, item, way):
    """Return the ticks until an item can be used at a station that is `way` ticks off; FAR: it is of no use there."""
    if kind == EXIT and item == SOUP:
        return way
    if kind == POT and item == ONION:
        return way if inside < ONIONS_PER_SOUP else max(way, ticks_until_ready(inside)) + _WAIT_BLIND
    if kind == POT and item == DISH and inside > 0:
        return max(way, ticks_until_ready(inside)) + _ONION_TRIP
    return FAR


@kernel
def _onward(kitchen, inside, me, partner, start, item):
    """Return the ticks from taking `item` at a station until it is used: the soup served, the onion in a pot, or, where
    there is no way to that, until it lies on a free counter within the partner's reach. `me`, `partner`: (cell,
    facing)."""
    best = FAR
    hands_over = kitchen.usable[me[0], EXIT if item == SOUP else POT] == 0
    if hands_over and kitchen.kind[start] == COUNTER:
        return best
    for station in range(kitchen.kind.shape[0]):
        way = kitchen.between[start, station]
        if way >= best or kitchen.reach[station, me[0], me[1]] >= FAR:
            continue
        if not hands_over:
            best = min(best, _ticks_of_use(kitchen.kind[station], inside[station], item, way))
        elif kitchen.kind[station] == COUNTER and inside[station] == NOTHING:
            if kitchen.reach[station, partner[0], partner[1]] < FAR:
                best = way
    return best


@kernel
def _partner_brings(mind, kind, inside, held, item):
    """Return how much of `item` the partner holds or is fetching: 0, 0.5 or 1."""
    if held == item:
        return 1.0
    station = mind.partner_station
    if held == NOTHING and station >= 0:
        if kind[station] == (ONION_DISPENSER if item == ONION else DISH_DISPENSER) or inside[station] == item:
            return 0.5
    return 0.0


@kernel
def _value_with_empty_hand(mind, kind, inside, missing, dishes):
    """Return (value, item) of going to a station; the item is NOTHING where there is none to take."""
    item = inside if kind == COUNTER else NOTHING
    if kind == ONION_DISPENSER or item == ONION:
        return (1.0 if missing >= 1 else 0.5 if missing > 0 else mind.onion_ahead), ONION
    if kind == DISH_DISPENSER or item == DISH:
        return (mind.dish if dishes >= 1 else 0.5 * mind.dish if dishes > 0 else mind.dish_ahead), DISH
    return _LOOSE_SOUP, SOUP if item == SOUP else NOTHING


@kernel
def _rate_of_putting_down(mind, held, shared, hands_over, distance, missing, dishes):
    """Return value by time of leaving what is held on a free counter."""
    if hands_over:
        return 1.0 / (distance + 1) if shared else 0.0
    if held == ONION and dishes >= 1:
        return mind.dish / (distance + _DROP_FIRST)
    if held == DISH and missing >= 1 and dishes < 0:
        return 1.0 / (distance + _DROP_FIRST)
    return 0.0


@kernel
def _rate(kitchen, mind, inside, me, partner, held, station, missing, dishes):
    """Return value by time of using a station. `me`, `partner`: (cell, facing)."""
    kind, distance = kitchen.kind[station], ticks_past(kitchen, mind, station, me[0], me[1], partner[0])
    if held == NOTHING:
        value, item = _value_with_empty_hand(mind, kind, inside[station], missing, dishes)
        if item == NOTHING or (kind == COUNTER and station == mind.partner_station):
            return 0.0  # nothing to take, or the partner takes it
        onward = _onward(kitchen, inside, me, partner, station, item)
        return value / (distance + onward + 2) if onward < FAR else 0.0
    if kind == COUNTER:
        if inside[station] != NOTHING:
            return 0.0
        shared = kitchen.reach[station, partner[0], partner[1]] < FAR
        hands_over = kitchen.usable[me[0], EXIT if held == SOUP else POT] == 0
        return _rate_of_putting_down(mind, held, shared, hands_over, distance, missing, dishes)
    ticks = _ticks_of_use(kind, inside[station], held, distance)
    if ticks >= FAR:
        return 0.0
    if held == ONION:
        return (1.0 if inside[station] < ONIONS_PER_SOUP else mind.onion_ahead) / (ticks + 1)
    return (mind.dish if held == DISH else _LOOSE_SOUP) / (ticks + 1)


@kernel
def choose_target(kitchen, mind, players, contents, inside):
    """Return the station to use next, -1 for none; the old one unless another is clearly better."""
    height, kind = contents.shape[1], kitchen.kind
    mine, theirs = players[mind.seat], players[1 - mind.seat]
    me = (mine[X] * height + mine[Y], np.int64(mine[FACING]))
    partner = (theirs[X] * height + theirs[Y], np.int64(theirs[FACING]))
    all_missing, full = pot_needs(kitchen.pots, contents)
    missing = all_missing - _partner_brings(mind, kind, inside, theirs[HELD], ONION)
    dishes = full - _partner_brings(mind, kind, inside, theirs[HELD], DISH)
    if kitchen.usable[me[0], POT] == 0:  # an item that was handed over is being used
        for station in range(kind.shape[0]):
            missing -= kind[station] == COUNTER and inside[station] == ONION
            dishes -= kind[station] == COUNTER and inside[station] == DISH
    if mine[HELD] == DISH:
        dishes -= 1
    best, found, old = 0.0, -1, 0.0
    for station in range(kind.shape[0]):
        if kitchen.reach[station, me[0], me[1]] >= FAR:
            continue
        rate = _rate(kitchen, mind, inside, me, partner, mine[HELD], station, missing, dishes)
        if station == mind.target:
            old = rate
        if rate > best:
            best, found = rate, station
    return mind.target if old > 0 and old >= mind.keep * best else found


@kernel
def ticks_to_wait(kind, inside, held):
    """Return the ticks before which using a station has no effect."""
    if kind != POT:
        return 0
    if held == DISH:
        return ticks_until_ready(inside)
    return _WAIT_BLIND if held == ONION and inside >= ONIONS_PER_SOUP else 0
