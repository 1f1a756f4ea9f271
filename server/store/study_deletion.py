"""Delete all data of a study, in all its versions, when its retention period ends.

Each participant is deleted in a transaction of its own: a single one would hold the database for as long as all rows
take, and the games of other studies would stand still. A deletion that was interrupted is finished by the next one.

What stays names no participant: the versions of the study with their text, what researchers did (openings, pauses,
drafts), the tombstones, and the audit log.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Final

from sqlalchemy import ColumnElement, Connection, Table, delete, func, or_, select

from server.store import (
    audit,
    engines,
    enrolment_limits,
    interventions,
    overview,
    studies,
    study_openings,
    study_reports,
    tombstones,
    withdrawal,
)
from server.store import tables as t

ACTION: Final = "delete study"
# Every table with rows of a study that belong to none of its participants; a test finds a table that is missing here.
OF_STUDIES: Final = (t.arrivals, t.withdrawals)
KEPT: Final = (t.study_openings, t.study_pauses)


@dataclass(frozen=True)
class StudyData:
    """What is stored of a study. `participants`: their ids. `counts`: what a deletion would delete, in words."""

    study: str
    versions: int
    participants: tuple[str, ...]
    counts: Mapping[str, int]

    @property
    def is_empty(self) -> bool:
        return not any(self.counts.values())


def data_of(connection: Connection, study: str) -> StudyData:
    """Return what is stored of a study. Raises ValueError for an unknown name."""
    versions = studies.known_ids(connection, study)
    p = t.participants.c
    people = connection.execute(select(p.id, p.simulated).where(p.study_id.in_(versions)).order_by(p.study_id, p.id))
    bots = {row.id: bool(row.simulated) for row in people}
    counts = {"participants": len(bots) - sum(bots.values()), "simulated participants": sum(bots.values())}
    counts["episodes"] = _count(connection, t.episodes, _played_in(versions))
    of_people = select(p.id).where(p.study_id.in_(versions))
    for words, table in (("answers", t.answers), ("page visits", t.visits), ("personal data", t.personal)):
        counts[words] = _count(connection, table, table.c.participant_id.in_(of_people))
    for words, table in (("visitor counts", t.arrivals), ("withdrawals", t.withdrawals)):
        counts[words] = _count(connection, table, table.c.study_id.in_(versions))
    counts["kept reports"] = _count(connection, t.study_reports, t.study_reports.c.study == study)
    return StudyData(study, len(versions), tuple(bots), counts)


def check_idle(connection: Connection, study: str, served: bool) -> None:
    """Raise ValueError while somebody is in a game of the study, or could be soon. `served`: another process has the
    database open. Which files a server serves is not stored, so with one the study must be closed to everybody."""
    playing = overview.playing(connection, t.participants.c.study_id.in_(studies.ids_of(connection, study)))
    if playing:
        raise ValueError(f"in a game of {study} now: {', '.join(playing[:5])}. Wait until it is over")
    is_shut = study in interventions.paused_studies(connection) or study in study_openings.closed(connection)
    if served and not is_shut:
        raise ValueError(
            f"a server uses this database, and {study} is neither paused nor closed. Pause it in the dashboard "
            f"(/admin/s/{study}), or stop the server"
        )


def begin(connection: Connection, data: StudyData, served: bool, reason: str) -> None:
    """Note the deletion in the audit log, before the first row goes. Raises ValueError (see `check_idle`)."""
    check_idle(connection, data.study, served)
    numbers = {name: data.counts[name] for name in ("participants", "simulated participants", "episodes")}
    audit.add(connection, "command line", ACTION, {"study": data.study, "reason": reason} | numbers)
    _forget_reports(connection, data.study)


def delete_participant(connection: Connection, participant_id: str) -> None:
    """Delete one participant; only a tombstone stays. Does nothing if the participant has withdrawn since. Raises
    ValueError if a game has begun since: participants of a closed study may finish it."""
    this = t.participants.c.id == participant_id
    if connection.execute(select(t.participants.c.id).where(this)).first() is None:
        return
    for label in overview.playing(connection, this):
        raise ValueError(f"{label} has begun a game during the deletion. Repeat it when the game is over")
    at = datetime.now(UTC)
    withdrawal.erase(connection, participant_id, at)
    tombstones.keep(connection, participant_id, at)
    engines.overwrite_deleted(connection)


def finish(connection: Connection, study: str) -> None:
    """Delete what belongs to no participant. Raises ValueError if somebody has joined since: they were not counted."""
    versions = studies.ids_of(connection, study)
    joined = _count(connection, t.participants, t.participants.c.study_id.in_(versions))
    if joined:
        raise ValueError(
            f"{joined} joined {study} during the deletion and are still stored. Close the study, and repeat"
        )
    left = select(t.episodes.c.id).where(_played_in(versions))
    withdrawal.delete_episodes(connection, list(connection.execute(left).scalars()))
    for table in OF_STUDIES:
        connection.execute(delete(table).where(table.c.study_id.in_(versions)))
    _forget_reports(connection, study)
    enrolment_limits.forget_turned_away(connection, study)
    engines.overwrite_deleted(connection)


def _forget_reports(connection: Connection, study: str) -> None:
    for version in studies.ids_of(connection, study):
        study_reports.forget(connection, version)


def _played_in(versions: list[int]) -> ColumnElement[bool]:
    e, p = t.episodes.c, t.participants.c
    people = select(p.id).where(p.study_id.in_(versions))
    return or_(e.study_id.in_(versions), e.participant_0.in_(people), e.participant_1.in_(people))


def _count(connection: Connection, table: Table, condition: ColumnElement[bool]) -> int:
    return connection.execute(select(func.count()).select_from(table).where(condition)).scalar_one()
