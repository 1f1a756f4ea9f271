"""The rules of the kitchen: one transition function, compiled, for one game or ten thousand.

They are overcooked_ai's with `old_dynamics=True` (names in brackets are its functions). A state is three integer arrays
with the game first: `players` (games, 2, 4) int8 = x, y, facing, held; `contents` (games, width, height) int8 = what
lies on a counter or is in a pot (see `constants`); `timestep` (games,) int32. This module reports events; `score` turns
them into points.
"""

from overcooked.compiled import inlined_kernel, kernel
from overcooked.constants import (
    COOKING,
    COUNTER,
    DISH,
    DISH_DISPENSER,
    DISH_DROP,
    DISH_PICKUP,
    EAST,
    EXIT,
    FACING,
    FLOOR,
    HELD,
    INTERACT,
    NORTH,
    NOTHING,
    ONION,
    ONION_DISPENSER,
    ONION_DROP,
    ONION_PICKUP,
    ONIONS_PER_SOUP,
    OPTIMAL_ONION_POTTING,
    POT,
    POTTING_ONION,
    READY,
    SOUP,
    SOUP_DELIVERY,
    SOUP_DROP,
    SOUP_FROM_POT,
    SOUP_PICKUP,
    SOUTH,
    STAY,
    STEP_X,
    STEP_Y,
    USEFUL_DISH_DROP,
    USEFUL_DISH_PICKUP,
    USEFUL_ONION_DROP,
    USEFUL_ONION_PICKUP,
    VIABLE_ONION_POTTING,
    WEST,
    X,
    Y,
)

__all__ = ["step", "step_game"]


@inlined_kernel
def _pots_at_start(pots, contents):
    """Count the pots that want a dish (with 1-2 onions, cooking or ready) and the full pots (three onions, cooking or
    ready).

    [get_pot_states] counted once, before either chef acts: as in overcooked_ai, the dish rule uses this stale count.
    """
    wanting_dish = 0
    full = 0
    for k in range(pots.shape[0]):
        inside = contents[pots[k, 0], pots[k, 1]]
        if inside >= ONIONS_PER_SOUP:
            full += 1
        if inside != 0 and inside != ONIONS_PER_SOUP:
            wanting_dish += 1
    return wanting_dish, full


@inlined_kernel
def _dish_lies_on_counter(counters, contents):
    for k in range(counters.shape[0]):  # noqa: SIM110 numba has no generator expressions here
        if contents[counters[k, 0], counters[k, 1]] == DISH:
            return True
    return False


@inlined_kernel
def _use_counter(players, contents, me, x, y, wants_onions, full):
    """Put down what chef `me` holds, or pick up what is on the counter; return the events."""
    held = players[me, HELD]
    inside = contents[x, y]
    if held != NOTHING and inside == NOTHING:
        contents[x, y] = held
        players[me, HELD] = NOTHING
        if held == ONION:
            return ONION_DROP if wants_onions else ONION_DROP | USEFUL_ONION_DROP
        if held == DISH:
            if full == 0 and players[1 - me, HELD] != ONION:
                return DISH_DROP | USEFUL_DISH_DROP
            return DISH_DROP
        return SOUP_DROP
    if held == NOTHING and inside != NOTHING:
        contents[x, y] = NOTHING
        players[me, HELD] = inside
        if inside == ONION:
            return ONION_PICKUP | USEFUL_ONION_PICKUP if wants_onions else ONION_PICKUP
        return DISH_PICKUP if inside == DISH else SOUP_PICKUP
    return 0


@inlined_kernel
def _use_pot(players, contents, me, x, y):
    """Put an onion into the pot, or take the soup out; return the events."""
    held = players[me, HELD]
    inside = contents[x, y]
    if held == ONION and inside < ONIONS_PER_SOUP:
        contents[x, y] = inside + 1
        players[me, HELD] = NOTHING
        return POTTING_ONION | OPTIMAL_ONION_POTTING | VIABLE_ONION_POTTING
    if held == DISH and inside == READY:
        contents[x, y] = 0
        players[me, HELD] = SOUP
        return SOUP_PICKUP | SOUP_FROM_POT
    return 0


@kernel
def _interact(tiles, pots, counters, players, contents, me, wanting_dish, full):
    """Apply the interaction of chef `me` with the cell it faces; return its events. [resolve_interacts, one player]"""
    facing = players[me, FACING]
    x = players[me, X] + STEP_X[facing]
    y = players[me, Y] + STEP_Y[facing]
    tile = tiles[x, y]
    held = players[me, HELD]
    other_held = players[1 - me, HELD]
    wants_onions = full != pots.shape[0] or other_held == DISH

    if tile == COUNTER:
        return _use_counter(players, contents, me, x, y, wants_onions, full)
    if tile == ONION_DISPENSER:
        if held == NOTHING:
            players[me, HELD] = ONION
            return ONION_PICKUP | USEFUL_ONION_PICKUP if wants_onions else ONION_PICKUP
        return 0
    if tile == DISH_DISPENSER:
        if held == NOTHING:
            dishes_in_hands = 1 if other_held == DISH else 0
            useful = dishes_in_hands < wanting_dish and not _dish_lies_on_counter(counters, contents)
            players[me, HELD] = DISH
            if useful:
                return DISH_PICKUP | USEFUL_DISH_PICKUP
            return DISH_PICKUP
        return 0
    if tile == POT:
        return _use_pot(players, contents, me, x, y)
    if tile == EXIT and held == SOUP:
        players[me, HELD] = NOTHING
        return SOUP_DELIVERY
    return 0


@inlined_kernel
def _target(tiles, x, y, action):
    """Return where the action leads. Without branches: the processor cannot guess which way somebody walks."""
    to_x = x + (action == EAST) - (action == WEST)
    to_y = y + (action == SOUTH) - (action == NORTH)
    is_free = tiles[to_x, to_y] == FLOOR
    return (to_x if is_free else x), (to_y if is_free else y)


@inlined_kernel
def _move(tiles, players, first_action, second_action):
    """Turn both chefs and move them if their cells are free. [resolve_movement, _handle_collisions]"""
    x0, y0 = players[0, X], players[0, Y]
    x1, y1 = players[1, X], players[1, Y]
    players[0, FACING] = first_action if first_action < STAY else players[0, FACING]
    players[1, FACING] = second_action if second_action < STAY else players[1, FACING]
    to_x0, to_y0 = _target(tiles, x0, y0, first_action)
    to_x1, to_y1 = _target(tiles, x1, y1, second_action)
    same_cell = to_x0 == to_x1 and to_y0 == to_y1
    swapped = to_x0 == x1 and to_y0 == y1 and to_x1 == x0 and to_y1 == y0
    if not same_cell and not swapped:
        players[0, X] = to_x0
        players[0, Y] = to_y0
        players[1, X] = to_x1
        players[1, Y] = to_y1


@inlined_kernel
def step_game(tiles, pots, counters, players, contents, first_action, second_action, events):
    """Play one timestep of one game, in place. [get_state_transition]

    `players` (2, 4), `contents` (width, height), `events` (2,) int32 out: the bits of each chef's events. The caller
    counts the timestep. The caller must not pass actions outside 0-5; they are not checked.
    """
    events[0] = 0
    events[1] = 0
    if first_action == INTERACT or second_action == INTERACT:
        wanting_dish, full = _pots_at_start(pots, contents)
        if first_action == INTERACT:
            events[0] = _interact(tiles, pots, counters, players, contents, 0, wanting_dish, full)
        if second_action == INTERACT:
            events[1] = _interact(tiles, pots, counters, players, contents, 1, wanting_dish, full)
    _move(tiles, players, first_action, second_action)
    for k in range(pots.shape[0]):
        inside = contents[pots[k, 0], pots[k, 1]]
        if inside == ONIONS_PER_SOUP:
            contents[pots[k, 0], pots[k, 1]] = COOKING + 1
        elif COOKING <= inside < READY:
            contents[pots[k, 0], pots[k, 1]] = inside + 1


@kernel
def step(tiles, pots, counters, players, contents, timestep, actions, events):
    """Play one timestep of many games, in place.

    `players` (games, 2, 4), `contents` (games, width, height), `timestep` (games,), `actions` (games, 2) in 0-5,
    `events` (games, 2) int32 out.
    """
    for game in range(players.shape[0]):
        step_game(
            tiles, pots, counters, players[game], contents[game], actions[game, 0], actions[game, 1], events[game]
        )
        timestep[game] += 1
