"""Find what each chef of a kitchen can reach, alone and by handing items over. For the kitchen editor."""

from dataclasses import dataclass

from overcooked.constants import COUNTER, DISH_DISPENSER, EXIT, FLOOR, ONION_DISPENSER, POT
from overcooked.layout import Layout, neighbours, reached_floor

Cell = tuple[int, int]  # x, y
STATIONS = (ONION_DISPENSER, DISH_DISPENSER, POT, EXIT)


@dataclass(frozen=True)
class KitchenReach:
    """`stations`: for each chef the stations that it can stand next to. `shared`: counters that both can stand next to.
    `alone`: whether each chef could serve a soup without the other. `together`: whether the two can serve one.
    `unused`: floor cells to which no chef can walk."""

    stations: tuple[frozenset[Cell], frozenset[Cell]]
    shared: frozenset[Cell]
    alone: tuple[bool, bool]
    together: bool
    unused: frozenset[Cell]


def kitchen_reach(layout: Layout) -> KitchenReach:
    """Return what the chefs of a layout can reach. The other chef never blocks: it can step aside or, in a corridor,
    stand where it does not matter."""
    tiles = layout.tiles
    cells = [(x, y) for x in range(layout.width) for y in range(layout.height)]
    floors = [reached_floor(tiles, [(int(x), int(y))]) for x, y in layout.starts]
    near = [frozenset(cell for cell in cells if neighbours(*cell) & floor) for floor in floors]
    stations = [frozenset(cell for cell in around if tiles[cell] in STATIONS) for around in near]
    shared = frozenset(cell for cell in near[0] & near[1] if tiles[cell] == COUNTER)
    kinds = [{int(tiles[cell]) for cell in reached} for reached in stations]
    return KitchenReach(
        stations=(stations[0], stations[1]),
        shared=shared,
        alone=(kinds[0] >= set(STATIONS), kinds[1] >= set(STATIONS)),
        together=_can_serve(layout, stations, kinds, bool(shared)),
        unused=frozenset(cell for cell in cells if tiles[cell] == FLOOR) - floors[0] - floors[1],
    )


def _can_serve(layout: Layout, stations: list[frozenset[Cell]], kinds: list[set[int]], shares: bool) -> bool:
    """Return whether onions get into a pot, and its soup to an exit; items change hands over shared counters only."""

    def holders(chefs: set[int]) -> set[int]:
        return {0, 1} if shares and chefs else chefs

    with_onions = holders({chef for chef in (0, 1) if ONION_DISPENSER in kinds[chef]})
    with_dishes = holders({chef for chef in (0, 1) if DISH_DISPENSER in kinds[chef]})
    serving = {chef for chef in (0, 1) if EXIT in kinds[chef]}
    for pot in ((int(x), int(y)) for x, y in layout.pots):
        at_pot = {chef for chef in (0, 1) if pot in stations[chef]}
        if at_pot & with_onions and holders(at_pot & with_dishes) & serving:
            return True
    return False
