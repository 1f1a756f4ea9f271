"""Parse and check layout grids. An error names the place in the grid and the remedy."""

import hashlib
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from overcooked.constants import COUNTER, FLOOR, PLAYERS, POT, STEP_X, STEP_Y, TILE_CHARACTERS
from overcooked.layout_file import LayoutError as LayoutError
from overcooked.layout_file import grid_rows, read_text
from overcooked.other_names import bundled_name
from overcooked.planes import static_planes

LAYOUT_FOLDER = Path(__file__).parent / "layouts"
_REQUIRED = {"O": "onion dispenser", "D": "dish dispenser", "P": "pot", "S": "serving station"}
_MAX_SIDE = 32


@dataclass(frozen=True, eq=False)
class Layout:
    """A kitchen. Arrays are read-only; cells are [x][y] = [column][row] from the top left corner."""

    name: str
    grid: tuple[str, ...]
    tiles: NDArray[np.int8] = field(repr=False)  # (width, height)
    starts: NDArray[np.int8] = field(repr=False)  # (players, 2): x, y
    pots: NDArray[np.int8] = field(repr=False)  # (pots, 2)
    counters: NDArray[np.int8] = field(repr=False)  # (counters, 2)

    @property
    def width(self) -> int:
        return len(self.grid[0])

    @property
    def height(self) -> int:
        return len(self.grid)

    @cached_property
    def text(self) -> str:
        """The grid as text, one row per line, without a newline at the end."""
        return "\n".join(self.grid)

    @cached_property
    def sha256(self) -> str:
        """The hash of `text`, which identifies the grid in data and checkpoints."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @cached_property
    def static_planes(self) -> NDArray[np.int8]:
        """The part of the encoding that never changes: (width, height, 26)."""
        return static_planes(self.tiles)

    @cached_property
    def static_views(self) -> NDArray[np.int8]:
        """The same for both chefs, whose views are encoded at once: (2, width, height, 26)."""
        return np.stack([self.static_planes] * PLAYERS)


def load_layout(name_or_path: str | Path) -> Layout:
    """Load a bundled layout by its name (or another name of it, see `other_names`), or a `.layout` file (a drawn grid,
    or overcooked_ai's dictionary).

    Raises LayoutError for a bad grid, FileNotFoundError (with the names there are) for an unknown layout.
    """
    path = Path(name_or_path)
    if path.suffix != ".layout":
        path = LAYOUT_FOLDER / f"{bundled_name(str(name_or_path))}.layout"
    if not path.is_file():
        known = ", ".join(layout_names())
        place = f" in {path.absolute().parent}" if path.parent != LAYOUT_FOLDER else ""
        raise FileNotFoundError(
            f"there is no layout {str(name_or_path)!r}{place}. Known: {known}; or give the path of a .layout file."
        )
    return parse_layout(read_text(path), name=path.stem, source=str(name_or_path))


def bundled_layout(name: str) -> Layout:
    """Return the bundled layout of that name; a name from a file is never used as a path.

    Raises FileNotFoundError (with the names there are) for any other name.
    """
    if bundled_name(name) not in layout_names():
        raise FileNotFoundError(f"there is no layout {name!r}. Known: {', '.join(layout_names())}; or give its grid.")
    return load_layout(name)


def bundled_grid(name: str) -> str | None:
    """Return the grid of the bundled layout of that name; None if there is none."""
    return load_layout(name).text if name in layout_names() else None


def layout_names() -> list[str]:
    """Return the names of the bundled layouts."""
    return sorted(path.stem for path in LAYOUT_FOLDER.glob("*.layout"))


def parse_layout(text: str, name: str = "layout", source: str | None = None) -> Layout:
    """Parse the layout drawn in `text`; `source` names it in errors. Raises LayoutError."""
    source = source or name
    rows = grid_rows(text, source)
    for problem in _problems(rows, source):
        raise problem
    tiles, starts = _tiles(rows), _starts(rows)
    arrays = (tiles, np.array(starts, np.int8), _cells(tiles, POT), _cells(tiles, COUNTER))
    for array in arrays:
        array.setflags(write=False)
    return Layout(name, tuple(rows), *arrays)


def layout_problems(text: str, source: str = "layout") -> list[LayoutError]:
    """Return everything that is wrong with a layout; `parse_layout` raises the first. Empty: it can be played."""
    try:
        return list(_problems(grid_rows(text, source), source))
    except LayoutError as error:
        return [error]


def _problems(rows: list[str], source: str) -> Iterator[LayoutError]:
    """Yield what is wrong with a grid. Reachability is only checked if nothing else is wrong."""
    sound = True
    for problem in _grid_problems(rows, source):
        sound = False
        yield problem
    if sound:
        yield from _reach_problems(rows, source)


def _tiles(rows: list[str]) -> NDArray[np.int8]:
    """Return the tiles (width, height) of a valid grid; start cells are floor."""
    plain = [row.replace("1", " ").replace("2", " ") for row in rows]
    return np.array([[TILE_CHARACTERS.index(tile) for tile in row] for row in plain], np.int8).T.copy()


def _starts(rows: list[str]) -> list[tuple[int, int]]:
    """Return the start cell (x, y) of each player of a valid grid."""
    cells = {tile: (x, y) for y, row in enumerate(rows) for x, tile in enumerate(row) if tile in "12"}
    return [cells[str(player)] for player in range(1, PLAYERS + 1)]


def _cells(tiles: NDArray[np.int8], tile: int) -> NDArray[np.int8]:
    """Return the cells of one kind, always in C order: numba compiles a kernel again for each memory order of an array,
    and without this a kitchen with one pot would differ from one with two."""
    return np.ascontiguousarray(np.argwhere(tiles == tile), np.int8)


def _grid_problems(rows: list[str], source: str) -> Iterator[LayoutError]:
    """Yield what keeps a grid from being a closed rectangle of known tiles with all it needs."""
    if not rows or not rows[0]:
        yield LayoutError(
            source, "the grid is empty", "Draw at least 3 rows, e.g. the bundled coordination_ring.layout."
        )
        return
    width, height = len(rows[0]), len(rows)
    starts: set[str] = set()
    for y, row in enumerate(rows):
        if len(row) != width:
            yield LayoutError(
                source,
                f"the row has {len(row)} cells, the first row has {width}",
                "Make all rows equally long (spaces are floor).",
                y + 1,
                min(len(row), width) + 1,
            )
        for x, tile in enumerate(row):
            yield from _cell_problems(tile, (x, y), (width, height), starts, source)
    if max(width, height) > _MAX_SIDE:
        yield LayoutError(
            source,
            f"the kitchen is {width} x {height} cells",
            f"At most {_MAX_SIDE} x {_MAX_SIDE} can be played.",
        )
    for player in range(1, PLAYERS + 1):
        if str(player) not in starts:
            yield LayoutError(
                source, f"player {player} has no start cell", f"Write the digit {player} on a floor cell."
            )
    text = "".join(rows)
    for tile, meaning in _REQUIRED.items():
        if tile not in text:
            yield LayoutError(
                source, f"there is no {meaning}", f"Write {tile} on a counter cell that a chef can stand next to."
            )


def _cell_problems(
    tile: str, cell: tuple[int, int], size: tuple[int, int], starts: set[str], source: str
) -> Iterator[LayoutError]:
    """Yield what is wrong with one cell; `starts`: the players whose start cell came before it."""
    (x, y), (width, height) = cell, size
    place = {"row": y + 1, "column": x + 1}
    if tile == "T":
        yield LayoutError(source, "tomatoes (T) are not served in this kitchen", "Use O (onions).", **place)
    elif tile not in TILE_CHARACTERS + "12":
        remedy = "Use X counter, O onions, D dishes, P pot, S serving, a space for floor, 1 and 2 for the chefs."
        yield LayoutError(source, f"unknown tile {tile!r}", remedy, **place)
    if tile in " 12" and (x in (0, width - 1) or y in (0, height - 1)):
        yield LayoutError(source, "the border is open here", "Close it with X or a station.", **place)
    if tile in "12":
        if tile in starts:
            yield LayoutError(source, f"player {tile} starts twice", "Keep only one of the two digits.", **place)
        starts.add(tile)


def _reach_problems(rows: list[str], source: str) -> Iterator[LayoutError]:
    """Yield each station that no chef can reach."""
    reached = reached_floor(_tiles(rows), _starts(rows))
    for y, row in enumerate(rows):
        for x, tile in enumerate(row):
            if tile in _REQUIRED and not reached & neighbours(x, y):
                remedy = "Open a floor cell next to it that a chef can walk to, or remove it."
                yield LayoutError(source, f"nobody can reach this {_REQUIRED[tile]}", remedy, y + 1, x + 1)


def reached_floor(tiles: NDArray[np.int8], starts: Iterable[tuple[int, int]]) -> set[tuple[int, int]]:
    """Return the floor cells (x, y) to which one can walk from `starts`. The border of `tiles` must be closed."""
    reached = set(starts)
    queue = deque(reached)
    while queue:
        for cell in neighbours(*queue.popleft()) - reached:
            if tiles[cell] == FLOOR:
                reached.add(cell)
                queue.append(cell)
    return reached


def neighbours(x: int, y: int) -> set[tuple[int, int]]:
    """Return the four cells next to a cell, also those outside of the grid."""
    return {(x + dx, y + dy) for dx, dy in zip(STEP_X, STEP_Y, strict=True)}
