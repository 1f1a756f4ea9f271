"""Questions that wait at a worker, put together into one batch, and its answer taken apart. Asks no model."""

from collections.abc import Iterator, Sequence
from itertools import accumulate, pairwise

import numpy as np

from models.inference.wire import Answer, ModelRequest
from models.protocols import STEPS
from overcooked.constants import ACTIONS

_DISTRIBUTION_BYTES = ACTIONS * np.dtype(np.float32).itemsize


def together(asks: Sequence[ModelRequest]) -> list[list[ModelRequest]]:
    """Groups of one layout in which no game comes twice; a game's frames stay in order."""
    groups: list[list[ModelRequest]] = []
    growing: dict[str, tuple[list[ModelRequest], set[str]]] = {}  # by layout: the last group and the games in it
    for ask in asks:
        games = {row.key for row in ask.rows}
        group, known = growing.get(ask.layout, ([], games))
        if not group or known & games:
            group, known = growing[ask.layout] = ([], set())
            groups.append(group)
        group.append(ask)
        known |= games
    return groups


def joined(group: Sequence[ModelRequest]) -> ModelRequest:
    """One question with the rows of all, in their order."""
    if len(group) == 1:
        return group[0]
    rows = [row for ask in group for row in ask.rows]
    observations = b"".join(ask.observations for ask in group)
    actions = b"".join(ask.actions for ask in group)
    return ModelRequest(group[0].id, group[0].layout, group[0].shape, rows, observations, actions)


def parted(whole: Answer, group: Sequence[ModelRequest]) -> Iterator[Answer]:
    """The answer to each question of the group. Faults are told once, with the first."""
    for ask, (begin, end) in zip(group, pairwise(accumulate((len(ask.rows) for ask in group), initial=0)), strict=True):
        action_distributions = slice(begin * _DISTRIBUTION_BYTES, end * _DISTRIBUTION_BYTES)
        predictions = slice(STEPS * action_distributions.start, STEPS * action_distributions.stop)
        yield Answer(
            id=ask.id,
            model_ms=whole.model_ms,
            acted=whole.acted[begin:end],
            action_distributions=whole.action_distributions[action_distributions],
            predicted=whole.predicted[begin:end],
            predictions=whole.predictions[predictions],
            faults=whole.faults if ask is group[0] else [],
        )
