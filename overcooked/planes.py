"""The meaning of each plane of an encoded state, and the planes that never change in a layout.

Without numba, so that reading a layout does not load it.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from overcooked.constants import COUNTER, DISH_DISPENSER, EXIT, ONION_DISPENSER, POT

PLANES: Final = 26
ME, OTHER, MY_FACING, OTHER_FACING = 0, 1, 2, 6  # facings: four planes each
STATIC: Final = {10: POT, 11: COUNTER, 12: ONION_DISPENSER, 14: DISH_DISPENSER, 15: EXIT}  # plane -> tile
CONTENT, CONTENT_PLANES = 16, 8  # what lies in a cell or is held there
ONIONS_IN_POT, ONIONS_IN_SOUP, COOKING_LEFT, SOUP_READY, LYING_DISH, LYING_ONION = 16, 18, 20, 21, 22, 23
URGENT = 25


def static_planes(tiles: NDArray[Any]) -> NDArray[np.int8]:
    """Return the planes that never change in a layout, the others empty: (width, height, 26)."""
    planes = np.zeros((*tiles.shape, PLANES), np.int8)
    for plane, tile in STATIC.items():
        planes[:, :, plane] = tiles == tile
    return planes
