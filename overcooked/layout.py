"""Layout grids: parsed, checked, frozen. A bad grid is refused with its place and the remedy."""

import hashlib
from collections import deque
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from overcooked.constants import COUNTER, FLOOR, PLAYERS, POT, STEP_X, STEP_Y, TILE_CHARACTERS
from overcooked.layout_file import LayoutError as LayoutError
from overcooked.layout_file import grid_rows, read_text
from overcooked.observe import PLANES, static_planes
from overcooked.other_names import bundled_name

LAYOUT_FOLDER = Path(__file__).parent / "layouts"
_REQUIRED = {"O": "onion dispenser", "D": "dish dispenser", "P": "pot", "S": "exit"}
_LARGEST_SIDE = 32


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
        """The grid as drawn, one row a line, without a newline at the end."""
        return "\n".join(self.grid)

    @cached_property
    def sha256(self) -> str:
        """Name the grid in data and checkpoints: the hash of `text`."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @cached_property
    def static_planes(self) -> NDArray[np.int8]:
        """The part of the encoding that never changes: (width, height, 26)."""
        planes = np.zeros((self.width, self.height, PLANES), np.int8)
        static_planes(self.tiles, planes)
        return planes


def load_layout(name_or_path: str | Path) -> Layout:
    """A bundled layout by its name (or another one, see `other_names`), or a `.layout` file (a drawn grid, or
    overcooked_ai's dictionary).

    Raises LayoutError for a bad grid, FileNotFoundError (with the names there are) for an unknown layout.
    """
    path = Path(name_or_path)
    if path.suffix != ".layout":
        path = LAYOUT_FOLDER / f"{bundled_name(str(name_or_path))}.layout"
    if not path.is_file():
        known = ", ".join(layout_names())
        raise FileNotFoundError(
            f"there is no layout {str(name_or_path)!r}. Known: {known}; or give the path of a .layout file."
        )
    return parse_layout(read_text(path), name=path.stem, source=str(name_or_path))


def bundled_layout(name: str) -> Layout:
    """Return the bundled layout of that name; a name that came in a file never becomes a path.

    Raises FileNotFoundError (with the names there are) for any other name.
    """
    if bundled_name(name) not in layout_names():
        raise FileNotFoundError(f"there is no layout {name!r}. Known: {', '.join(layout_names())}; or give its grid.")
    return load_layout(name)


def layout_names() -> list[str]:
    """The bundled layouts."""
    return sorted(path.stem for path in LAYOUT_FOLDER.glob("*.layout"))


def parse_layout(text: str, name: str = "layout", source: str | None = None) -> Layout:
    """The layout drawn in `text`; `source` names it in errors. Raises LayoutError."""
    source = source or name
    rows = grid_rows(text, source)
    starts = _check_grid(rows, source)
    plain = [row.replace("1", " ").replace("2", " ") for row in rows]
    tiles = np.array([[TILE_CHARACTERS.index(tile) for tile in row] for row in plain], np.int8).T.copy()
    _check_reach(rows, tiles, starts, source)
    arrays = (tiles, np.array(starts, np.int8), _cells(tiles, POT), _cells(tiles, COUNTER))
    for array in arrays:
        array.setflags(write=False)
    return Layout(name, tuple(rows), *arrays)


def _cells(tiles: NDArray[np.int8], tile: int) -> NDArray[np.int8]:
    """Cells of one kind. In rows one after the other, however many there are: numba compiles a kernel again for each
    order of an array in memory, and a kitchen with one pot would differ from one with two."""
    return np.ascontiguousarray(np.argwhere(tiles == tile), np.int8)


def _check_grid(rows: list[str], source: str) -> list[tuple[int, int]]:
    """Refuse anything that is not a closed rectangle of known tiles with all it needs; return the start cells."""
    if not rows or not rows[0]:
        raise LayoutError(
            source, "the grid is empty", "Draw at least 3 rows, e.g. the bundled coordination_ring.layout."
        )
    width, height = len(rows[0]), len(rows)
    starts: dict[str, tuple[int, int]] = {}
    for y, row in enumerate(rows):
        if len(row) != width:
            raise LayoutError(
                source,
                f"the row has {len(row)} cells, the first row has {width}",
                "Make all rows equally long (spaces are floor).",
                y + 1,
                min(len(row), width) + 1,
            )
        for x, tile in enumerate(row):
            _check_cell(tile, (x, y), (width, height), starts, source)
    if max(width, height) > _LARGEST_SIDE:
        raise LayoutError(
            source,
            f"the kitchen is {width} x {height} cells",
            f"At most {_LARGEST_SIDE} x {_LARGEST_SIDE} can be played.",
        )
    for player in range(1, PLAYERS + 1):
        if str(player) not in starts:
            raise LayoutError(
                source, f"player {player} has no start cell", f"Write the digit {player} on a floor cell."
            )
    text = "".join(rows)
    for tile, meaning in _REQUIRED.items():
        if tile not in text:
            raise LayoutError(
                source, f"there is no {meaning}", f"Write {tile} on a counter cell that a chef can stand next to."
            )
    return [starts[str(player)] for player in range(1, PLAYERS + 1)]


def _check_cell(
    tile: str, cell: tuple[int, int], size: tuple[int, int], starts: dict[str, tuple[int, int]], source: str
) -> None:
    (x, y), (width, height) = cell, size
    place = {"row": y + 1, "column": x + 1}
    if tile == "T":
        raise LayoutError(source, "tomatoes (T) are not served in this kitchen", "Use O (onions).", **place)
    if tile not in TILE_CHARACTERS + "12":
        remedy = "Use X counter, O onions, D dishes, P pot, S exit, a space for floor, 1 and 2 for the chefs."
        raise LayoutError(source, f"unknown tile {tile!r}", remedy, **place)
    if tile in " 12" and (x in (0, width - 1) or y in (0, height - 1)):
        raise LayoutError(source, "the border is open here", "Close it with X or a station.", **place)
    if tile in "12":
        if tile in starts:
            raise LayoutError(source, f"player {tile} starts twice", "Leave one of the two digits.", **place)
        starts[tile] = cell


def _check_reach(rows: list[str], tiles: NDArray[np.int8], starts: list[tuple[int, int]], source: str) -> None:
    """Refuse a station that nobody can stand next to, however the chefs walk."""
    reached = set(starts)
    queue = deque(starts)
    while queue:
        x, y = queue.popleft()
        for dx, dy in zip(STEP_X, STEP_Y, strict=True):
            cell = (x + dx, y + dy)
            if tiles[cell] == FLOOR and cell not in reached:
                reached.add(cell)
                queue.append(cell)
    for y, row in enumerate(rows):
        for x, tile in enumerate(row):
            if tile in _REQUIRED and not any(
                (x + dx, y + dy) in reached for dx, dy in zip(STEP_X, STEP_Y, strict=True)
            ):
                remedy = "Open a floor cell next to it that a chef can walk to, or remove it."
                raise LayoutError(source, f"nobody can reach this {_REQUIRED[tile]}", remedy, y + 1, x + 1)
