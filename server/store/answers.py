"""Answers to questions, and which pages a participant was on when."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection, func, select, update

from server.store.tables import answers, visits


@dataclass(frozen=True)
class SubmittedPage:
    """One submitted page. `values`: by question key; `episode_id`: the episode that the questions are about;
    `attention`: whether each attention check among the questions was passed."""

    participant_id: str
    step_key: str
    values: Mapping[str, Any]
    episode_id: str | None = None
    took_ms: float | None = None
    attention: Mapping[str, bool] = field(default_factory=dict)


def save(connection: Connection, page: SubmittedPage) -> int:
    """Store what has no answer yet and return how many that were: the first answer to a question stays."""
    now = datetime.now(UTC)
    insert = _insert_of(connection)
    stored = 0
    for question_key, value in page.values.items():
        row = {
            "participant_id": page.participant_id,
            "episode_id": page.episode_id,
            "step_key": page.step_key,
            "question_key": question_key,
            "value": value,
            "submitted_at": now,
            "took_ms": page.took_ms,
            "attention": page.attention.get(question_key),
        }
        new = insert(answers).values(row).on_conflict_do_nothing().returning(answers.c.id)
        stored += connection.execute(new).first() is not None
    return stored


def _insert_of(connection: Connection) -> Any:
    """Return the database's own INSERT, imported when needed: a server with one database does not import the other."""
    if connection.dialect.name == "postgresql":
        from sqlalchemy.dialects.postgresql import insert as postgresql_insert

        return postgresql_insert
    from sqlalchemy.dialects.sqlite import insert as sqlite_insert

    return sqlite_insert


def of_participant(connection: Connection, participant_id: str) -> dict[str, dict[str, Any]]:
    """Return all answers: step key -> question key -> value, in the order of submission."""
    query = select(answers.c.step_key, answers.c.question_key, answers.c.value)
    query = query.where(answers.c.participant_id == participant_id).order_by(answers.c.id)
    found: dict[str, dict[str, Any]] = {}
    for step_key, question_key, value in connection.execute(query):
        found.setdefault(step_key, {})[question_key] = value
    return found


@dataclass(frozen=True)
class AttentionCount:
    """How many attention checks a participant answered, and how many of them wrongly."""

    answered: int
    failed: int


def attention_of(connection: Connection, participant_id: str) -> AttentionCount:
    """Count the participant's attention checks."""
    query = select(func.count(), func.count().filter(answers.c.attention.is_(False)))
    query = query.where(answers.c.participant_id == participant_id, answers.c.attention.is_not(None))
    answered, failed = connection.execute(query).one()
    return AttentionCount(answered, failed)


def enter(connection: Connection, participant_id: str, step_key: str) -> None:
    """Note that the participant requested the page of this step."""
    row = {"participant_id": participant_id, "step_key": step_key, "entered_at": datetime.now(UTC)}
    connection.execute(visits.insert().values(row))


def leave(connection: Connection, participant_id: str, step_key: str) -> float | None:
    """Close the newest visit of a submitted page; return how long it lasted, in ms (None: no visit)."""
    now = datetime.now(UTC)
    here = (visits.c.participant_id == participant_id, visits.c.step_key == step_key, visits.c.left_at.is_(None))
    last = connection.execute(
        select(visits.c.id, visits.c.entered_at).where(*here).order_by(visits.c.id.desc())
    ).first()
    if last is None:
        return None
    connection.execute(update(visits).where(visits.c.id == last.id).values(left_at=now))
    return float((now - last.entered_at).total_seconds() * 1000)
