"""Timesteps whose display is not what the condition requires: no marks where some are due, or marks where none are.
Where marks are shown on demand, they are due in the timesteps in which the participant asked for them; with limited
sight, in those in which the watched chef was in view.

All stored timesteps of an episode count but the last one, in which nothing is shown.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from sqlalchemy import Connection, LargeBinary, and_, case, func, not_, or_, select

from server.play.intentions import NO_INTENTION_SHOWN
from server.play.marks import NOTHING_SHOWN
from server.store.tables import episodes, ticks

EPISODES_A_CALL = 40
_BYTES_A_STEP, _STEPS = 2, 3
_e = episodes.c


class DisplayViolations(NamedTuple):
    """Timesteps that are wrong; `late`: those of them in which the models needed longer than the deadline, because the
    server was too slow. The others have another cause, such as a model that failed."""

    timesteps: int = 0
    late: int = 0


NO_VIOLATIONS = DisplayViolations()


def violations(connection: Connection, chosen: Sequence[str]) -> dict[str, DisplayViolations]:
    """Return how many timesteps of these episodes are wrong, for each that has any."""
    last = select(func.max(ticks.c.timestep)).where(ticks.c.episode_id == _e.id).correlate(episodes).scalar_subquery()
    drawn = [func.substr(ticks.c.displayed, 1 + _BYTES_A_STEP * step, 1, type_=LargeBinary) for step in range(_STEPS)]
    no_action = and_(*(step.in_([bytes([NOTHING_SHOWN]), b""]) for step in drawn))
    kind = func.substr(ticks.c.displayed_intention, 1, 1, type_=LargeBinary)
    no_intention = func.coalesce(kind, bytes([NO_INTENTION_SHOWN])) == bytes([NO_INTENTION_SHOWN])
    due = and_(_e.shown != "nothing", ticks.c.asked.is_not(False), ticks.c.in_sight.is_not(False))
    display = func.coalesce(_e.spec["display"].as_string(), "actions")  # an older episode does not say
    broken = or_(
        _is_broken(and_(due, display.in_(("actions", "both"))), no_action),
        _is_broken(and_(due, display.in_(("intention", "both"))), no_intention),
    )
    late = func.count(case((ticks.c.models_ms > _e.spec["deadline_ms"].as_float(), 1)))
    query = select(_e.id, func.count(), late).join_from(episodes, ticks, ticks.c.episode_id == _e.id)
    query = query.where(_e.id.in_(chosen), broken, ticks.c.timestep < last).group_by(_e.id)
    return {row[0]: DisplayViolations(int(row[1]), int(row[2])) for row in connection.execute(query)}


def _is_broken(due: Any, empty: Any) -> Any:
    return or_(and_(due, empty), and_(not_(due), not_(empty)))


@dataclass
class DisplayCount:
    """The running count of one study over its episodes that have ended, a few episodes at a time."""

    by_episode: dict[str, DisplayViolations] = field(default_factory=dict)
    waiting: int = 0

    @property
    def timesteps(self) -> int:
        return sum(one.timesteps for one in self.by_episode.values())

    @property
    def late(self) -> int:
        """How many of them are the server's lateness."""
        return sum(one.late for one in self.by_episode.values())

    @property
    def episodes(self) -> int:
        """How many episodes have any."""
        return sum(one.timesteps > 0 for one in self.by_episode.values())

    def count(self, connection: Connection, study_ids: Sequence[int]) -> None:
        """Count the next episodes that have ended. For one thread at a time."""
        query = select(_e.id).where(_e.study_id.in_(study_ids), _e.status.in_(("done", "aborted")))
        over = connection.execute(query).scalars().all()
        self.by_episode = {each: self.by_episode[each] for each in over if each in self.by_episode}  # without deleted
        new = [each for each in over if each not in self.by_episode]
        some = new[:EPISODES_A_CALL]
        found = violations(connection, some)
        self.by_episode |= {episode: found.get(episode, NO_VIOLATIONS) for episode in some}
        self.waiting = len(new) - len(some)
