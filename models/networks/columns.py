"""Find the entries of the encoding that can change in a layout: the inputs of small networks. Numpy only."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from overcooked.constants import COOKING, DISH, FLOOR, HORIZON, ONION, ONIONS_PER_SOUP, READY, SOUP
from overcooked.layout import Layout, parse_layout
from overcooked.planes import PLANES
from overcooked.state import Kitchens


def varying_columns(layout: Layout, distinct: bool = True) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Return the entries of the flat encoding (width * height * 26) that ever change in a layout, and the largest value
    of each. Found by enumeration: one state for every chef's cell, facing and hand, every item on every counter, every
    pot's contents and the end of the episode. `distinct` keeps one of entries that are always equal (the urgency
    plane).
    """
    columns, largest = _found(layout.text, distinct)
    return columns.copy(), largest.copy()


@lru_cache(maxsize=64)  # every model of a layout calls this
def _found(grid: str, distinct: bool) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    layout = parse_layout(grid, "grid")
    seen = _all_single_changes(layout).encode(horizon=HORIZON)[:, 0].reshape(-1, layout.width * layout.height * PLANES)
    columns = np.flatnonzero((seen != seen[0]).any(axis=0)).astype(np.int64)
    if distinct:
        values = np.ascontiguousarray(seen[:, columns].T)  # (columns, states)
        first = {column.tobytes(): place for place, column in reversed(list(enumerate(values)))}
        columns = columns[sorted(first.values())]
    return columns, seen[:, columns].max(axis=0).astype(np.float32)


def _all_single_changes(layout: Layout) -> Kitchens:
    """Return states that differ from the start in one thing each (two chefs may share a cell: the states are only
    encoded)."""
    floor = np.argwhere(layout.tiles == FLOOR)
    chefs = [(k, x, y, f, h) for k in range(2) for x, y in floor.tolist() for f in range(4) for h in range(4)]
    pots = [c for c in range(1, READY + 1) if c not in (ONIONS_PER_SOUP, COOKING)]
    things = [(x, y, c) for x, y in layout.pots.tolist() for c in pots]
    things += [(x, y, c) for x, y in layout.counters.tolist() for c in (ONION, DISH, SOUP)]
    states = Kitchens.start(layout, 2 + len(chefs) + len(things))
    states.timestep[1] = HORIZON - 1
    for game, (k, *row) in enumerate(chefs, start=2):
        states.players[game, k] = row
    for game, (x, y, inside) in enumerate(things, start=2 + len(chefs)):
        states.contents[game, x, y] = inside
    return states
