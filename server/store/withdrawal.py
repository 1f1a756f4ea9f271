"""Delete everything about a participant who withdraws, except the fact that somebody withdrew."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection, delete, or_, select, update

from server.store import audit, engines, study_reports, tombstones
from server.store import events as stored_events
from server.store.tables import (
    answers,
    episodes,
    events,
    exclusions,
    inputs,
    participants,
    pauses,
    personal,
    ticks,
    visits,
    withdrawals,
)

# Every table with rows of an episode or of a participant; a test finds a table that is missing here.
OF_EPISODES = (ticks, inputs, pauses, events, exclusions)
OF_PARTICIPANTS = (exclusions, answers, visits, events, personal)
_KEPT = tuple(participants.c[name] for name in ("study_id", "condition", "position", "simulated"))


@dataclass(frozen=True)
class Deletion:
    """The actor of a deletion, for the audit log; `detail` must not name the person. `at`: when the person
    was deleted before, by an existing tombstone."""

    actor: str = "participant"
    action: str = "withdraw"
    detail: Mapping[str, Any] = field(default_factory=dict)
    at: datetime | None = None


def withdraw(connection: Connection, participant_id: str, deletion: Deletion | None = None) -> bool:
    """Delete the participant from every table; False if there is none. Kept for counts: condition, step, time, and
    whether it was a bot. A tombstone stays, so that an older export does not bring the person back.

    Episodes go with their ticks, also those played with another participant, who keeps an event for each: the round
    was begun, and is not played again. On SQLite the deleted content is overwritten in the file; on PostgreSQL it is
    gone from the files after the next VACUUM.
    """
    here = participants.c.id == participant_id
    row = connection.execute(select(*_KEPT).where(here)).first()
    if row is None:
        return False
    deletion = deletion or Deletion()
    at = deletion.at or datetime.now(UTC)
    erase(connection, participant_id, at)
    study_reports.forget(connection, row.study_id)
    connection.execute(withdrawals.insert().values(withdrawn_at=at, **row._mapping))
    if deletion.at is None:
        tombstones.keep(connection, participant_id, at)
    audit.add(connection, deletion.actor, deletion.action, {"study": row.study_id} | dict(deletion.detail))
    engines.overwrite_deleted(connection)
    return True


def erase(connection: Connection, participant_id: str, at: datetime) -> None:
    """Delete every row about a participant, and the details of the audit log that name the participant or an episode of
    theirs. Counts, the tombstone and the entry of the audit log are up to the caller."""
    _note_shared_rounds(connection, participant_id, at)
    played = or_(episodes.c.participant_0 == participant_id, episodes.c.participant_1 == participant_id)
    delete_episodes(connection, list(connection.execute(select(episodes.c.id).where(played)).scalars()))
    for table in OF_PARTICIPANTS:
        connection.execute(delete(table).where(table.c.participant_id == participant_id))
    connection.execute(delete(participants).where(participants.c.id == participant_id))
    audit.forget(connection, participant_id)


def delete_episodes(connection: Connection, episode_ids: Sequence[str]) -> None:
    """Delete episodes with everything that was recorded in them. Answers about them stay with their participants."""
    for episode_id in episode_ids:
        connection.execute(update(answers).where(answers.c.episode_id == episode_id).values(episode_id=None))
        for table in OF_EPISODES:
            connection.execute(delete(table).where(table.c.episode_id == episode_id))
        connection.execute(delete(episodes).where(episodes.c.id == episode_id))
    audit.forget(connection, *episode_ids)


def deleted_rounds(connection: Connection, participant_id: str) -> set[str]:
    """Return the steps of the participant's rounds that were deleted because the partner withdrew."""
    noted = stored_events.of_participant(connection, participant_id, stored_events.PARTNER_WITHDREW)
    return {str(one.detail.get("step")) for one in noted}


def _note_shared_rounds(connection: Connection, participant_id: str, at: datetime) -> None:
    """Note, for the other person of each shared round, that it was begun. The event names neither the person who
    withdraws nor the episode."""
    here, there = episodes.c.participant_0, episodes.c.participant_1
    shared = [
        select(other, episodes.c.step_key).where(own == participant_id, other.is_not(None))
        for own, other in ((here, there), (there, here))
    ]
    rounds = {tuple(row) for query in shared for row in connection.execute(query)}
    kind = stored_events.PARTNER_WITHDREW
    new = [stored_events.Event(kind, at, other, detail={"step": step}) for other, step in sorted(rounds)]
    stored_events.add(connection, *new)
