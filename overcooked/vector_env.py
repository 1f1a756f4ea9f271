"""Many games on one layout for training: one compiled call steps, scores, resets and encodes all of them.

All output is written into arrays of the caller.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from overcooked import score
from overcooked.compiled import inlined_kernel, kernel, threaded_kernel
from overcooked.constants import COOKING, FACING, FLOOR, HELD, HORIZON, ONIONS_PER_SOUP, PLAYERS, READY, STEP_X, X, Y
from overcooked.layout import Layout
from overcooked.observe import encode_game
from overcooked.planes import PLANES
from overcooked.rules import step_game
from overcooked.state import Kitchens

_DIRECTIONS = len(STEP_X)
_ITEMS = 4
_ONE_IN = 1 << 24  # probabilities are compared in 24 bits
# Columns of an episode's running sums and of a finished episode.
_SPARSE, _SHAPED_FIRST, _SHAPED_SECOND, _LENGTH, _STANDARD = 0, 1, 2, 3, 4
_sparse_reward, _shaped_reward = inlined_kernel(score.sparse_reward), inlined_kernel(score.shaped_reward)


class Finished(NamedTuple):
    """Episodes that ended, oldest first."""

    sparse: NDArray[np.int32]  # (episodes,): points of the team
    shaped: NDArray[np.int32]  # (episodes, 2): shaping by chef
    timesteps: NDArray[np.int32]  # (episodes,): how many the episode had; fewer than the horizon after a late start
    standard: NDArray[np.bool_]  # (episodes,): began at timestep 0 in the standard start state


@dataclass(frozen=True)
class Starts:
    """How episodes begin: in the standard start state by default."""

    desynchronised: bool = False  # the first episode of every game begins at a random timestep
    random_share: float = 0.0  # of episodes that begin in a random state: cells, facings, hands and pots


class VectorEnv:
    """`games` games on `layout`, each reset by itself after `horizon` timesteps; `seed` decides the random starts."""

    def __init__(
        self, layout: Layout, games: int, horizon: int = HORIZON, starts: Starts | None = None, seed: int = 0
    ) -> None:
        if games < 1 or horizon < 1:
            raise ValueError(f"games ({games}) and horizon ({horizon}) must be at least 1")
        self.layout, self.games, self.horizon = layout, games, horizon
        self.starts = starts or Starts()
        self.kitchens = Kitchens.start(layout, games)
        self.observation_shape = (PLAYERS, layout.width, layout.height, PLANES)
        self.events = np.zeros((games, PLAYERS), np.int32)  # of the last timestep, see `constants`
        self._random = np.random.SeedSequence(seed).generate_state(games, np.uint64)  # (games,): splitmix64 states
        self._random_chance = round(self.starts.random_share * _ONE_IN)
        self._cells = _walkable_cells(layout)
        self._sums = np.zeros((games, 5), np.int32)
        self._finished = np.zeros((max(4 * games, 1024), 5), np.int32)  # a ring: the oldest are overwritten
        self._finished_count = np.zeros(1, np.int64)
        self._no_observations = np.empty((0, *self.observation_shape), np.int8)
        self.reset()

    def reset(self, observations: NDArray[Any] | None = None) -> None:
        """Start a new episode in every game. `observations` (games, 2, width, height, 26) int8 out, if given."""
        kitchens = self.kitchens
        for game in range(self.games):
            _begin(
                self.layout.starts, self._cells, self.layout.pots, kitchens.players[game], kitchens.contents[game],
                self._sums[game], self._random, game, self._random_chance,
            )  # fmt: skip
        kitchens.timestep[:] = 0
        if self.starts.desynchronised:
            phases = np.random.default_rng(self._random).integers(self.horizon, size=self.games)
            kitchens.timestep[:] = phases
            self._sums[:, _STANDARD] &= phases == 0
        if observations is not None:
            kitchens.encode(observations, self.horizon)

    def step(
        self,
        actions: NDArray[np.integer[Any]],  # (games, 2) in 0-5, not checked
        sparse: NDArray[Any],  # (games, 2) out: points by chef, add the two for the team's
        shaped: NDArray[Any],  # (games, 2) out: shaping by chef
        dones: NDArray[np.bool_],  # (games,) out: the episode ended with this timestep
        observations: NDArray[Any] | None = None,  # (games, 2, width, height, 26) out; None: not encoded
    ) -> None:
        """Play one timestep of every game. A game that ended restarts at once: it shows the new episode's first
        state."""
        layout, kitchens = self.layout, self.kitchens
        if observations is None:
            observations = self._no_observations
        elif observations.shape != (self.games, *self.observation_shape) or not observations.flags.c_contiguous:
            raise ValueError(
                f"observations must be contiguous, (games, {self.observation_shape}), not {observations.shape}"
            )
        if not len(actions) == len(sparse) == len(shaped) == len(dones) == self.games:
            raise ValueError(f"actions, rewards and dones must have {self.games} rows, one a game")
        _step(
            layout.tiles, layout.pots, layout.counters, layout.starts, self._cells, layout.static_views,
            kitchens.players, kitchens.contents, kitchens.timestep, self.horizon, self._random, self._random_chance,
            self._sums, self._finished, self._finished_count,
            actions, self.events, sparse, shaped, dones,
            observations,
        )  # fmt: skip

    def encode(self, observations: NDArray[Any]) -> None:
        """Encode the current states as the chefs see them: `observations` (games, 2, width, height, 26) out."""
        self.kitchens.encode(observations, self.horizon)

    def state(self) -> dict[str, NDArray[Any]]:
        """Return everything that determines how the games continue, as arrays to store (views: copy what you keep)."""
        kitchens = self.kitchens
        arrays: dict[str, NDArray[Any]] = {
            "players": kitchens.players,
            "contents": kitchens.contents,
            "timestep": kitchens.timestep,
        }
        return {**arrays, "sums": self._sums, "random": self._random}

    def restore(self, state: dict[str, NDArray[Any]]) -> None:
        """Continue from what `state` gave in an environment of the same layout, games, horizon and starts."""
        for name, array in self.state().items():
            array[:] = state[name]

    def take_finished(self) -> Finished:
        """Return the episodes that ended since the last call (the newest 4 x games, at least 1,024, are kept)."""
        count, kept = int(self._finished_count[0]), len(self._finished)
        order = np.arange(max(0, count - kept), count) % kept
        rows = self._finished[order]
        self._finished_count[0] = 0
        return Finished(
            rows[:, _SPARSE], rows[:, _SHAPED_FIRST:_LENGTH], rows[:, _LENGTH], rows[:, _STANDARD].astype(bool)
        )


def _walkable_cells(layout: Layout) -> NDArray[np.int8]:
    """Return the cells that each chef can walk to from its start, (2, cells, 2); the shorter list is repeated in a
    cycle."""
    lists = [_walkable_from(layout, int(x), int(y)) for x, y in layout.starts]
    longest = max(len(cells) for cells in lists)
    return np.array([[cells[k % len(cells)] for k in range(longest)] for cells in lists], np.int8)


def _walkable_from(layout: Layout, x: int, y: int) -> list[tuple[int, int]]:
    reached = [(x, y)]
    for cell_x, cell_y in reached:
        for cell in ((cell_x, cell_y - 1), (cell_x, cell_y + 1), (cell_x + 1, cell_y), (cell_x - 1, cell_y)):
            if layout.tiles[cell] == FLOOR and cell not in reached:
                reached.append(cell)
    return sorted(reached)


@kernel
def _below(random, game, limit):
    """Return a random integer in 0..limit-1 from the game's own splitmix64 stream."""
    random[game] += np.uint64(0x9E3779B97F4A7C15)
    z = random[game]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return np.int64((z >> np.uint64(32)) % np.uint64(limit))


@kernel
def _begin(starts, cells, pots, players, contents, sums, random, game, random_chance):
    """Put one game into the first state of an episode and clear its sums."""
    contents[:] = 0
    players[:] = 0
    for k in range(2):
        players[k, X] = starts[k, 0]
        players[k, Y] = starts[k, 1]
    sums[:] = 0
    sums[_STANDARD] = 1
    if random_chance > 0 and _below(random, game, _ONE_IN) < random_chance:
        sums[_STANDARD] = 0
        _randomise(cells, pots, players, contents, random, game)


@kernel
def _randomise(cells, pots, players, contents, random, game):
    """Draw two free cells, facings, hands, and pots in a state in which a timestep can begin (so never 3 raw
    onions)."""
    for k in range(2):
        while True:
            cell = _below(random, game, cells.shape[1])
            players[k, X] = cells[k, cell, 0]
            players[k, Y] = cells[k, cell, 1]
            if k == 0 or players[0, X] != players[1, X] or players[0, Y] != players[1, Y]:
                break
        players[k, FACING] = _below(random, game, _DIRECTIONS)
        players[k, HELD] = _below(random, game, _ITEMS)
    for k in range(pots.shape[0]):
        inside = _below(random, game, ONIONS_PER_SOUP + READY - COOKING)
        contents[pots[k, 0], pots[k, 1]] = (
            inside if inside < ONIONS_PER_SOUP else inside - ONIONS_PER_SOUP + COOKING + 1
        )


@threaded_kernel
def _step(
    tiles, pots, counters, starts, cells, static, players, contents, timestep, horizon, random, random_chance,
    sums, finished, finished_count, actions, events, sparse, shaped, dones, observations,
):  # fmt: skip
    flat_static, flat = static.reshape(-1), observations.reshape(-1)
    for game in range(players.shape[0]):
        step_game(
            tiles, pots, counters, players[game], contents[game], actions[game, 0], actions[game, 1], events[game]
        )
        timestep[game] += 1
        for k in range(2):
            sparse[game, k] = 0
            shaped[game, k] = 0
            if events[game, k] != 0:  # in most timesteps there is no event
                points = _sparse_reward(events[game, k])
                shaping = _shaped_reward(events[game, k])
                sparse[game, k] = points
                shaped[game, k] = shaping
                sums[game, _SPARSE] += points
                sums[game, _SHAPED_FIRST + k] += shaping
        sums[game, _LENGTH] += 1
        dones[game] = timestep[game] >= horizon
        if dones[game]:
            finished[finished_count[0] % finished.shape[0]] = sums[game]
            finished_count[0] += 1
            _begin(starts, cells, pots, players[game], contents[game], sums[game], random, game, random_chance)
            timestep[game] = 0
        if observations.shape[0] > 0:
            encode_game(flat_static, pots, counters, players, contents, timestep, horizon, flat, game)
