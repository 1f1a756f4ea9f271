"""Merge the requests that wait at a worker into one batch, and split its answer again."""

from collections.abc import Iterator, Sequence
from itertools import accumulate, pairwise

from models.inference.answer_arrays import AnswerArrays
from models.inference.wire import Answer, ModelRequest


def group_requests(asks: Sequence[ModelRequest]) -> list[list[ModelRequest]]:
    """Group requests by layout so that no game occurs twice in a group; a game's frames stay in order."""
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


def merge_requests(group: Sequence[ModelRequest]) -> ModelRequest:
    """Return one request with the rows of the whole group, in order."""
    if len(group) == 1:
        return group[0]
    rows = [row for ask in group for row in ask.rows]
    players, contents, actions = (
        b"".join([getattr(ask, name) for ask in group]) for name in ("players", "contents", "actions")
    )
    return ModelRequest(group[0].id, group[0].layout, rows, players, contents, actions)


def split_answer(whole: Answer, group: Sequence[ModelRequest]) -> Iterator[Answer]:
    """Yield the answer to each request of the group. Faults are reported once, with the first."""
    arrays = AnswerArrays.read(whole)
    for ask, (begin, end) in zip(group, pairwise(accumulate((len(ask.rows) for ask in group), initial=0)), strict=True):
        faults = whole.faults if ask is group[0] else []
        yield arrays.rows(slice(begin, end)).packed(ask.id, whole.model_ms, faults)
