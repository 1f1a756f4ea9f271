"""State to planes: overcooked_ai's lossless encoding. Nothing else knows what a plane means."""

from numba import njit

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
_ME, _OTHER, _MY_FACING, _OTHER_FACING = 0, 1, 2, 6
_POT, _COUNTER, _ONIONS, _DISHES, _EXIT = 10, 11, 12, 14, 15
_ONIONS_IN_POT, _ONIONS_IN_SOUP, _COOKING_LEFT, _SOUP_READY, _DISH, _ONION, _URGENT = 16, 18, 20, 21, 22, 23, 25


@njit(cache=True)
def static_planes(tiles, out):
    """Writes the planes that never change in a layout into `out` (width, height, 26) and clears the others."""
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


@njit(cache=True, inline="always")
def _write_item(out, x, y, item):
    if item == ONION:
        out[x, y, _ONION] += 1
    elif item == DISH:
        out[x, y, _DISH] += 1
    elif item == SOUP:
        out[x, y, _ONIONS_IN_SOUP] += ONIONS_PER_SOUP
        out[x, y, _SOUP_READY] += 1


@njit(cache=True)
def encode_game(static, pots, counters, players, contents, timestep, horizon, out):
    """The planes of one game for both chefs. [lossless_state_encoding]

    `static` (width, height, 26) from `static_planes`; `out` (2, width, height, 26): out[k] is what chef k sees, channels
    last. A horizon of 0 means an endless game (the urgency plane stays empty).
    """
    for me in range(2):
        planes = out[me]
        planes[:] = static
        other = 1 - me
        planes[players[me, X], players[me, Y], _ME] = 1
        planes[players[other, X], players[other, Y], _OTHER] = 1
        planes[players[me, X], players[me, Y], _MY_FACING + players[me, FACING]] = 1
        planes[players[other, X], players[other, Y], _OTHER_FACING + players[other, FACING]] = 1
        for k in range(pots.shape[0]):
            x, y = pots[k, 0], pots[k, 1]
            inside = contents[x, y]
            if inside < COOKING:
                planes[x, y, _ONIONS_IN_POT] = inside
            else:
                planes[x, y, _ONIONS_IN_SOUP] = ONIONS_PER_SOUP
                planes[x, y, _COOKING_LEFT] = COOK_TIME - (inside - COOKING)
                if inside == READY:
                    planes[x, y, _SOUP_READY] = 1
        for k in range(counters.shape[0]):
            item = contents[counters[k, 0], counters[k, 1]]
            if item != NOTHING:
                _write_item(planes, counters[k, 0], counters[k, 1], item)
        for k in range(2):
            _write_item(planes, players[k, X], players[k, Y], players[k, HELD])
        if horizon > 0 and horizon - timestep < URGENT_TIMESTEPS:
            planes[:, :, _URGENT] = 1


@njit(cache=True)
def encode(static, pots, counters, players, contents, timestep, horizon, out):
    """The planes of many games: `out` (games, 2, width, height, 26), any 8-bit or wider integer type."""
    for game in range(players.shape[0]):
        encode_game(static, pots, counters, players[game], contents[game], timestep[game], horizon, out[game])
