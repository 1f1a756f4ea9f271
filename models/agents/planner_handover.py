"""The scripted cook's goals in a kitchen whose two halves are separated, where items pass over shared counters. Only
used if a chef cannot walk to every kind of station (Forced Coordination); otherwise `planner` decides alone.
"""

from collections.abc import Collection

from models.agents import kitchen_needs
from models.agents.observation_parser import Cell, ParsedObservation
from overcooked.constants import DISH, NOTHING, ONION, SOUP, STEP_X, STEP_Y


def must_hand_over(seen: ParsedObservation, mine: Collection[Cell]) -> bool:
    """Return whether the other chef is out of reach, and so is some kind of station. `mine`: cells that this chef can
    walk to."""
    if seen.other in mine:
        return False
    pots = tuple(pot.cell for pot in seen.pots)
    return not all(_within(stations, mine) for stations in (pots, seen.onions, seen.dishes, seen.exits))


def goals(seen: ParsedObservation, mine: Collection[Cell], theirs: Collection[Cell]) -> list[tuple[Cell, ...]]:
    """Return groups of cells to use, the most useful first. `theirs`: cells that the other chef can walk to."""
    shared = [cell for cell in (*seen.free_counters, *seen.items) if _touches(cell, mine) and _touches(cell, theirs)]
    free = tuple(cell for cell in shared if cell not in seen.items)
    lying = [seen.items[cell] for cell in shared if cell in seen.items]
    if seen.held != NOTHING:
        return [*kitchen_needs.places_for_what_is_held(seen), free]
    soup_cooks = any(pot.left is not None for pot in seen.pots)
    missing, dishes_missing = kitchen_needs.missing_onions(seen), kitchen_needs.soups_without_dish(seen)
    cooks = _within(tuple(pot.cell for pot in seen.pots), mine)
    if not cooks:
        missing -= lying.count(ONION)
        dishes_missing -= lying.count(DISH)
    dish, onion, soup = (
        (*dispensers, *(cell for cell, here in seen.items.items() if here == item and (cooks or cell not in shared)))
        for item, dispensers in ((DISH, seen.dishes), (ONION, seen.onions), (SOUP, ()))
    )
    wanted = [soup]
    if dishes_missing > 0 and (kitchen_needs.is_dish_urgent(seen) or missing <= 0) and (cooks or free):
        wanted.append(dish)
    if missing > 0 and (cooks or len(free) > soup_cooks):  # while a soup cooks, keep the last free counter for its dish
        wanted.append(onion)
    return wanted


def _within(stations: tuple[Cell, ...], cells: Collection[Cell]) -> bool:
    return any(_touches(station, cells) for station in stations)


def _touches(station: Cell, cells: Collection[Cell]) -> bool:
    return any((station[0] - STEP_X[k], station[1] - STEP_Y[k]) in cells for k in range(len(STEP_X)))
