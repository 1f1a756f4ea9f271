"""Work out what a kitchen needs next, from one chef's observation: for the scripted cooks."""

from models.agents.observation_parser import Cell, ParsedObservation
from overcooked.constants import DISH, ONION, ONIONS_PER_SOUP, SOUP

_URGENT = 8  # a dish should be fetched when its soup is ready in at most this many timesteps


def missing_onions(seen: ParsedObservation) -> int:
    """Count the onions that pots still need and the other chef is not carrying."""
    wanted = sum(ONIONS_PER_SOUP - pot.onions for pot in seen.pots if pot.left is None)
    return wanted - (seen.other_held == ONION)


def soups_without_dish(seen: ParsedObservation) -> int:
    """Count the soups, cooking or ready, for which the other chef is not carrying a dish."""
    return sum(pot.left is not None for pot in seen.pots) - (seen.other_held == DISH)


def is_dish_urgent(seen: ParsedObservation) -> bool:
    """Return whether a soup is ready, or will be soon."""
    return any(pot.left is not None and pot.left <= _URGENT for pot in seen.pots)


def places_for_what_is_held(seen: ParsedObservation) -> list[tuple[Cell, ...]]:
    """Return where to put the held item: groups of cells, the best first; empty if there is no place for it yet."""
    if seen.held == SOUP:
        return [seen.exits]
    if seen.held == ONION:
        hungry = sorted((pot for pot in seen.pots if pot.left is None), key=lambda pot: -pot.onions)
        return [(pot.cell,) for pot in hungry]
    cooking = sorted((pot for pot in seen.pots if pot.left is not None), key=lambda pot: pot.left or 0)
    ready = tuple(pot.cell for pot in cooking if pot.left == 0)
    return [ready, tuple(pot.cell for pot in cooking)] if cooking else []
