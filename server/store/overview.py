"""What the dashboard shows of a study, read from the database: people, flow, arms, errors of browsers."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

from sqlalchemy import ColumnElement, Connection, and_, case, false, func, or_, select

from server.store.episodes import is_misleading
from server.store.events import ATTENTION_SCREENED_OUT
from server.store.participants import label
from server.store.tables import answers, episodes, events, exclusions, participants, withdrawals

_p, _e = participants.c, episodes.c
HERE = timedelta(minutes=2)  # who was seen so lately is in the study now
MAX_GAME = timedelta(minutes=10)  # a game can be longer than the time since the last page load
DROPPED = ("timed_out", "returned", "screened_out", "withdrawn")
TABS: dict[str, tuple[str, ...]] = {
    "active": ("active",),
    "completed": ("completed",),
    "dropped": ("timed_out", "returned", "screened_out"),
    "all": ("active", "completed", "timed_out", "returned", "screened_out"),
}


@dataclass(frozen=True)
class Person:
    """A row of the participants' table."""

    id: str
    study_id: int
    number: int
    allocation_number: int
    condition: str
    seed: int
    position: int
    status: str
    simulated: bool
    started_at: datetime
    last_seen_at: datetime
    completed_at: datetime | None
    client_errors: int
    excluded: int  # active exclusions


@dataclass(frozen=True)
class Played:
    """Whose episode it is and what was played."""

    id: str
    study_id: int
    participant_id: str
    number: int  # of the participant
    simulated: bool
    condition: str
    seed: int
    kind: str
    episode: int  # 1-based; 0 for the tutorial
    agent: str
    layout: str
    shown: str
    misleading: bool
    seat: int  # of the participant
    status: str
    end_reason: str | None
    score: int | None
    started_at: datetime | None
    ended_at: datetime | None
    paused_by: str | None

    @property
    def is_over(self) -> bool:
        return self.status in ("done", "aborted")

    @property
    def short_name(self) -> str:
        """What researchers call the game: E3 for the third episode, or Tutorial."""
        return f"E{self.episode}" if self.kind == "episode" else "Tutorial"


Counts = dict[tuple[str, str, int], int]  # (condition, status, position) -> participants


@dataclass(frozen=True)
class Group:
    """The people of these study versions, or the bots: never both."""

    study_ids: Sequence[int]
    simulated: bool = False

    def members(self) -> ColumnElement[bool]:
        """Return the SQL condition for a row of `participants`."""
        return and_(_p.study_id.in_(self.study_ids), _p.simulated == self.simulated)

    def withdrawn(self) -> ColumnElement[bool]:
        """Return the SQL condition for a row of `withdrawals`."""
        was_bot = func.coalesce(withdrawals.c.simulated, false()) == self.simulated  # of earlier versions: not known
        return and_(withdrawals.c.study_id.in_(self.study_ids), was_bot)


def group_to_show(connection: Connection, study_ids: Sequence[int]) -> Group:
    """Return the people, or the bots of a study in which only bots have taken part."""
    return Group(study_ids, simulated=simulated(connection, study_ids) > 0 and not flow(connection, Group(study_ids)))


def flow(connection: Connection, group: Group) -> Counts:
    """Return how many participants of each condition are or were where; those who withdrew included."""
    keys = (_p.condition, _p.status, _p.position)
    query = select(*keys, func.count()).where(group.members()).group_by(*keys)
    found: Counts = {(row[0], row[1], row[2]): row[3] for row in connection.execute(query)}
    gone = (withdrawals.c.condition, withdrawals.c.position)
    left = select(*gone, func.count()).where(group.withdrawn()).group_by(*gone)
    found |= {(row[0], "withdrawn", row[1]): row[2] for row in connection.execute(left)}
    return found


def inattentive(connection: Connection, group: Group) -> dict[tuple[str, int], int]:
    """Return how many were screened out because of attention checks, by condition and position."""
    noted = select(events.c.participant_id).where(events.c.kind == ATTENTION_SCREENED_OUT)
    query = select(_p.condition, _p.position, func.count()).where(group.members(), _p.id.in_(noted))
    query = query.where(_p.status == "screened_out").group_by(_p.condition, _p.position)
    return {(row[0], row[1]): row[2] for row in connection.execute(query)}


def failed_a_check(connection: Connection, group: Group) -> int:
    """Return how many of those who completed the study failed an attention check."""
    failed = select(answers.c.participant_id).where(answers.c.attention.is_(False))
    query = select(func.count()).where(group.members(), _p.status == "completed", _p.id.in_(failed))
    return connection.execute(query).scalar_one()


def here_now(connection: Connection, group: Group) -> int:
    """Return how many active participants were seen lately."""
    query = select(func.count()).where(group.members(), _p.status == "active")
    return int(connection.execute(query.where(_p.last_seen_at > datetime.now(UTC) - HERE)).scalar_one())


def playing(connection: Connection, whose: ColumnElement[bool]) -> list[str]:
    """Return the labels of those of these participants who are in a game."""
    seat = or_(_e.participant_0 == _p.id, _e.participant_1 == _p.id)
    query = select(_p.number, _p.simulated).join_from(participants, episodes, seat).distinct().order_by(_p.number)
    query = query.where(whose, _e.status == "running", _p.last_seen_at > datetime.now(UTC) - MAX_GAME)
    return [label(row.number, row.simulated) for row in connection.execute(query)]


def simulated(connection: Connection, study_ids: Sequence[int]) -> int:
    """Return how many participants are bots."""
    query = select(func.count()).where(Group(study_ids, simulated=True).members())
    return int(connection.execute(query).scalar_one())


def minutes(connection: Connection, group: Group, most: int = 500) -> list[float]:
    """Return how long the last participants took from consent to the end, shortest first."""
    query = select(_p.started_at, _p.completed_at).where(group.members(), _p.completed_at.is_not(None))
    rows = connection.execute(query.order_by(_p.completed_at.desc()).limit(most))
    return sorted((row.completed_at - row.started_at).total_seconds() / 60 for row in rows)


def excluded(connection: Connection, group: Group, status: str = "completed") -> dict[str, int]:
    """Return how many participants of this status are excluded whole, by condition."""
    query = select(_p.condition, func.count(func.distinct(_p.id))).join_from(participants, exclusions)
    held = (exclusions.c.restored_at.is_(None), exclusions.c.episode_id.is_(None))
    query = query.where(group.members(), _p.status == status, *held)
    return {row[0]: int(row[1]) for row in connection.execute(query.group_by(_p.condition))}


def people(connection: Connection, study_ids: Sequence[int], tab: str, most: int = 200) -> list[Person]:
    """Return the participants of one tab (of TABS), last seen first."""
    query = _people().where(_p.study_id.in_(study_ids), _p.status.in_(TABS.get(tab, TABS["active"])))
    return [Person(**row._mapping) for row in connection.execute(query.order_by(_p.last_seen_at.desc()).limit(most))]


def person(connection: Connection, participant_id: str) -> Person | None:
    """Return one participant."""
    row = connection.execute(_people().where(_p.id == participant_id)).first()
    return Person(**row._mapping) if row else None


def _people() -> Any:
    client_errors = select(func.count()).where(events.c.participant_id == _p.id, events.c.kind == "trouble")
    held = select(func.count()).where(exclusions.c.participant_id == _p.id, exclusions.c.restored_at.is_(None))
    own = [_p[name] for name in Person.__dataclass_fields__ if name in _p]
    counts = [client_errors.scalar_subquery().label("client_errors"), held.scalar_subquery().label("excluded")]
    return select(*own, *counts)


def players(connection: Connection, *ids: str) -> dict[str, tuple[Played, ...]]:
    """Return these episodes for each of their participants, by id and in the order of their seats; without those that
    belong to no participant of a study."""
    found: dict[str, tuple[Played, ...]] = {}
    for one in sorted(_played(connection, _e.id.in_(ids)), key=lambda one: one.seat):
        found[one.id] = (*found.get(one.id, ()), one)
    return found


def played(connection: Connection, *ids: str) -> dict[str, Played]:
    """Return these episodes, by id: of a round of two people, for the one on the first seat."""
    return {episode: of_episode[0] for episode, of_episode in players(connection, *ids).items()}


def played_by(connection: Connection, participant_id: str) -> list[Played]:
    """Return all episodes of a participant, in order."""
    return _played(connection, _p.id == participant_id)


def latest(connection: Connection, study_ids: Sequence[int], most: int = 200) -> list[Played]:
    """Return the study's episodes that have begun, latest first."""
    found = _played(connection, _e.study_id.in_(study_ids) & _e.started_at.is_not(None), _e.started_at.desc(), most)
    return found


def _played(
    connection: Connection, wanted: ColumnElement[bool], order: Any = _e.created_at, most: int = 1000
) -> list[Played]:
    agent = case((_e.watched_seat == 0, _e.agent_0), else_=_e.agent_1)
    named = func.coalesce(_e.agent_name, agent, _e.agent_0, _e.agent_1, "")
    query = select(
        _e.id, _e.study_id, _p.id.label("participant_id"), _p.number, _p.simulated, _p.condition, _p.seed, _e.kind,
        _e.number.label("episode"), named.label("agent"), _e.layout,
        _e.shown, is_misleading().label("misleading"),
        case((_e.participant_0 == _p.id, 0), else_=1).label("seat"), _e.status, _e.end_reason, _e.score,
        _e.started_at, _e.ended_at, _e.paused_by,
    )  # fmt: skip
    query = query.join_from(episodes, participants, or_(_e.participant_0 == _p.id, _e.participant_1 == _p.id))
    return [Played(**row._mapping) for row in connection.execute(query.where(wanted).order_by(order).limit(most))]


def client_errors(
    connection: Connection, study_ids: Sequence[int], most: int = 20
) -> list[tuple[datetime, str, str, str]]:
    """Return errors on participants' consoles, latest first: when, whose, the participant's label, the text."""
    query = select(events.c.at, _p.id, _p.number, _p.simulated, events.c.detail).join_from(events, participants)
    query = query.where(_p.study_id.in_(study_ids), events.c.kind == "trouble").order_by(events.c.id.desc())
    return [
        (row.at, row.id, label(row.number, row.simulated), str(row.detail.get("text", "")))
        for row in connection.execute(query.limit(most))
    ]


def with_client_errors(connection: Connection, study_ids: Sequence[int], since: datetime) -> dict[str, str]:
    """Return the participants whose browsers have reported errors since then, with their labels."""
    query = select(_p.id, _p.number, _p.simulated).join_from(events, participants).distinct()
    query = query.where(_p.study_id.in_(study_ids), events.c.kind == "trouble", events.c.at > since)
    return {row.id: label(row.number, row.simulated) for row in connection.execute(query)}


def stored(connection: Connection, study_ids: Sequence[int]) -> dict[str, int]:
    """Return the number of episodes by status."""
    query = select(_e.status, func.count()).where(_e.study_id.in_(study_ids), _e.kind == "episode")
    return {row[0]: row[1] for row in connection.execute(query.group_by(_e.status))}
