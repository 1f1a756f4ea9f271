"""Read the rows of an export from the database, in the codebook's order of columns; streamed, in constant memory.

Nothing personal, no token and no completion code is read here.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

import msgspec
from sqlalchemy import Connection, Select, func, select, true

from server.export import factor_levels
from server.export.codebook import WIDE
from server.export.codebook_columns import Column
from server.store import studies as versions
from server.store import ticks as tick_rows
from server.store.episodes import is_misleading
from server.store.studies import StudyVersion
from server.store.tables import (
    answers,
    arrivals,
    episodes,
    events,
    exclusions,
    inputs,
    participants,
    pauses,
    studies,
    ticks,
    visits,
    withdrawals,
)
from server.store.wrong_displays import NO_VIOLATIONS, violations

Row = tuple[Any, ...]
Rows = Iterator[Row]
_FETCH = 2000
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_e, _p = episodes.c, participants.c
_STUDY = (studies.c.key, studies.c.version)
_DISPLAY_SETTINGS = (("show", "always"), ("view_radius", 0), ("misleading", False))
_EPISODE_ORDER = (_e.study_id.nulls_first(), _e.created_at, _e.id)  # the same on every database
_PARTICIPANT_ORDER = (_p.study_id, _p.number)


@dataclass(frozen=True)
class Selection:
    """What is exported: versions of studies (None: everything, including data outside of studies)."""

    connection: Connection
    study_ids: tuple[int, ...] | None = None

    def rows(self, query: "Select[Any]", study: Any) -> Iterator[Any]:
        if self.study_ids is not None:
            query = query.where(study.in_(self.study_ids))
        return iter(self.connection.execute(query, execution_options={"yield_per": _FETCH}))


def study_rows(chosen: Selection) -> Rows:
    s = studies.c
    gone = select(func.count()).where(withdrawals.c.study_id == s.id).scalar_subquery()
    query = select(*_STUDY, s.sha256, s.started, s.simulated_started, gone, s.created_at, s.frozen_at).order_by(s.id)
    return (tuple(row) for row in chosen.rows(query, s.id))


def arrival_rows(chosen: Selection) -> Rows:
    a = arrivals.c
    query = select(*_STUDY, a.kind, a.reason, a.count).join_from(arrivals, studies)
    return (tuple(row) for row in chosen.rows(query.order_by(a.study_id, a.kind, a.reason), a.study_id))


def withdrawal_rows(chosen: Selection) -> Rows:
    w = withdrawals.c
    query = select(*_STUDY, w.condition, w.position, w.simulated, w.withdrawn_at).join_from(withdrawals, studies)
    return (tuple(row) for row in chosen.rows(query.order_by(w.id), w.study_id))


def participant_rows(chosen: Selection, wide: tuple[Column, ...]) -> Rows:
    query = select(_p.id, *_STUDY, _p.number, _p.allocation_number, _p.condition, _p.status, _p.language)
    query = query.add_columns(_p.simulated, _p.seed, _p.position, _p.started_at, _p.last_seen_at, _p.completed_at)
    query = query.add_columns(_excluded(None), *attention_counts()).join_from(participants, studies)
    levels = factor_levels.factor_levels(_versions(chosen))
    for row in chosen.rows(query.order_by(*_PARTICIPANT_ORDER), _p.study_id):
        values = dict(_wide_values(chosen, row.id))
        if known := levels.get(factor_levels.version_key(row.key, row.version)):
            values |= known.of_participant(row.condition)
        yield (*row, *(values.get(column.name) for column in wide))


def _versions(chosen: Selection) -> list[StudyVersion]:
    every = versions.every(chosen.connection)
    return [version for version in every if chosen.study_ids is None or version.id in chosen.study_ids]


def wide_columns(chosen: Selection) -> tuple[Column, ...]:
    """Return the columns that the participants' table has for this study's factors, episodes and questions."""
    numbers = select(_e.number).where(_e.kind == "episode").distinct().order_by(_e.number)
    found = list(factor_levels.participant_columns(factor_levels.factor_levels(_versions(chosen))))
    found += [
        Column(pattern.name.format(number=row.number), pattern.type, pattern.meaning, pattern.unit, pattern.bits)
        for row in chosen.rows(numbers, _e.study_id)
        for pattern in WIDE[:-1]
    ]
    answer, a = WIDE[-1], answers.c
    questions = select(a.step_key, a.question_key).join_from(answers, participants).distinct()
    for step, question in sorted(tuple(row) for row in chosen.rows(questions, _p.study_id)):
        name = answer.name.format(step=step, question=question)
        found.append(Column(name, answer.type, answer.meaning))
    return tuple(found)


def _wide_values(chosen: Selection, participant: str) -> Iterator[tuple[str, Any]]:
    mine = (_e.participant_0 == participant) | (_e.participant_1 == participant)
    query = select(_e.number, _e.layout, _e.watched_seat, _e.agent_0, _e.agent_1, _e.score, _e.progress)
    query = query.add_columns(_e.agent_name).where(mine, _e.kind == "episode").order_by(_e.attempt)
    for row in chosen.connection.execute(query):
        agent = row.agent_name or (row.agent_0, row.agent_1)[row.watched_seat]
        for pattern, value in zip(WIDE, (row.layout, agent, row.score, row.progress), strict=False):
            yield pattern.name.format(number=row.number), value
    query = select(answers.c.step_key, answers.c.question_key, answers.c.value)
    for answer in chosen.connection.execute(query.where(answers.c.participant_id == participant)):
        yield WIDE[-1].name.format(step=answer.step_key, question=answer.question_key), value_text(answer.value)[0]


def wide_episode_columns(chosen: Selection) -> tuple[Column, ...]:
    """Return the columns that the episodes' table has for this study's factors."""
    return factor_levels.episode_columns(factor_levels.factor_levels(_versions(chosen)))


def episode_rows(chosen: Selection, wide: tuple[Column, ...]) -> Rows:
    first = select(_e.id, *_STUDY, _e.participant_0, _e.participant_1, _e.condition, _e.kind, _e.number, _e.step_key)
    models = (
        _e.agent_0,
        _e.agent_1,
        _e.agent_name,
        _e.agent_0_sha256,
        _e.agent_1_sha256,
        _e.predictor,
        _e.predictor_sha256,
    )
    query = first.add_columns(_e.attempt, _e.layout, _e.layout_sha256, *models, _e.watched_seat, _e.shown, _e.seed)
    query = query.add_columns(_e.horizon, _e.tick_ms, _e.status, _e.end_reason, _e.score, _e.soups, _e.progress)
    query = query.add_columns(_e.passed, _e.final_hash, _e.created_at, _e.started_at, _e.ended_at, _e.code_version)
    query = (
        query.add_columns(_excluded(_e.id), _e.spec)
        .join_from(episodes, studies, isouter=True)
        .order_by(*_EPISODE_ORDER)
    )
    names = list(query.selected_columns.keys())
    before_display, before_timesteps = names.index("seed"), names.index("score")
    levels = factor_levels.factor_levels(_versions(chosen))
    for row in chosen.rows(query, _e.study_id):
        last = select(ticks).where(ticks.c.episode_id == row.id).order_by(ticks.c.timestep.desc()).limit(1)
        stored = chosen.connection.execute(last).first()
        timesteps = stored.timestep if stored else None
        values = tuple(row[:-1])
        rest = (json_text(row.spec), last_tick_text(stored) if stored else None)
        broken = violations(chosen.connection, [row.id]).get(row.id, NO_VIOLATIONS)
        spec = row.spec
        known = levels.get(factor_levels.version_key(row.key, row.version)) if row.key else None
        own = known.of_episode(row.condition, row.number) if known else {}
        drawn = "none" if row.shown == "nothing" else spec.get("display", "actions")
        given = (spec.get(name, default) for name, default in _DISPLAY_SETTINGS)
        display = (drawn, *given, *broken)
        yield (
            *values[:before_display], *display, *values[before_display:before_timesteps], timesteps,
            *values[before_timesteps:], *rest, *(own.get(column.name) for column in wide),
        )  # fmt: skip


def last_tick_text(stored: Any) -> str:
    """Return a tick's values of its own state as JSON: all but the step that led to it."""
    record = msgspec.to_builtins(tick_rows.record_of(stored))
    names = ("state_hash", "next_actions", "prediction", "displayed", "late", "asked", "misleading", "in_sight")
    times = ("scheduled_ms", "late_ms", "models_ms", "made_unix_ms")
    return json_text({name: record[name] for name in (*names, "intentions", "displayed_intention", *times)})


def pause_rows(chosen: Selection) -> Rows:
    c = pauses.c
    columns = (c.episode_id, c.timestep, c.reason, c.started_at, c.duration_ms, c.seat, c.away_ms)
    query = select(*columns).join_from(pauses, episodes)
    return (tuple(row) for row in chosen.rows(query.order_by(*_EPISODE_ORDER, c.started_at), _e.study_id))


def input_rows(chosen: Selection) -> Rows:
    """Yield the inputs with the timesteps of an export: timestep t is the one whose action leads to state t + 1."""
    c = inputs.c
    query = select(c.episode_id, c.seat, c.number, c.tab, c.seq, c.held, c.tap, c.marks)
    query = query.add_columns(c.client_ms, c.received_unix_ms, c.received_ms, c.timestep - 1, c.outcome)
    query = query.join_from(inputs, episodes)
    order = (*_EPISODE_ORDER, c.received_unix_ms, c.seat, c.number)
    for row in chosen.rows(query.order_by(*order), _e.study_id):
        yield (*row[:9], time_of(row.received_unix_ms), *row[10:])


def time_of(unix_ms: float) -> datetime:
    """Return the instant, to the microsecond."""
    return _EPOCH + timedelta(microseconds=round(unix_ms * 1000))


def answer_rows(chosen: Selection) -> Rows:
    a = answers.c
    query = select(a.participant_id, a.episode_id, a.step_key, a.question_key, a.value, a.submitted_at, a.took_ms)
    query = query.add_columns(a.attention).join_from(answers, participants).order_by(*_PARTICIPANT_ORDER, a.id)
    for row in chosen.rows(query, _p.study_id):
        yield (*row[:4], *value_text(row.value), *row[5:])


def visit_rows(chosen: Selection) -> Rows:
    v = visits.c
    query = select(v.participant_id, v.step_key, v.entered_at, v.left_at).join_from(visits, participants)
    return (tuple(row) for row in chosen.rows(query.order_by(*_PARTICIPANT_ORDER, v.id), _p.study_id))


def event_rows(chosen: Selection) -> Rows:
    c = events.c
    query = select(c.participant_id, c.episode_id, c.at, c.kind, c.detail).join_from(events, participants, isouter=True)
    return ((*row[:4], json_text(row.detail)) for row in chosen.rows(query.order_by(c.id), _p.study_id))


def exclusion_rows(chosen: Selection) -> Rows:
    x = exclusions.c
    query = select(x.participant_id, x.episode_id, x.reason, x.note, x.excluded_at, x.restored_at)
    query = query.join_from(exclusions, participants).order_by(*_PARTICIPANT_ORDER, x.id)
    return (tuple(row) for row in chosen.rows(query, _p.study_id))


def _excluded(episode: Any) -> Any:
    """Select the reason of the latest exclusion in force: of this episode, or (None) of all data of the participant."""
    x = exclusions.c
    about = (x.participant_id == _p.id, x.episode_id.is_(None)) if episode is None else (x.episode_id == episode,)
    found = select(x.reason).where(*about, x.restored_at.is_(None)).order_by(x.id.desc()).limit(1)
    return found.scalar_subquery()


def attention_counts() -> tuple[Any, Any]:
    """Return two SQL expressions for a query of participants: how many attention checks each answered, and how many
    wrongly."""
    a = answers.c
    checks = select(func.count()).where(a.participant_id == _p.id, a.attention.is_not(None))
    return checks.scalar_subquery(), checks.where(a.attention.is_(False)).scalar_subquery()


def has_misleading(chosen: Selection) -> bool:
    """Return whether any episode was made to mislead."""
    return next(chosen.rows(select(_e.id).where(misleading()).limit(1), _e.study_id), None) is not None


def misleading() -> Any:
    """Return the SQL condition that an episode was made to mislead. Older episodes do not say, so it does not hold."""
    return is_misleading() == true()


def episode_ids(chosen: Selection) -> Iterator[str]:
    """Return the ids of the chosen episodes, in the order of the table of episodes."""
    return (row.id for row in chosen.rows(select(_e.id).order_by(*_EPISODE_ORDER), _e.study_id))


def value_text(value: Any) -> tuple[str | None, str]:
    """Return an answer as text, and its type: text, boolean, number, null (the text is None) or list."""
    if isinstance(value, str):
        return value, "text"
    if isinstance(value, bool):
        return json_text(value), "boolean"
    if isinstance(value, int | float):
        return json_text(value), "number"
    return (None, "null") if value is None else (json_text(value), "list")


def json_text(value: Any) -> str:
    """Return JSON that is the same for equal values."""
    return json.dumps(value, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
