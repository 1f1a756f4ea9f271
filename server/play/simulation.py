"""The states of one episode so far, computed by the rules: stepping, hashing, drawing, history."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

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

_NOTHING = (0, 0)
_ROWS = (slice(0, 4), slice(4, 8))  # of each chef in the bytes of both: x, y, facing, held
_CHEFS_SIZE = 8  # bytes of both chefs
_NO_ACTIONS = b"\xff\xff"  # -1 for both: what led to the start state


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
        """Return whether both chefs stand, look and hold as in the other one, and have used nothing."""
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
        self._chefs = self._chefs_before = start.players.tobytes()  # (2, 4): the rows of both chefs, now and before
        self._cells = start.contents.tobytes()  # (width, height)
        self._done = _NO_ACTIONS  # the joint action that led to the current state
        self._last_actions: tuple[int, int] | None = None
        self._past = bytearray(self._chefs + self._cells + self._done)  # of all states, one after the other
        self._pots = [(x, y, x * layout.height + y) for x, y in layout.pots.tolist()]  # the last: its place in `_cells`
        self._counters = [(x, y, x * layout.height + y) for x, y in layout.counters.tolist()]

    def step(self, actions: tuple[int, int]) -> SimulatedStep:
        """Play one timestep with both chefs' actions (0-5)."""
        return step_together([self], [actions])[0]

    def _follow(self, chefs: bytes, cells: bytes, actions: tuple[int, int], events: Sequence[int]) -> SimulatedStep:
        """Take the state that the rules made of the current one."""
        self.timestep += 1
        self._chefs_before, self._chefs, self._cells = self._chefs, chefs, cells
        self._last_actions, self._done = actions, bytes(actions)
        self._past += chefs + cells + self._done
        for seat, row in enumerate(_ROWS):
            self.stuck[seat] = self.stuck[seat] + 1 if chefs[row] == self._chefs_before[row] else 0
        first, second = events
        if not (first or second):
            return SimulatedStep(actions, _NOTHING, _NOTHING, _NOTHING)
        rewards = (sparse_reward(first), sparse_reward(second))
        self.score += sum(rewards)
        self.soups += bool(first & SOUP_DELIVERY) + bool(second & SOUP_DELIVERY)
        return SimulatedStep(actions, rewards, (shaped_reward(first), shaped_reward(second)), (first, second))

    def moment(self) -> Moment:
        """Return a copy of the current state, to simulate what could follow."""
        return Moment(self.players()[None].copy(), self.contents()[None].copy())

    def imagine(self, moment: Moment, actions: tuple[int, int]) -> Moment:
        """Return the state that would follow, without changing the episode."""
        after = Moment(moment.players.copy(), moment.contents.copy())
        _play(self.layout, after.players, after.contents, [actions])
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
        return np.frombuffer(self._chefs, np.int8).reshape(PLAYERS, -1)

    def contents(self) -> NDArray[np.int8]:
        """(width, height): items on counters, contents of pots."""
        return np.frombuffer(self._cells, np.int8).reshape(self.layout.width, self.layout.height)

    def pot_contents(self) -> list[int]:
        return [self._cells[place] for _, _, place in self._pots]

    def moved(self, seat: int) -> bool:
        """Return whether the chef stands in another cell than a timestep ago."""
        row = _ROWS[seat]
        return bool(self._chefs[row][:FACING] != self._chefs_before[row][:FACING])

    def history(self, seat: int) -> Callable[[int], History]:
        """Look back from the current state as the chef in `seat`; stays valid when the game continues."""
        return partial(self._last, seat, self.timestep + 1, (self._chefs, self._cells, self._done))

    def _last(self, seat: int, reached: int, newest: tuple[bytes, bytes, bytes], count: int) -> History:
        """Return the last states of the first `reached` ones, of which `newest` is the last."""
        chefs, cells, done = newest
        if count > 1:
            size, to_cells, to_done = len(b"".join(newest)), len(chefs), len(chefs + cells)
            some = bytes(self._past[size * max(0, reached - count) : size * reached])
            rows = np.frombuffer(some, np.int8).reshape(-1, size)
            parts = (rows[:, :to_cells], rows[:, to_cells:to_done], rows[:, to_done:])
            chefs, cells, done = (part.tobytes() for part in parts)
        return History(chefs, cells, _own_first(done, seat))

    def kitchen(self) -> KitchenState:
        """Return the current state as the browser draws it."""
        cells = self._cells
        pots = []
        for x, y, place in self._pots:
            inside = cells[place]
            if inside >= COOKING:
                pots.append((x, y, ONIONS_PER_SOUP, inside - COOKING))
            elif inside:
                pots.append((x, y, inside, -1))
        counters = [(x, y, cells[place]) for x, y, place in self._counters if cells[place] != NOTHING]
        players = tuple([(x, y, facing, held) for x, y, facing, held in (self._chefs[row] for row in _ROWS)])
        return KitchenState(self.timestep, players, tuple(counters), tuple(pots), self.score, self.soups)


def step_together(simulations: Sequence[Simulation], actions: Sequence[tuple[int, int]]) -> list[SimulatedStep]:
    """Play one timestep of several games in the same kitchen: one call of the rules, which costs as much as for one."""
    layout = simulations[0].layout
    shape = (len(simulations), layout.width, layout.height)
    players = _joined([one._chefs for one in simulations]).reshape(-1, PLAYERS, _CHEFS_SIZE // PLAYERS)
    contents = _joined([one._cells for one in simulations]).reshape(shape)
    events = _play(layout, players, contents, actions)
    chefs, cells, size = players.tobytes(), contents.tobytes(), layout.width * layout.height
    steps = []
    for k, one in enumerate(simulations):
        its_chefs, its_cells = chefs[k * _CHEFS_SIZE : (k + 1) * _CHEFS_SIZE], cells[k * size : (k + 1) * size]
        steps.append(one._follow(its_chefs, its_cells, actions[k], events[k]))
    return steps


def _play(
    layout: Layout, players: NDArray[np.int8], contents: NDArray[np.int8], actions: Sequence[tuple[int, int]]
) -> list[list[int]]:
    """Apply the rules in place; return the bits of every game's events."""
    timesteps, events = np.zeros(len(actions), np.int32), np.zeros((len(actions), PLAYERS), np.int32)
    done = np.array(actions, np.int8)
    rules.step(layout.tiles, layout.pots, layout.counters, players, contents, timesteps, done, events)
    bits: list[list[int]] = events.tolist()
    return bits


def _joined(states: list[bytes]) -> NDArray[np.int8]:
    return np.frombuffer(bytearray().join(states), np.int8)


def _own_first(done: bytes, seat: int) -> bytes:
    """Return joint actions (states, 2) as the chef in `seat` sees them."""
    if seat == 0:
        return done
    if len(done) == PLAYERS:
        return done[::-1]
    swapped = bytearray(done)
    swapped[::PLAYERS], swapped[1::PLAYERS] = done[1::PLAYERS], done[::PLAYERS]
    return bytes(swapped)
