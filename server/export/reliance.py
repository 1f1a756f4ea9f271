"""People's responses next to the cells that the marks showed: wait, avoid or follow. They are derived from re-simulated
states.

Only for studies that mislead: simulating every episode again takes time.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import msgspec
from sqlalchemy import Connection, Select, select

from overcooked.constants import INTERACT
from overcooked.layout import parse_layout
from server.export.rows import Row, Rows, Selection, misleading
from server.play.episode_spec import EpisodeSpec
from server.play.frames import viewer
from server.play.intentions import NO_INTENTION_SHOWN
from server.play.marks import NOTHING_SHOWN
from server.play.recorder import TickRecord
from server.play.simulation import Simulation
from server.play.walked_path import Cell, walked
from server.store import ticks
from server.store.tables import episodes

BEFORE, AFTER = "before", "after"
RESPONSES = ("waited", "avoided", "followed", "used")
_e = episodes.c


def reliance_rows(chosen: Selection) -> Rows:
    """Yield a row for each episode and phase in which there were cells to respond to."""
    misled: set[str] = set()  # participants who have seen a wrong mark
    for row in chosen.rows(_rounds(), _e.study_id):
        spec = msgspec.convert(row.spec, EpisodeSpec)
        participant = (row.participant_0, row.participant_1)[viewer(spec)]
        if participant is None:
            continue
        phases, sees_wrong = counted(spec, _stored(chosen.connection, row.id), participant in misled)
        if sees_wrong:
            misled.add(participant)
        yield from (_row(row.id, phase, found) for phase, found in phases.items() if found)


def _rounds() -> "Select[Any]":
    """Return the rounds with marks of studies that mislead, in the order in which they were played."""
    studies = select(_e.study_id).where(misleading())
    query = select(_e.id, _e.spec, _e.participant_0, _e.participant_1)
    query = query.where(_e.kind == "episode", _e.shown != "nothing", _e.study_id.in_(studies))
    return query.order_by(_e.study_id, _e.created_at, _e.id)


def _stored(connection: Connection, episode: str) -> Sequence[TickRecord]:
    return ticks.of_episode(connection, episode)


def _row(episode: str, phase: str, found: "Counter[str]") -> Row:
    return (episode, phase, sum(found.values()), *(found[response] for response in RESPONSES))


def counted(
    spec: EpisodeSpec, records: Sequence[TickRecord], was_misled: bool
) -> tuple[dict[str, "Counter[str]"], bool]:
    """Return the responses of one episode by phase, and whether its participant has seen a wrong mark by its end."""
    phases: dict[str, Counter[str]] = {BEFORE: Counter(), AFTER: Counter()}
    for record, response in responses(spec, records):
        if response:
            phases[AFTER if was_misled else BEFORE][response] += 1
        # Only afterwards: when it appears, the participant cannot tell that the first wrong mark is wrong.
        was_misled = was_misled or (record.misleading is True and _is_seen(record))
    return phases, was_misled


def _is_seen(record: TickRecord) -> bool:
    """Return whether an action or an intention was drawn."""
    kind = NO_INTENTION_SHOWN if record.displayed_intention is None else record.displayed_intention[0]
    return record.displayed[0][0] != NOTHING_SHOWN or kind != NO_INTENTION_SHOWN


def responses(spec: EpisodeSpec, records: Sequence[TickRecord]) -> Iterator[tuple[TickRecord, str]]:
    """Yield each state of an episode with the participant's response; '' away from the shown cells."""
    simulation = Simulation(parse_layout(spec.grid, spec.layout), spec.horizon)
    person, watched = viewer(spec), spec.watched_seat
    for record, following in pairwise(records):
        own, other = ((int(row[0]), int(row[1])) for row in simulation.players()[[person, watched]])
        shown = [action for action, _ in record.displayed]
        cells = set(walked(simulation.layout, other, own, shown)) - {other}
        assert following.actions is not None  # noqa: S101 only the first record has none
        simulation.step(following.actions)
        there = simulation.players()[person]
        yield record, response(cells, own, (int(there[0]), int(there[1])), following.actions[person])


def response(cells: set[Cell], own: Cell, there: Cell, action: int) -> str:
    """Return the response of a participant who was at `own` and is at `there` afterwards, next to the shown cells."""
    if not any(abs(x - own[0]) + abs(y - own[1]) <= 1 for x, y in cells):
        return ""
    if there != own:
        return "followed" if there in cells else "avoided"
    return "used" if action == INTERACT else "waited"
