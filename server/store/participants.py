"""Participants: their progress in the study. Personal data is stored separately, and only used for the participant
themselves.
"""

import hashlib
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import ColumnElement, Connection, and_, exists, false, func, or_, select, update

from server.store import studies as study_versions
from server.store.studies import StudyVersion
from server.store.tables import RECRUITMENT_ID, episodes, participants, personal, studies, withdrawals

Counts = dict[str, dict[str, int]]


def label(number: int, simulated: bool = False) -> str:
    """Return what researchers call a participant: P-012 of people, B-012 of bots."""
    return f"{'B' if simulated else 'P'}-{number:03d}"


@dataclass(frozen=True)
class Participant:
    """One row, without anything personal and without the token's hash."""

    id: str
    study_id: int
    number: int
    allocation_number: int  # among people only, or among bots only
    condition: str
    seed: int
    position: int
    status: str
    language: str
    simulated: bool
    started_at: datetime
    last_seen_at: datetime
    completed_at: datetime | None
    completion_code: str | None


@dataclass(frozen=True)
class NewParticipant:
    """What is known when somebody consents. `token`: what the cookie will carry; only its hash is stored."""

    study_id: int
    condition: str
    seed: int  # 63 bits
    token: str
    language: str = "en"
    simulated: bool = False
    recruitment_id: str | None = (
        None  # the recruiter's id of the person (PROLIFIC_PID, ...): one row per person and study
    )
    personal: Mapping[str, str] = field(default_factory=dict)


_COLUMNS = [participants.c[name] for name in Participant.__dataclass_fields__]


def new_token() -> str:
    """Return 256 random bits for a participant's cookie."""
    return secrets.token_urlsafe(32)


def token_hash(token: str) -> str:
    """Return what is stored of a token."""
    return hashlib.sha256(token.encode()).hexdigest()


def create(connection: Connection, new: NewParticipant) -> Participant:
    """Return the participant, numbered in order of consent through all versions of the study, so that researchers never
    see two of one name; the study version is frozen by the first one.

    A person who is in the study already (same `recruitment_id`) gets the row that there is, with the new token.
    """
    if new.recruitment_id is not None:
        known = by_recruitment_id(connection, new.study_id, new.recruitment_id)
        if known is not None:
            replace_token(connection, known.id, new.token)
            return known
    now = datetime.now(UTC)
    version = _count(connection, new, now)
    row: dict[str, Any] = {
        "id": secrets.token_hex(8),
        "study_id": new.study_id,
        "number": study_versions.started(connection, version.key),
        "allocation_number": version.enrolled(new.simulated),
        "condition": new.condition,
        "seed": new.seed,
        "token_hash": token_hash(new.token),
        "language": new.language,
        "simulated": new.simulated,
        "started_at": now,
        "last_seen_at": now,
    }
    made = connection.execute(participants.insert().values(row).returning(*_COLUMNS)).one()
    facts = dict(new.personal) | ({RECRUITMENT_ID: new.recruitment_id} if new.recruitment_id is not None else {})
    for key, value in facts.items():
        add_personal(connection, row["id"], new.study_id, key, value)
    return Participant(**made._mapping)


def _count(connection: Connection, new: NewParticipant, now: datetime) -> StudyVersion:
    """Count the participant; return the study version with the new counts."""
    s = studies.c
    counts = {"started": s.started + 1, "simulated_started": s.simulated_started + int(new.simulated)}
    query = update(studies).where(s.id == new.study_id).values(**counts, frozen_at=func.coalesce(s.frozen_at, now))
    return StudyVersion(**connection.execute(query.returning(*s)).one()._mapping)


def add_personal(connection: Connection, participant_id: str, study_id: int, key: str, value: str) -> None:
    """Keep a fact about the person, apart from the data; a second one under its key is an IntegrityError."""
    row = {"participant_id": participant_id, "study_id": study_id, "key": key, "value": value}
    connection.execute(personal.insert().values(row))


def personal_of(connection: Connection, participant_id: str) -> dict[str, str]:
    """Return what is kept about the person: recruitment ids for the way back to the recruiter, contact."""
    query = select(personal.c.key, personal.c.value).where(personal.c.participant_id == participant_id)
    return {row.key: row.value for row in connection.execute(query)}


def renew_personal(connection: Connection, participant_id: str, study_id: int, facts: Mapping[str, str]) -> None:
    """Replace what is known about the person by newer facts; keys that are not among them stay as they are."""
    for key, value in facts.items():
        here = (personal.c.participant_id == participant_id, personal.c.key == key)
        if not connection.execute(update(personal).where(*here).values(value=value)).rowcount:
            add_personal(connection, participant_id, study_id, key, value)


def get(connection: Connection, participant_id: str) -> Participant | None:
    """Return the participant with this id."""
    return _one(connection, participants.c.id == participant_id)


def by_token(connection: Connection, token: str) -> Participant | None:
    """Return the participant whose cookie this is."""
    return _one(connection, participants.c.token_hash == token_hash(token))


def by_recruitment_id(connection: Connection, study_id: int, recruitment_id: str) -> Participant | None:
    """Return the participant that the recruiter knows by this id."""
    person = select(personal.c.participant_id).where(
        personal.c.study_id == study_id, personal.c.key == RECRUITMENT_ID, personal.c.value == recruitment_id
    )
    return _one(connection, participants.c.id.in_(person))


def by_code(connection: Connection, study_id: int, code: str) -> Participant | None:
    """Return the participant of a study version who was given this completion code."""
    return _one(connection, and_(participants.c.study_id == study_id, participants.c.completion_code == code))


def find(connection: Connection, study_ids: Sequence[int], word: str) -> Participant | None:
    """Return the participant of these study versions with this id, completion code or recruiter's id."""
    person = select(personal.c.participant_id).where(
        personal.c.study_id.in_(study_ids), personal.c.key == RECRUITMENT_ID, personal.c.value.in_({word, word.lower()})
    )
    named = or_(
        participants.c.id == word.lower(), participants.c.completion_code == word.upper(), participants.c.id.in_(person)
    )
    query = select(*_COLUMNS).where(participants.c.study_id.in_(study_ids), named).order_by(participants.c.id)
    row = connection.execute(query).first() if word else None
    return Participant(**row._mapping) if row else None


def of_study(connection: Connection, study_id: int) -> list[Participant]:
    """Return all participants of a study version, in order of consent."""
    query = select(*_COLUMNS).where(participants.c.study_id == study_id).order_by(participants.c.number)
    return [Participant(**row._mapping) for row in connection.execute(query)]


def replace_token(connection: Connection, participant_id: str, token: str) -> None:
    """Replace the participant's token: the previous device is signed out."""
    query = update(participants).where(participants.c.id == participant_id)
    connection.execute(query.values(token_hash=token_hash(token)))


def seen(connection: Connection, participant_id: str) -> None:
    """Note that the participant is there now."""
    query = update(participants).where(participants.c.id == participant_id)
    connection.execute(query.values(last_seen_at=datetime.now(UTC)))


def give_more_time(connection: Connection, participant_id: str) -> bool:
    """Start the participant's time to come back again. False: the participation is over."""
    query = update(participants).where(participants.c.id == participant_id, participants.c.status == "active")
    return connection.execute(query.values(last_seen_at=datetime.now(UTC))).rowcount == 1


def advance(connection: Connection, participant_id: str, position: int, to: int) -> bool:
    """Move on from step `position` to step `to`. False, and nothing changes, if the participant is no longer there
    (the page was submitted twice, or in another tab) or no longer active."""
    query = update(participants).where(
        participants.c.id == participant_id, participants.c.position == position, participants.c.status == "active"
    )
    return connection.execute(query.values(position=to, last_seen_at=datetime.now(UTC))).rowcount == 1


def complete(connection: Connection, participant_id: str, code: str | None) -> str | None:
    """Mark the study as done and return the completion code: the first one given, however often this is called."""
    now = datetime.now(UTC)
    query = update(participants).where(participants.c.id == participant_id, participants.c.status == "active")
    connection.execute(query.values(status="completed", completed_at=now, last_seen_at=now, completion_code=code))
    stored = select(participants.c.completion_code).where(participants.c.id == participant_id)
    return connection.execute(stored).scalar_one_or_none()


def leave(connection: Connection, participant_id: str, status: str) -> bool:
    """End the participation early: screened_out, timed_out or returned. False if it was not active. The data stays."""
    if status not in ("screened_out", "timed_out", "returned"):
        raise ValueError(f"{status!r} cannot end a participation. Use screened_out, timed_out or returned.")
    query = update(participants).where(participants.c.id == participant_id, participants.c.status == "active")
    return connection.execute(query.values(status=status, last_seen_at=datetime.now(UTC))).rowcount == 1


def release_with_code(connection: Connection, participant_id: str, code: str) -> bool:
    """End the participation of somebody without a partner, with a completion code, so that they are paid; their place
    is free."""
    query = update(participants).where(participants.c.id == participant_id, participants.c.status == "active")
    values = {"status": "returned", "last_seen_at": datetime.now(UTC), "completion_code": code}
    return connection.execute(query.values(values)).rowcount == 1


def time_out(connection: Connection, study_id: int, before: datetime) -> int:
    """End the participation of all active who were not seen since `before`: their places are free. How many."""
    query = update(participants).where(
        participants.c.study_id == study_id, participants.c.status == "active", participants.c.last_seen_at < before
    )
    return connection.execute(query.values(status="timed_out")).rowcount


def silent(
    connection: Connection, study_ids: Sequence[int], before: datetime, simulated: bool = False
) -> dict[str, int]:
    """Count, by condition, the active people (or bots) who consented before the moment and have done nothing since.

    Something done: a page sent, or a game begun.
    """
    query = select(participants.c.condition, func.count()).where(
        participants.c.study_id.in_(study_ids), participants.c.simulated == simulated
    )
    query = query.where(participants.c.started_at < before, _idle())
    return {row[0]: row[1] for row in connection.execute(query.group_by(participants.c.condition))}


def consented_since(connection: Connection, study_ids: Sequence[int], since: datetime, until: datetime) -> list[int]:
    """Count the people who consented between the two moments: all, and those of them who have done nothing since."""
    new = select(func.count()).where(participants.c.study_id.in_(study_ids), ~participants.c.simulated)
    new = new.where(participants.c.started_at >= since, participants.c.started_at < until)
    return [int(connection.execute(query).scalar_one()) for query in (new, new.where(_idle()))]


def is_silent(connection: Connection, participant_id: str) -> bool:
    """Return whether the participant is active and has done nothing since consent."""
    query = select(participants.c.id).where(participants.c.id == participant_id, _idle())
    return connection.execute(query).first() is not None


def _idle() -> ColumnElement[bool]:
    played = or_(episodes.c.participant_0 == participants.c.id, episodes.c.participant_1 == participants.c.id)
    begun = exists().where(played, episodes.c.started_at.is_not(None)).correlate(participants)
    return and_(participants.c.status == "active", participants.c.position == 0, ~begun)


def set_language(connection: Connection, participant_id: str, language: str) -> None:
    """Set the language of the pages from now on."""
    connection.execute(update(participants).where(participants.c.id == participant_id).values(language=language))


def counts(connection: Connection, study_ids: Sequence[int], simulated: bool = False) -> Counts:
    """Return how many people (or bots) of each status each condition of these study versions has, e.g. {"tom":
    {"active": 2, "withdrawn": 1}}."""
    query = select(participants.c.condition, participants.c.status, func.count())
    query = query.where(participants.c.study_id.in_(study_ids), participants.c.simulated == simulated)
    found: Counts = {}
    for condition, status, count in connection.execute(query.group_by(participants.c.condition, participants.c.status)):
        found.setdefault(condition, {})[status] = count
    gone = select(withdrawals.c.condition, func.count()).where(withdrawals.c.study_id.in_(study_ids))
    gone = gone.where(func.coalesce(withdrawals.c.simulated, false()) == simulated)
    for condition, count in connection.execute(gone.group_by(withdrawals.c.condition)):
        found.setdefault(condition, {})["withdrawn"] = count
    return found


def _one(connection: Connection, condition: ColumnElement[bool]) -> Participant | None:
    row: Any = connection.execute(select(*_COLUMNS).where(condition)).first()
    return Participant(**row._mapping) if row else None
