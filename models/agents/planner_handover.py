"""What the scripted cook wants in a kitchen whose two halves are separated: things pass over shared counters.

Only used where a chef cannot walk to all kinds of stations (Forced Coordination); elsewhere `planner` decides alone.
"""

from collections.abc import Collection

from models.agents.observation_parser import Cell, ParsedObservation
from overcooked.constants import DISH, NOTHING, ONION, ONIONS_PER_SOUP, SOUP, STEP_X, STEP_Y

_SOON = 8  # timesteps until a soup is ready, in which its dish should be on the way


def must_hand_over(seen: ParsedObservation, mine: Collection[Cell]) -> bool:
    """Whether the other chef is out of reach, and so is some kind of station. `mine`: cells that I can walk to."""
    if seen.other in mine:
        return False
    pots = tuple(pot.cell for pot in seen.pots)
    return not all(_within(stations, mine) for stations in (pots, seen.onions, seen.dishes, seen.exits))


def wishes(seen: ParsedObservation, mine: Collection[Cell], theirs: Collection[Cell]) -> list[tuple[Cell, ...]]:
    """Groups of cells to use, the most wanted first. `theirs`: cells that the other chef can walk to."""
    shared = [cell for cell in (*seen.free_counters, *seen.items) if _touches(cell, mine) and _touches(cell, theirs)]
    free = tuple(cell for cell in shared if cell not in seen.items)
    lying = [seen.items[cell] for cell in shared if cell in seen.items]
    if seen.held != NOTHING:
        return [*_places(seen, seen.held), free]
    soups = sum(pot.left is not None for pot in seen.pots)
    soon = any(pot.left is not None and pot.left <= _SOON for pot in seen.pots)
    missing = sum(ONIONS_PER_SOUP - pot.onions for pot in seen.pots if pot.left is None) - (seen.other_held == ONION)
    dishes_missing = soups - (seen.other_held == DISH)
    cooks = _within(tuple(pot.cell for pot in seen.pots), mine)
    if not cooks:
        missing -= lying.count(ONION)
        dishes_missing -= lying.count(DISH)
    dish, onion, soup = (
        (*dispensers, *(cell for cell, here in seen.items.items() if here == item and (cooks or cell not in shared)))
        for item, dispensers in ((DISH, seen.dishes), (ONION, seen.onions), (SOUP, ()))
    )
    wanted = [soup]
    if dishes_missing > 0 and (soon or missing <= 0) and (cooks or free):
        wanted.append(dish)
    if missing > 0 and (cooks or len(free) > (soups > 0)):  # while a soup cooks, the last free counter is for its dish
        wanted.append(onion)
    return wanted


def _places(seen: ParsedObservation, held: int) -> list[tuple[Cell, ...]]:
    """Where the thing in hand belongs."""
    if held == SOUP:
        return [seen.exits]
    if held == ONION:
        hungry = sorted((pot for pot in seen.pots if pot.left is None), key=lambda pot: -pot.onions)
        return [(pot.cell,) for pot in hungry]
    return [tuple(pot.cell for pot in sorted(seen.pots, key=lambda pot: pot.left or 0) if pot.left is not None)]


def _within(stations: tuple[Cell, ...], cells: Collection[Cell]) -> bool:
    return any(_touches(station, cells) for station in stations)


def _touches(station: Cell, cells: Collection[Cell]) -> bool:
    return any((station[0] - STEP_X[k], station[1] - STEP_Y[k]) in cells for k in range(len(STEP_X)))
