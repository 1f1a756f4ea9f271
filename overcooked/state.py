"""The state of many games: three arrays and the operations on them."""

import hashlib
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overcooked import observe, rules
from overcooked.constants import (
    COOK_TIME,
    COOKING,
    COUNTER,
    FLOOR,
    HORIZON,
    ITEM_NAMES,
    NOTHING,
    ONIONS_PER_SOUP,
    PLAYERS,
    POT,
    STEP_X,
)
from overcooked.layout import Layout
from overcooked.planes import PLANES

Record = dict[str, Any]


@dataclass(eq=False)
class Kitchens:
    """`games` games on one layout. The arrays may be views into others' buffers; `step` changes them in place."""

    layout: Layout
    players: NDArray[np.int8]  # (games, 2, 4): x, y, facing, held
    contents: NDArray[np.int8]  # (games, width, height)
    timestep: NDArray[np.int32]  # (games,)

    @classmethod
    def start(cls, layout: Layout, games: int = 1) -> "Kitchens":
        """Return games in the standard start state: fixed positions, facing north, empty hands and pots, timestep 0.
        [get_standard_start_state]"""
        players = np.zeros((games, PLAYERS, 4), np.int8)
        players[:, :, :2] = layout.starts
        contents = np.zeros((games, layout.width, layout.height), np.int8)
        return cls(layout, players, contents, np.zeros(games, np.int32))

    @property
    def games(self) -> int:
        return len(self.timestep)

    def step(self, actions: NDArray[np.integer[Any]], events: NDArray[np.int32]) -> None:
        """Play one timestep of every game. `actions` (games, 2) in 0-5; `events` (games, 2) out, see `score`."""
        layout = self.layout
        rules.step(
            layout.tiles, layout.pots, layout.counters, self.players, self.contents, self.timestep, actions, events
        )

    def encode(self, out: NDArray[Any] | None = None, horizon: int = HORIZON) -> NDArray[Any]:
        """Encode what each chef sees: (games, 2, width, height, 26). Raises ValueError for an unsuitable `out`."""
        layout = self.layout
        shape = (self.games, PLAYERS, layout.width, layout.height, PLANES)
        if out is None:
            out = np.empty(shape, np.int8)
        elif out.shape != shape or not out.flags.c_contiguous:
            raise ValueError(f"observations must be a contiguous array of shape {shape}, not {out.shape}")
        observe.encode(
            layout.static_views, layout.pots, layout.counters, self.players, self.contents, self.timestep, horizon, out
        )
        return out

    def copy(self) -> "Kitchens":
        return Kitchens(self.layout, self.players.copy(), self.contents.copy(), self.timestep.copy())

    def hash(self, game: int = 0) -> str:
        """Return 16 hexadecimal digits, the same on every machine, see `state_hash`."""
        now = int(self.timestep[game])
        return state_hash(self.layout, now, self.players[game].tobytes(), self.contents[game].tobytes())

    def record(self, game: int = 0) -> Record:
        """Return the state as plain data, cells in ascending order: the schema of the reference recordings.

        `t`, `p` [x, y, facing, held], `c` counters [x, y, item], `pots` [x, y, onions, tick] (tick -1: not
        cooking; 20: ready).
        """
        contents = self.contents[game]
        pots = []
        for x, y in self.layout.pots.tolist():
            inside = int(contents[x, y])
            if inside >= COOKING:
                pots.append([x, y, ONIONS_PER_SOUP, inside - COOKING])
            elif inside:
                pots.append([x, y, inside, -1])
        counters = [
            [x, y, ITEM_NAMES[contents[x, y]]] for x, y in self.layout.counters.tolist() if contents[x, y] != NOTHING
        ]
        players = [[x, y, facing, ITEM_NAMES[held]] for x, y, facing, held in self.players[game].tolist()]
        return {"t": int(self.timestep[game]), "p": players, "c": counters, "pots": pots}

    def restore(self, record: Record, game: int = 0) -> None:
        """Set the state from a `record`. An invalid record raises ValueError or KeyError and changes nothing."""
        layout = self.layout
        players = [(x, y, facing, ITEM_NAMES.index(held)) for x, y, facing, held in record["p"]]
        if len(players) != PLAYERS:
            raise ValueError(f"the state has {len(players)} chefs, not {PLAYERS}")
        for x, y, facing, _ in players:
            _check_cell(layout, x, y, FLOOR, "a chef")
            if not 0 <= facing < len(STEP_X):
                raise ValueError(f"a chef cannot face {facing}: 0 N 1 S 2 E 3 W")
        contents = np.zeros_like(self.contents[game])
        for x, y, item in record["c"]:
            _check_cell(layout, x, y, COUNTER, "an object")
            contents[x, y] = ITEM_NAMES.index(item)
        for x, y, onions, tick in record["pots"]:
            _check_cell(layout, x, y, POT, "a soup")
            if not (
                (onions == ONIONS_PER_SOUP and -1 <= tick <= COOK_TIME) or (0 < onions < ONIONS_PER_SOUP and tick == -1)
            ):
                raise ValueError(f"a pot cannot have {onions} onions at tick {tick}")
            contents[x, y] = onions if tick < 0 else COOKING + tick
        self.timestep[game] = record["t"]
        self.players[game] = players
        self.contents[game] = contents


def state_hash(layout: Layout, timestep: int, players: bytes, contents: bytes) -> str:
    """Return 16 hexadecimal digits, the same on every machine.

    BLAKE2b-64 of the layout's hash, the timestep (int32, little endian), the players' rows and the contents [x][y]
    (int8).
    """
    digest = _begun_hash(layout.sha256).copy()
    digest.update(timestep.to_bytes(4, "little") + players + contents)
    return digest.hexdigest()


@cache
def _begun_hash(layout_sha256: str) -> "hashlib.blake2b":
    return hashlib.blake2b(bytes.fromhex(layout_sha256), digest_size=8)


def _check_cell(layout: Layout, x: int, y: int, tile: int, what: str) -> None:
    if not (0 <= x < layout.width and 0 <= y < layout.height and layout.tiles[x, y] == tile):
        raise ValueError(f"{what} cannot be at column {x}, row {y} (from 0) of {layout.name}")
