"""The predictor's accuracy so far, per agent and layout: each episode is counted once, a few episodes per call, so that
reading a large study does not delay running games. As everywhere on the dashboard, people and bots are never pooled.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from sqlalchemy import ColumnElement, Connection, and_, case, func, or_, select

from server.store import interactions, overview
from server.store.overview import Group
from server.store.tables import episodes, participants, ticks

EPISODES_A_CALL = 20
_STEPS, _ACTIONS = 3, 6
_Z = 1.959963984540054
_e = episodes.c


@dataclass
class Hits:
    """Of one agent on one layout, by step."""

    episodes: int = 0
    asked: list[int] = field(default_factory=lambda: [0] * _STEPS)
    right: list[int] = field(default_factory=lambda: [0] * _STEPS)
    intentions: int = 0  # that were predicted in states in which the chef used something within the horizon
    intentions_right: int = 0  # kind and station


@dataclass
class RunningAccuracy:
    """The running count of one study; `waiting` says how many episodes are not counted yet."""

    hits: dict[tuple[str, str], Hits] = field(default_factory=dict)
    waiting: int = 0
    _counted: set[str] = field(default_factory=set)
    _of_bots: bool = False

    def count(self, connection: Connection, study_ids: Sequence[int]) -> None:
        """Count the next episodes that were played to their end, of people, or of bots where only bots came. For one
        thread at a time."""
        group = overview.group_to_show(connection, study_ids)
        if group.simulated != self._of_bots:  # the first person has come
            self.hits, self._counted, self._of_bots = {}, set(), group.simulated
        agent = func.coalesce(_e.agent_name, case((_e.watched_seat == 0, _e.agent_0), else_=_e.agent_1))
        query = select(_e.id, _e.layout, _e.watched_seat, agent.label("agent")).where(
            _e.study_id.in_(study_ids), _e.kind == "episode", _e.status == "done", _e.predictor.is_not(None), _of(group)
        )
        played = connection.execute(query).all()
        if not self._counted <= {row.id for row in played}:  # a participant was deleted: count the others again
            self.hits, self._counted = {}, set()
        new = [row for row in played if row.id not in self._counted]
        for row in new[:EPISODES_A_CALL]:
            hits = self.hits.setdefault((row.agent or "", row.layout), Hits())
            for step, (asked, right) in enumerate(hits_of(connection, row.id, row.watched_seat)):
                hits.asked[step] += asked
                hits.right[step] += right
            intentions, right = interactions.hits_of(connection, row.id)
            hits.intentions += intentions
            hits.intentions_right += right
            hits.episodes += 1
            self._counted.add(row.id)
        self.waiting = max(0, len(new) - EPISODES_A_CALL)


def _of(group: Group) -> ColumnElement[bool]:
    """Return whether nobody of the other kind has a seat in an episode."""
    others = select(participants.c.id).where(Group(group.study_ids, not group.simulated).members())
    return and_(*(or_(seat.is_(None), seat.not_in(others)) for seat in (_e.participant_0, _e.participant_1)))


def hits_of(connection: Connection, episode_id: str, watched_seat: int) -> list[tuple[int, int]]:
    """Return how often each step was predicted and how often the prediction was right, in one episode.

    The prediction on state n is about timesteps n, n+1 and n+2; what is done in timestep n is stored in tick n+1. The
    likeliest action counts; a prediction that came late counts as none.
    """
    action = ticks.c.action_0 if watched_seat == 0 else ticks.c.action_1
    query = select(ticks.c.prediction, action).where(ticks.c.episode_id == episode_id).order_by(ticks.c.timestep)
    rows = connection.execute(query).all()
    done = np.array([-1 if row[1] is None else row[1] for row in rows], np.int64)  # (ticks,)
    at = np.array([n for n, row in enumerate(rows) if row[0] is not None], np.int64)
    flat = np.frombuffer(b"".join(rows[n][0] for n in at), "<f4").reshape(len(at), _STEPS, _ACTIONS)
    predicted = flat.argmax(axis=2)  # (predictions, steps)
    found = []
    for step in range(_STEPS):
        known = at + step + 1 < len(rows)
        right = predicted[known, step] == done[at[known] + step + 1]
        found.append((int(known.sum()), int(right.sum())))
    return found


# Written here because the server is installed without SciPy (docs/decisions/0020); a test compares the results.
def wilson(right: int, asked: int) -> tuple[float, float, float]:
    """Return a share with its Wilson 95 % interval (Wilson 1927): (share, low, high). Of nothing: (0, 0, 1)."""
    if not asked:
        return 0.0, 0.0, 1.0
    share = right / asked
    middle = share + _Z**2 / (2 * asked)
    half = _Z * math.sqrt(share * (1 - share) / asked + _Z**2 / (4 * asked**2))
    scale = 1 + _Z**2 / asked
    return share, max(0.0, (middle - half) / scale), min(1.0, (middle + half) / scale)
