"""Decisions of researchers about data and studies: exclusions, which can be undone, pauses of games and studies, and
more time for people who are away."""

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Final

from sqlalchemy import Connection, or_, select, update

from server.store import events
from server.store.tables import episodes, exclusions, study_pauses

# What a researcher can choose from; stored with the decision and shown in the analysis as it is.
EXCLUSION_REASONS: Final = (
    "technical fault",
    "did not follow the instructions",
    "not attentive",
    "took part before",
    "other",
)


@dataclass(frozen=True)
class Exclusion:
    """One decision; `episode_id` None: all data of the participant. It holds while `restored_at` is None."""

    id: int
    participant_id: str
    episode_id: str | None
    reason: str
    note: str
    excluded_by: str
    excluded_at: datetime
    restored_by: str | None
    restored_at: datetime | None


def exclude(connection: Connection, participant: str, episode: str | None, why: tuple[str, str], by: str) -> int:
    """Keep the decision that these data are not to be analysed; `why`: reason and note. Returns its number."""
    row = {
        "participant_id": participant,
        "episode_id": episode,
        "reason": why[0],
        "note": why[1],
        "excluded_by": by,
        "excluded_at": datetime.now(UTC),
    }
    made = connection.execute(exclusions.insert().values(row).returning(exclusions.c.id))
    return int(made.scalar_one())


def restore(connection: Connection, number: int, by: str) -> bool:
    """Undo an exclusion. False if it is not (or no longer) in force."""
    query = update(exclusions).where(exclusions.c.id == number, exclusions.c.restored_at.is_(None))
    return connection.execute(query.values(restored_by=by, restored_at=datetime.now(UTC))).rowcount == 1


def exclusions_of(connection: Connection, participants: list[str]) -> list[Exclusion]:
    """Return the exclusions that hold of these participants and of the rounds that they played, also with another
    person; oldest first."""
    mine = or_(episodes.c.participant_0.in_(participants), episodes.c.participant_1.in_(participants))
    about = or_(
        exclusions.c.participant_id.in_(participants), exclusions.c.episode_id.in_(select(episodes.c.id).where(mine))
    )
    query = select(exclusions).where(about, exclusions.c.restored_at.is_(None))
    return [Exclusion(**row._mapping) for row in connection.execute(query.order_by(exclusions.c.id))]


def pause_game(connection: Connection, episode: str, by: str | None) -> bool:
    """Pause an episode wherever it is played, from now on; `by` None: let it continue. Return false if it is over."""
    unfinished = (episodes.c.id == episode, episodes.c.status.in_(("new", "running")))
    return connection.execute(update(episodes).where(*unfinished).values(paused_by=by)).rowcount == 1


def paused_games(connection: Connection, *ids: str) -> set[str]:
    """Return those of these episodes that a researcher pauses one by one."""
    query = select(episodes.c.id).where(episodes.c.id.in_(ids), episodes.c.paused_by.is_not(None))
    return set(connection.execute(query).scalars())


def pauser_of(connection: Connection, episode: str) -> str | None:
    """Return who pauses an episode by itself; None: nobody."""
    return connection.execute(select(episodes.c.paused_by).where(episodes.c.id == episode)).scalar_one_or_none()


def allow_longer_absence(connection: Connection, episode: str, participant: str, seconds: float) -> float:
    """Let people be away longer in an episode, wherever it is played from now on. Return how much longer in all; 0, and
    nothing changes, if it is over."""
    unfinished = (episodes.c.id == episode, episodes.c.status.in_(("new", "running")))
    if connection.execute(select(episodes.c.id).where(*unfinished)).first() is None:
        return 0.0
    events.add(
        connection, events.Event(events.MORE_TIME, datetime.now(UTC), participant, episode, {"seconds": seconds})
    )
    return events.more_time_s(connection, episode)[episode]


def pause_study(connection: Connection, study: str, by: str) -> bool:
    """Pause the study. Return false if it was paused already."""
    if study in paused_studies(connection):
        return False
    connection.execute(study_pauses.insert().values(study=study, paused_by=by, paused_at=datetime.now(UTC)))
    return True


def resume_study(connection: Connection, study: str, by: str) -> bool:
    """Resume the study. Return false if it was not paused."""
    query = update(study_pauses).where(study_pauses.c.study == study, study_pauses.c.resumed_at.is_(None))
    return connection.execute(query.values(resumed_by=by, resumed_at=datetime.now(UTC))).rowcount > 0


def paused_studies(connection: Connection) -> set[str]:
    """Return the names of all paused studies."""
    query = select(study_pauses.c.study).where(study_pauses.c.resumed_at.is_(None))
    return set(connection.execute(query).scalars())


def pauses_of(connection: Connection, study: str) -> list[tuple[datetime, datetime | None]]:
    """Return from when to when a study was paused; None: it still is."""
    query = select(study_pauses.c.paused_at, study_pauses.c.resumed_at).where(study_pauses.c.study == study)
    return [(row.paused_at, row.resumed_at) for row in connection.execute(query)]
