"""The states of one episode so far, computed by the rules: stepping, hashing, drawing, history."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from models.protocols import History
from overcooked import rules
from overcooked.constants import COOKING, FACING, NOTHING, ONIONS_PER_SOUP, PLAYERS, SOUP_DELIVERY
from overcooked.layout import Layout
from overcooked.score import shaped_reward, sparse_reward
from overcooked.state import Kitchens, state_hash
from server.play.messages import KitchenState

_ENDLESS_CAPACITY = 512
_NOTHING = (0, 0)
_ROWS = (slice(0, 4), slice(4, 8))  # of each chef in the bytes of both: x, y, facing, held


class SimulatedStep(Struct, frozen=True, gc=False):
    """What one timestep did, by player."""

    actions: tuple[int, int]
    rewards: tuple[int, int]  # sparse
    shaped: tuple[int, int]
    events: tuple[int, int]  # bits, overcooked.constants.EVENT_NAMES


@dataclass(frozen=True, eq=False)
class Moment:
    """A hypothetical state, which does not change the episode."""

    players: NDArray[np.int8]  # (1, 2, 4)
    contents: NDArray[np.int8]  # (1, width, height)

    def same_place(self, other: "Moment") -> bool:
        """Whether both chefs stand, look and hold as in the other one, and have used nothing."""
        return bool((self.players == other.players).all())


class ReplayMismatch(Exception):
    """The stored actions do not lead to the stored state: the record is damaged and must not be played on."""


class Simulation:
    """All states from the start to now; `timestep` is the index of the current one. A horizon of 0 means endless."""

    def __init__(self, layout: Layout, horizon: int) -> None:
        self.layout = layout
        self.horizon = horizon
        self.timestep = 0
        self.score = 0
        self.soups = 0
        self.stuck = [0, 0]  # timesteps since the chef's own cell, facing or hand last changed
        start = Kitchens.start(layout)
        capacity = (horizon or _ENDLESS_CAPACITY) + 1
        self._players = np.zeros((capacity, *start.players.shape[1:]), np.int8)  # (timesteps, 2, 4)
        self._contents = np.zeros((capacity, *start.contents.shape[1:]), np.int8)  # (timesteps, width, height)
        self._actions = np.full((capacity, PLAYERS), -1, np.int8)  # that led to each state
        self._timesteps = np.zeros(capacity, np.int32)
        self._players[0] = start.players[0]
        self._chefs = self._chefs_before = self._players[0].tobytes()  # the rows of both chefs, now and a timestep ago
        self._cells = self._contents[0].tobytes()  # [x][y]
        self._last_actions: tuple[int, int] | None = None
        self._events = np.zeros(PLAYERS, np.int32)
        self._pots = [(x, y, x * layout.height + y) for x, y in layout.pots.tolist()]  # the last: its place in `_cells`
        self._counters = [(x, y, x * layout.height + y) for x, y in layout.counters.tolist()]

    def step(self, actions: tuple[int, int]) -> SimulatedStep:
        """Play one timestep with both chefs' actions (0-5)."""
        now = self.timestep + 1
        if now == len(self._timesteps):
            self._grow()
        layout, events = self.layout, self._events
        states = (self._players, self._contents, self._timesteps, self._actions)
        rules.advance(layout.tiles, layout.pots, layout.counters, *states, now, *actions, events)
        self.timestep = now
        self._chefs_before, self._chefs, self._last_actions = self._chefs, self._players[now].tobytes(), actions
        self._cells = self._contents[now].tobytes()
        for seat, row in enumerate(_ROWS):
            self.stuck[seat] = self.stuck[seat] + 1 if self._chefs[row] == self._chefs_before[row] else 0
        first, second = events.tolist()
        if not (first or second):
            return SimulatedStep(actions, _NOTHING, _NOTHING, _NOTHING)
        rewards = (sparse_reward(first), sparse_reward(second))
        self.score += sum(rewards)
        self.soups += bool(first & SOUP_DELIVERY) + bool(second & SOUP_DELIVERY)
        return SimulatedStep(actions, rewards, (shaped_reward(first), shaped_reward(second)), (first, second))

    def _grow(self) -> None:
        size = len(self._timesteps)
        self._players, self._contents, self._actions, self._timesteps = (
            np.concatenate((array, np.zeros_like(array)))[: 2 * size]
            for array in (self._players, self._contents, self._actions, self._timesteps)
        )

    def moment(self) -> Moment:
        """Return a copy of the current state, to simulate what could follow."""
        here = slice(self.timestep, self.timestep + 1)
        return Moment(self._players[here].copy(), self._contents[here].copy())

    def imagine(self, moment: Moment, actions: tuple[int, int]) -> Moment:
        """Return the state that would follow, without changing the episode."""
        after = Moment(moment.players.copy(), moment.contents.copy())
        layout, timestep, done = self.layout, self._timesteps[:1].copy(), np.array([actions], np.int8)
        state = (after.players, after.contents, timestep)
        rules.step(layout.tiles, layout.pots, layout.counters, *state, done, self._events[None].copy())
        return after

    @property
    def last_actions(self) -> tuple[int, int] | None:
        """The joint action that led to the current state; None at the start."""
        return self._last_actions

    def hash(self) -> str:
        """16 hexadecimal digits of the current state, the same on every machine (overcooked.state)."""
        return state_hash(self.layout, self.timestep, self._chefs, self._cells)

    def players(self) -> NDArray[np.int8]:
        """(2, 4): x, y, facing, held."""
        players: NDArray[np.int8] = self._players[self.timestep]
        return players

    def contents(self) -> NDArray[np.int8]:
        """(width, height): items on counters, contents of pots."""
        contents: NDArray[np.int8] = self._contents[self.timestep]
        return contents

    def pot_contents(self) -> list[int]:
        return [self._cells[place] for _, _, place in self._pots]

    def moved(self, seat: int) -> bool:
        """Whether the chef stands in another cell than a timestep ago."""
        row = _ROWS[seat]
        return bool(self._chefs[row][:FACING] != self._chefs_before[row][:FACING])

    def history(self, seat: int) -> Callable[[int], History]:
        """Look back from the current state as the chef in `seat`; stays valid when the game continues."""
        timestep, chefs, cells = self.timestep, self._chefs, self._cells

        def last(count: int) -> History:
            rows = slice(max(0, timestep + 1 - count), timestep + 1)
            actions = self._actions[rows] if seat == 0 else self._actions[rows, ::-1]
            if count == 1:
                return History(chefs, cells, actions.tobytes())
            return History(self._players[rows].tobytes(), self._contents[rows].tobytes(), actions.tobytes())

        return last

    def kitchen(self) -> KitchenState:
        """The current state as the browser draws it."""
        cells = self._cells
        pots = []
        for x, y, place in self._pots:
            inside = cells[place]
            if inside >= COOKING:
                pots.append((x, y, ONIONS_PER_SOUP, inside - COOKING))
            elif inside:
                pots.append((x, y, inside, -1))
        counters = [(x, y, cells[place]) for x, y, place in self._counters if cells[place] != NOTHING]
        first, second = _ROWS
        players = (tuple(self._chefs[first]), tuple(self._chefs[second]))
        return KitchenState(self.timestep, players, tuple(counters), tuple(pots), self.score, self.soups)
