"""Encode a state as planes: overcooked_ai's lossless encoding. The meaning of each plane is in `planes`."""

import numpy as np

from overcooked.compiled import inlined_kernel, kernel
from overcooked.constants import (
    COOK_TIME,
    COOKING,
    DISH,
    FACING,
    HELD,
    NOTHING,
    ONION,
    ONIONS_PER_SOUP,
    READY,
    SOUP,
    X,
    Y,
)
from overcooked.planes import (
    CONTENT,
    CONTENT_PLANES,
    COOKING_LEFT,
    LYING_DISH,
    LYING_ONION,
    ME,
    MY_FACING,
    ONIONS_IN_POT,
    ONIONS_IN_SOUP,
    OTHER,
    OTHER_FACING,
    PLANES,
    SOUP_READY,
    URGENT,
)

URGENT_TIMESTEPS = 40
# Unsigned, as they are added to unsigned cells: numba turns a sum of uint64 and int64 into a float. It also skips the
# check for a negative index if the index is unsigned.
_ME, _OTHER, _URGENT = np.uint64(ME), np.uint64(OTHER), np.uint64(URGENT)
_MY_FACING, _OTHER_FACING = np.uint64(MY_FACING), np.uint64(OTHER_FACING)


def _packed(planes: dict[int, int]) -> int:
    """Return the planes 16 to 23 of one cell as one integer, the first in the lowest byte."""
    return sum(value << 8 * (plane - CONTENT) for plane, value in planes.items())


def _pot(inside: int) -> int:
    if inside < COOKING:
        return _packed({ONIONS_IN_POT: inside})
    ready = int(inside == READY)
    left = COOK_TIME - (inside - COOKING)
    return _packed({ONIONS_IN_SOUP: ONIONS_PER_SOUP, COOKING_LEFT: left, SOUP_READY: ready})


_SOUP_PLANES = {ONIONS_IN_SOUP: ONIONS_PER_SOUP, SOUP_READY: 1}
_ITEM_PLANES = {NOTHING: {}, ONION: {LYING_ONION: 1}, DISH: {LYING_DISH: 1}, SOUP: _SOUP_PLANES}
_POTS = np.array([_pot(inside) for inside in range(READY + 1)], np.uint64)  # by what is in the pot
_ITEMS = np.array([_packed(_ITEM_PLANES[item]) for item in range(len(_ITEM_PLANES))], np.uint64)


@inlined_kernel
def _cell(x, y, contents):
    """Return where the planes of a cell begin in the flat view of what one chef sees."""
    return (x * np.uint64(contents.shape[2]) + y) * np.uint64(PLANES)


@inlined_kernel
def _draw(out, cell, planes):
    """Write eight planes of a cell. The compiler makes one store of the eight."""
    for k in range(CONTENT_PLANES):
        out[cell + np.uint64(CONTENT + k)] = (planes >> np.uint64(8 * k)) & np.uint64(0xFF)


@inlined_kernel
def _draw_contents(cells, planes, contents, game, out, first, second):
    """Write the contents of these cells into both views. Writing an empty cell costs less than a branch."""
    for k in range(cells.shape[0]):
        x, y = np.uint64(cells[k, 0]), np.uint64(cells[k, 1])
        cell = _cell(x, y, contents)
        inside = planes[np.uint64(contents[game, x, y])]
        _draw(out, first + cell, inside)
        _draw(out, second + cell, inside)


@inlined_kernel
def encode_game(static, pots, counters, players, contents, timestep, horizon, out, game):
    """Write the planes of one of many games for both chefs. [lossless_state_encoding]

    `static` is the flat view of `Layout.static_views` (2, width, height, 26); `out` is the flat view of (games, 2,
    width, height, 26), of which row `game` is written: [k] is what chef k sees, channels last. A horizon of 0 means an
    endless game (the urgency plane stays empty). Flat and unsigned, as only then the copy of the static planes is
    compiled to wide moves; all games' arrays and an index, as a view of one game costs more than its encoding.
    """
    size = np.uint64(static.size)
    first = np.uint64(game) * size
    second = first + size // np.uint64(2)
    for i in range(size):
        out[first + i] = static[i]
    _draw_contents(pots, _POTS, contents, game, out, first, second)
    _draw_contents(counters, _ITEMS, contents, game, out, first, second)
    for chef in range(2):
        cell = _cell(np.uint64(players[game, chef, X]), np.uint64(players[game, chef, Y]), contents)
        mine = first + cell if chef == 0 else second + cell
        others = second + cell if chef == 0 else first + cell
        facing, held = np.uint64(players[game, chef, FACING]), _ITEMS[np.uint64(players[game, chef, HELD])]
        out[mine + _ME] = 1
        out[others + _OTHER] = 1
        out[mine + _MY_FACING + facing] = 1
        out[others + _OTHER_FACING + facing] = 1
        _draw(out, mine, held)
        _draw(out, others, held)
    if horizon > 0 and horizon - timestep[game] < URGENT_TIMESTEPS:
        for cell in range(first, first + size, np.uint64(PLANES)):
            out[cell + _URGENT] = 1


@kernel
def encode(static, pots, counters, players, contents, timestep, horizon, out):
    """Write the planes of many games: `out` (games, 2, width, height, 26), contiguous, any 8-bit or wider integer
    type."""
    flat_static, flat = static.reshape(-1), out.reshape(-1)
    for game in range(players.shape[0]):
        encode_game(flat_static, pots, counters, players, contents, timestep, horizon, flat, game)
