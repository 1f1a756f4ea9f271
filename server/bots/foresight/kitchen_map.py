"""A layout's stations and the precomputed paths to them. A cell is one number here: x * height + y."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from overcooked.constants import COUNTER, FLOOR, INTERACT, STEP_X, STEP_Y, TILE_CHARACTERS
from overcooked.layout import Layout

FAR: Final = 9999  # ticks to a station that cannot be reached
_MAX_WITH_DETOURS: Final = 150  # cells of a kitchen for which paths around a partner are precomputed


class KitchenMap(NamedTuple):
    """Arrays of one layout; s counts the stations (the cells next to the floor that are not floor), c all cells."""

    tiles: NDArray[np.int8]  # (width, height)
    pots: NDArray[np.int8]  # (pots, 2)
    counters: NDArray[np.int8]  # (counters, 2)
    cell: NDArray[np.int64]  # (s,): where the station is
    kind: NDArray[np.int64]  # (s,): its tile
    reach: NDArray[np.int16]  # (s, c, 4): ticks until a chef in that cell with that facing faces the station, if alone
    first: NDArray[np.int64]  # (s, c, 4): the first action of that way; INTERACT where the station is faced
    between: NDArray[np.int64]  # (s, s): ticks from having used one to facing the other
    ahead: NDArray[np.int64]  # (c, 4): the cell that a move leads to; the same one where something blocks
    around: NDArray[np.int16]  # (c, s, c, 4): `reach` where nobody can walk through the first cell; empty: too large
    shared: NDArray[np.int64]  # (s,): 1 where two chefs can use the station at once, from different cells
    crowded: NDArray[np.int64]  # (c,): how many stations but counters are next to the cell
    usable: NDArray[np.int64]  # (c, tiles): 1 where a chef in that cell can get to such a tile


_maps: dict[str, KitchenMap] = {}


def kitchen_map(layout: Layout) -> KitchenMap:
    """Return the map of a layout, made once."""
    if layout.sha256 not in _maps:
        _maps[layout.sha256] = _made(layout)
    return _maps[layout.sha256]


def _made(layout: Layout) -> KitchenMap:
    tiles, height = layout.tiles.ravel(), layout.height
    offsets = [STEP_X[d] * height + STEP_Y[d] for d in range(4)]
    floor = [int(cell) for cell in np.flatnonzero(tiles == FLOOR)]
    cells = sorted({cell + step for cell in floor for step in offsets if tiles[cell + step] != FLOOR})
    ahead = np.arange(tiles.size)[:, None].repeat(4, 1)
    faces = np.zeros((len(cells), tiles.size, 4), bool)
    crowded, usable = np.zeros(tiles.size, np.int64), np.zeros((tiles.size, len(TILE_CHARACTERS)), np.int64)
    for cell in floor:
        for d, step in enumerate(offsets):
            if tiles[cell + step] == FLOOR:
                ahead[cell, d] = cell + step
            else:
                faces[cells.index(cell + step), cell, d] = True
                crowded[cell] += tiles[cell + step] != COUNTER
    reach = _ways(ahead, faces)
    first = np.where(faces, INTERACT, _moved(reach, ahead).argmin(2)[:, :, None]).astype(np.int64)
    kind = tiles[cells].astype(np.int64)
    for station, ticks in enumerate(reach):
        usable[ticks.min(1) < FAR, kind[station]] = 1
    between = np.array([[ticks[near].min() for ticks in reach] for near in faces], np.int64)
    np.fill_diagonal(between, 0)
    shared = (faces.any(2).sum(1) > 1).astype(np.int64)
    around = reach[None, :0]
    if tiles.size <= _MAX_WITH_DETOURS:
        around = np.stack([_ways(np.where(ahead == cell, _stay(ahead), ahead), faces) for cell in range(tiles.size)])
    return KitchenMap(
        layout.tiles, layout.pots, layout.counters, np.array(cells, np.int64), kind, reach, first, between, ahead,
        around, shared, crowded, usable,
    )  # fmt: skip


def _stay(ahead: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.arange(len(ahead))[:, None]


def _moved(reach: NDArray[np.int16], ahead: NDArray[np.int64]) -> NDArray[np.int16]:
    """Return (s, c, 4): the ticks that are left after each move. A move turns the chef, whatever it faced before."""
    return np.stack([reach[:, ahead[:, d], d] for d in range(4)], axis=2)


def _ways(ahead: NDArray[np.int64], faces: NDArray[np.bool_]) -> NDArray[np.int16]:
    """Return (s, c, 4): the ticks until each station is faced."""
    reach = np.where(faces, 0, FAR).astype(np.int16)
    while True:
        nearer = np.minimum(_moved(reach, ahead).min(2) + 1, FAR)[:, :, None]
        again = np.where(faces, 0, nearer).astype(np.int16)
        if (again == reach).all():
            return reach
        reach = again
