"""Encode a state as planes: overcooked_ai's lossless encoding. The meaning of each plane is defined here only."""

import numpy as np

from overcooked.compiled import inlined_kernel, kernel
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

PLANES = 26
URGENT_TIMESTEPS = 40
_MY_FACING, _OTHER_FACING = 2, 6
_POT, _COUNTER, _ONIONS, _DISHES, _EXIT = 10, 11, 12, 14, 15
# Unsigned, as they are added to unsigned cells: numba makes a float of a sum of uint64 and int64.
_ME, _OTHER, _URGENT = np.uint64(0), np.uint64(1), np.uint64(25)
_ONIONS_IN_POT, _ONIONS_IN_SOUP, _COOKING_LEFT, _SOUP_READY = np.uint64(16), np.uint64(18), np.uint64(20), np.uint64(21)
_DISH, _ONION = np.uint64(22), np.uint64(23)


@kernel
def static_planes(tiles, out):
    """Write the planes that never change in a layout into `out` (width, height, 26) and clear the others."""
    out[:] = 0
    for x in range(tiles.shape[0]):
        for y in range(tiles.shape[1]):
            tile = tiles[x, y]
            if tile == POT:
                out[x, y, _POT] = 1
            elif tile == COUNTER:
                out[x, y, _COUNTER] = 1
            elif tile == ONION_DISPENSER:
                out[x, y, _ONIONS] = 1
            elif tile == DISH_DISPENSER:
                out[x, y, _DISHES] = 1
            elif tile == EXIT:
                out[x, y, _EXIT] = 1


@inlined_kernel
def _add_item(out, cell, item):
    if item == ONION:
        out[cell + _ONION] += 1
    elif item == DISH:
        out[cell + _DISH] += 1
    elif item == SOUP:
        out[cell + _ONIONS_IN_SOUP] += ONIONS_PER_SOUP
        out[cell + _SOUP_READY] += 1


@inlined_kernel
def _set_pot(out, cell, inside):
    if inside < COOKING:
        out[cell + _ONIONS_IN_POT] = inside
    else:
        out[cell + _ONIONS_IN_SOUP] = ONIONS_PER_SOUP
        out[cell + _COOKING_LEFT] = COOK_TIME - (inside - COOKING)
        if inside == READY:
            out[cell + _SOUP_READY] = 1


@kernel
def encode_game(static, pots, counters, players, contents, timestep, horizon, out, game):
    """Write the planes of one of many games for both chefs. [lossless_state_encoding]

    `static` is the flat view of (width, height, 26) from `static_planes`; `out` is the flat view of (games, 2, width,
    height, 26), of which row `game` is written: [k] is what chef k sees, channels last. A horizon of 0 means an endless
    game (the urgency plane stays empty). Flat and unsigned, as only then the copy of the static planes is compiled to
    wide moves; all games' arrays and an index, as a view of one game costs a third of its encoding.
    """
    height = contents.shape[2]
    size = np.uint64(static.size)
    first = np.uint64(2 * game) * size
    second = first + size
    for i in range(size):
        out[first + i] = static[i]
    for i in range(size):
        out[second + i] = static[i]
    # Both views at once: a station's contents are read once and written twice.
    for k in range(pots.shape[0]):
        inside = contents[game, pots[k, 0], pots[k, 1]]
        if inside != NOTHING:
            cell = np.uint64((pots[k, 0] * height + pots[k, 1]) * PLANES)
            _set_pot(out, first + cell, inside)
            _set_pot(out, second + cell, inside)
    for k in range(counters.shape[0]):
        item = contents[game, counters[k, 0], counters[k, 1]]
        if item != NOTHING:
            cell = np.uint64((counters[k, 0] * height + counters[k, 1]) * PLANES)
            _add_item(out, first + cell, item)
            _add_item(out, second + cell, item)
    for chef in range(2):
        cell = np.uint64((players[game, chef, X] * height + players[game, chef, Y]) * PLANES)
        mine = first + cell if chef == 0 else second + cell
        others = second + cell if chef == 0 else first + cell
        facing = players[game, chef, FACING]
        out[mine + _ME] = 1
        out[others + _OTHER] = 1
        out[mine + np.uint64(_MY_FACING + facing)] = 1
        out[others + np.uint64(_OTHER_FACING + facing)] = 1
        _add_item(out, mine, players[game, chef, HELD])
        _add_item(out, others, players[game, chef, HELD])
    if horizon > 0 and horizon - timestep[game] < URGENT_TIMESTEPS:
        for cell in range(first, second + size, np.uint64(PLANES)):
            out[cell + _URGENT] = 1


@kernel
def encode(static, pots, counters, players, contents, timestep, horizon, out):
    """Write the planes of many games: `out` (games, 2, width, height, 26), contiguous, any 8-bit or wider integer
    type."""
    flat_static, flat = static.reshape(-1), out.reshape(-1)
    for game in range(players.shape[0]):
        encode_game(flat_static, pots, counters, players, contents, timestep, horizon, flat, game)
