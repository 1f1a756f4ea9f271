"""Tiles, items, directions, actions and events as the integers that every package shares."""

from typing import Final

# Tiles of a layout grid.
FLOOR: Final = 0
COUNTER: Final = 1
ONION_DISPENSER: Final = 2
DISH_DISPENSER: Final = 3
POT: Final = 4
EXIT: Final = 5
TILE_CHARACTERS: Final = " XODPS"

# What a hand or a counter holds.
NOTHING: Final = 0
ONION: Final = 1
DISH: Final = 2
SOUP: Final = 3
ITEM_NAMES: Final = (None, "onion", "dish", "soup")

# Actions; the first four are also the directions a chef can face.
NORTH: Final = 0
SOUTH: Final = 1
EAST: Final = 2
WEST: Final = 3
STAY: Final = 4
INTERACT: Final = 5
ACTIONS: Final = 6
STEP_X: Final = (0, 0, 1, -1)
STEP_Y: Final = (-1, 1, 0, 0)

# The contents of a pot's cell: 0-2 onions waiting, 3 onions not cooking, then COOKING + tick (0-20).
ONIONS_PER_SOUP: Final = 3
COOKING: Final = 4
COOK_TIME: Final = 20
READY: Final = COOKING + COOK_TIME

# Columns of a player's row in the state.
X: Final = 0
Y: Final = 1
FACING: Final = 2
HELD: Final = 3

PLAYERS: Final = 2
HORIZON: Final = 400

# Events of one player in one timestep are bits of one integer. The names are overcooked_ai's EVENT_TYPES, except for
# the last one, which distinguishes a soup lifted from a pot (rewarded) from one taken off a counter (not rewarded).
ONION_PICKUP: Final = 1 << 0
USEFUL_ONION_PICKUP: Final = 1 << 1
ONION_DROP: Final = 1 << 2
USEFUL_ONION_DROP: Final = 1 << 3
POTTING_ONION: Final = 1 << 4
OPTIMAL_ONION_POTTING: Final = 1 << 5
VIABLE_ONION_POTTING: Final = 1 << 6
DISH_PICKUP: Final = 1 << 7
USEFUL_DISH_PICKUP: Final = 1 << 8
DISH_DROP: Final = 1 << 9
USEFUL_DISH_DROP: Final = 1 << 10
SOUP_PICKUP: Final = 1 << 11
SOUP_DELIVERY: Final = 1 << 12
SOUP_DROP: Final = 1 << 13
SOUP_FROM_POT: Final = 1 << 14
EVENT_NAMES: Final = (
    "onion_pickup",
    "useful_onion_pickup",
    "onion_drop",
    "useful_onion_drop",
    "potting_onion",
    "optimal_onion_potting",
    "viable_onion_potting",
    "dish_pickup",
    "useful_dish_pickup",
    "dish_drop",
    "useful_dish_drop",
    "soup_pickup",
    "soup_delivery",
    "soup_drop",
)
