"""The `carrier`: an agent that takes onions from counter to counter, for practice games in which people learn to read
intentions. It never fills a pot, and its actions are easy to predict.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Final

import numpy as np
from numpy.typing import NDArray

from models.agents.observation_parser import Cell, ParsedObservation, certain, distances, parse_observation
from models.protocols import (
    INTENTION,
    INTENTION_HORIZON,
    INTENTIONS,
    STEPS,
    Intentions,
    Observations,
    Predictions,
    Probabilities,
)
from overcooked.constants import ACTIONS, INTERACT, NOTHING, ONION, STAY, STEP_X, STEP_Y
from overcooked.interactions import NO_INTERACTION, InteractionKind

_PLACES: Final = 3  # the number of counters that it uses
_SURE: Final = 0.99


class CarrierPolicy:
    """Carry two onions around three counters that are far from each other."""

    def probabilities(self, observations: Observations) -> Probabilities:
        return np.stack([certain(_task(parse_observation(planes)).action) for planes in observations])


class CarrierPredictor:
    """Predict the carrier only, as if the other chef stayed where it is."""

    memory = 1

    def begin(self, slots: NDArray[np.intp]) -> None:
        """Do nothing: this predictor keeps no state."""

    def predict(
        self,
        slots: NDArray[np.intp],  # noqa: ARG002 - a single state is enough
        observations: Observations,
        last_actions: NDArray[np.int8],  # noqa: ARG002
    ) -> Predictions:
        """Return the next actions, nearly certain."""
        answer = np.full((len(observations), STEPS, ACTIONS), (1 - _SURE) / (ACTIONS - 1), np.float32)
        for game, planes in enumerate(observations):
            for step, task in enumerate(islice(_ahead(parse_observation(planes)), STEPS)):
                answer[game, step, task.action] = _SURE
        return answer

    def intentions(
        self,
        slots: NDArray[np.intp],
        observations: Observations,
        last_actions: NDArray[np.int8],  # noqa: ARG002
    ) -> Intentions:
        """Return the next use of a station, nearly certain; the second intention is "no interaction"."""
        answer = np.zeros((len(slots), INTENTIONS), INTENTION)
        for game, planes in enumerate(observations):
            answer[game] = _intentions(_ahead(parse_observation(planes)))
        return answer


@dataclass(frozen=True)
class _Task:
    """The carrier's current task, and the station that it goes to."""

    action: int
    station: Cell | None = None


def _intentions(ahead: Iterator[_Task]) -> list[tuple[int, int, int, int, float]]:
    """Return the most likely intention and the second most likely: kind, x, y, steps, probability."""
    nothing = (*NO_INTERACTION, 0)
    for step, task in enumerate(islice(ahead, INTENTION_HORIZON), start=1):
        if isinstance(task, _Use) and task.station is not None:
            return [(task.kind, *task.station, step, _SURE), (*nothing, 1 - _SURE)]
    return [(*nothing, _SURE), (*nothing, 0.0)]


@dataclass(frozen=True)
class _Use(_Task):
    kind: int = InteractionKind.NONE


def _ahead(seen: ParsedObservation) -> Iterator[_Task]:
    """Simulate the carrier's next actions."""
    while True:
        task = _task(seen)
        yield task
        if task.action < STAY:
            there = (seen.me[0] + int(STEP_X[task.action]), seen.me[1] + int(STEP_Y[task.action]))
            is_free = bool(seen.floor[there]) and there != seen.other
            seen = replace(seen, me=there if is_free else seen.me, facing=task.action)
        elif task.station is not None:
            seen = _after_use(seen, task.station)


def _after_use(seen: ParsedObservation, station: Cell) -> ParsedObservation:
    items = {cell: item for cell, item in seen.items.items() if cell != station}
    if seen.held == NOTHING:
        return replace(seen, held=ONION, items=items)
    return replace(seen, held=NOTHING, items=items | {station: ONION})


def _task(seen: ParsedObservation) -> _Task:
    station = _station(seen, _places(seen))
    if station is None:
        return _Task(STAY)
    # the last try: as if the other chef stepped aside
    for blocked in ({seen.other, seen.other_ahead}, {seen.other}, set()):
        reached = distances(_without(seen.floor, blocked - {seen.me}), seen.me, None)
        ways = [
            (*reached[neighbour], direction)
            for direction in range(len(STEP_X))
            if (neighbour := (station[0] - int(STEP_X[direction]), station[1] - int(STEP_Y[direction]))) in reached
        ]
        if ways:
            steps, first, direction = min(ways)
            if steps:
                return _Task(first, station)
            if seen.facing != direction:
                return _Task(direction, station)
            kind = InteractionKind.TAKE_ONION if seen.held == NOTHING else InteractionKind.PUT_DOWN
            return _Use(INTERACT, station, kind)
    return _Task(STAY)


def _without(floor: NDArray[np.bool_], blocked: set[Cell]) -> NDArray[np.bool_]:
    free = floor.copy()
    for cell in blocked:
        free[cell] = False
    return free


def _station(seen: ParsedObservation, places: Sequence[Cell]) -> Cell | None:
    """Return the station that it goes to. With two onions on three counters, the free counter advances by one with each
    onion carried."""
    full = [place for place in places if seen.items.get(place) == ONION]
    free = [place for place in places if place not in seen.items]
    if seen.held == NOTHING:
        if len(full) < _PLACES - 1 or not full:
            return min(seen.onions, key=lambda cell: _apart(cell, seen.me), default=None)
        after = places.index(free[0]) + 1 if free else 0
        order = [*places[after:], *places[:after]]
        return next(place for place in order if place in full)
    if seen.held != ONION or not free:
        return None
    after = places.index(full[0]) + 1 if len(full) == 1 else 0
    return next(place for place in [*places[after:], *places[:after]] if place in free)


def _places(seen: ParsedObservation) -> list[Cell]:
    """Return counters that it can reach, each as far as possible from the crate and from those before it."""
    reached = distances(seen.floor, seen.me, None)
    usable = [
        cell
        for cell in sorted((*seen.free_counters, *seen.items))
        if any((cell[0] - int(STEP_X[k]), cell[1] - int(STEP_Y[k])) in reached for k in range(len(STEP_X)))
    ]
    chosen: list[Cell] = []
    while usable and len(chosen) < _PLACES:
        others = [*seen.onions, *chosen]
        farthest = max(usable, key=lambda cell: min((_apart(cell, other) for other in others), default=0))
        chosen.append(farthest)
        usable.remove(farthest)
    return chosen


def _apart(one: Cell, other: Cell) -> int:
    return abs(one[0] - other[0]) + abs(one[1] - other[1])
