"""Episodes: create, pause, end, load again. The live game stores them with `StoreRecorder`."""

import hashlib
import secrets
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from itertools import zip_longest
from typing import Any, Final

import msgspec
from sqlalchemy import ColumnElement, Connection, bindparam, false, func, or_, select, update

from server.play.episode_spec import EpisodeSpec
from server.play.recorder import (
    AWAY_REASONS,
    EpisodeRecord,
    EpisodeResult,
    PauseRecord,
    TickRecord,
)
from server.store import events
from server.store import inputs as input_rows
from server.store import ticks as tick_rows
from server.store.tables import episodes, pauses, ticks

_LONG_AGO = datetime(1970, 1, 1, tzinfo=UTC)
# msgspec (0.22) looks at a type when it first meets it, and two threads that do so at once can crash the process: after
# a restart many games are taken up at once. So it meets this one here, in one thread.
msgspec.json.Decoder(EpisodeSpec)


@dataclass(frozen=True)
class NewEpisode:
    """What is known before the first tick. Pairs are by seat; None where the seat is the other kind's."""

    spec: EpisodeSpec
    step_key: str  # step of the participants' plan
    participants: tuple[str | None, str | None] = (None, None)
    study_id: int | None = None
    condition: str | None = None
    agent_sha256s: tuple[str | None, str | None] = (None, None)
    predictor_sha256: str | None = None
    code_version: str = "unknown"
    agent_name: str | None = None  # what the study calls the partner, an agent or a person


@dataclass(frozen=True)
class StoredEpisode:
    """What there is to know of an episode without its ticks."""

    id: str
    study_id: int | None
    step_key: str
    attempt: int
    kind: str
    number: int
    participant_0: str | None
    participant_1: str | None
    condition: str | None
    layout: str
    status: str
    end_reason: str | None
    score: int | None
    soups: int | None
    progress: float | None
    passed: bool | None
    final_hash: str | None
    created_at: datetime
    started_at: datetime | None
    ended_at: datetime | None


class BrokenEpisode(Exception):
    """The stored episode is inconsistent; the message says what and where."""


_COLUMNS = [episodes.c[name] for name in StoredEpisode.__dataclass_fields__]


def is_misleading() -> ColumnElement[bool]:
    """Return whether an episode's marks were made to mislead; the specification of older ones does not say."""
    return func.coalesce(episodes.c.spec["misleading"].as_boolean(), false())


def create(connection: Connection, new: NewEpisode) -> str:
    """Return a new episode's id. It is the next attempt of its participants at their step."""
    spec = new.spec
    tried = select(func.max(episodes.c.attempt)).where(episodes.c.step_key == new.step_key, _has(new.participants))
    last = connection.execute(tried).scalar() if any(new.participants) else None
    row = {
        "id": secrets.token_hex(8),
        "study_id": new.study_id,
        "step_key": new.step_key,
        "attempt": (last or 0) + 1,
        "participant_0": new.participants[0],
        "participant_1": new.participants[1],
        "condition": new.condition,
        "layout_sha256": hashlib.sha256(spec.grid.encode()).hexdigest(),
        "agent_0": spec.agents[0],
        "agent_1": spec.agents[1],
        "agent_0_sha256": new.agent_sha256s[0],
        "agent_1_sha256": new.agent_sha256s[1],
        "predictor_sha256": new.predictor_sha256,
        "spec": msgspec.to_builtins(spec),
        "code_version": new.code_version,
        "created_at": datetime.now(UTC),
    }
    for name in (
        "kind",
        "number",
        "layout",
        "grid",
        "predictor",
        "watched_seat",
        "shown",
        "seed",
        "horizon",
        "tick_ms",
    ):
        row[name] = getattr(spec, name)
    if new.agent_name is not None:
        row["agent_name"] = new.agent_name
    connection.execute(episodes.insert().values(row))
    return str(row["id"])


def of_step(connection: Connection, participant_id: str, step_key: str) -> StoredEpisode | None:
    """Return the participant's latest attempt at a step."""
    query = select(*_COLUMNS).where(episodes.c.step_key == step_key, _has((participant_id,)))
    row = connection.execute(query.order_by(episodes.c.attempt.desc())).first()
    return StoredEpisode(**row._mapping) if row else None


def of_participant(connection: Connection, participant_id: str) -> list[StoredEpisode]:
    """Return all the participant's episodes, oldest first."""
    query = select(*_COLUMNS).where(_has((participant_id,))).order_by(episodes.c.created_at, episodes.c.id)
    return [StoredEpisode(**row._mapping) for row in connection.execute(query)]


def get(connection: Connection, episode_id: str) -> StoredEpisode | None:
    """Return the episode with this id."""
    row = connection.execute(select(*_COLUMNS).where(episodes.c.id == episode_id)).first()
    return StoredEpisode(**row._mapping) if row else None


def unfinished(connection: Connection, study_id: int | None = None) -> list[str]:
    """Return the ids of episodes (of one study version) that can still be played, oldest first."""
    query = select(episodes.c.id).where(episodes.c.status.in_(("new", "running")))
    if study_id is not None:
        query = query.where(episodes.c.study_id == study_id)
    return list(connection.execute(query.order_by(episodes.c.created_at, episodes.c.id)).scalars())


def load(connection: Connection, episode_id: str) -> EpisodeRecord | None:
    """Return the episode in the state after its last stored tick. Raises BrokenEpisode."""
    row = connection.execute(select(episodes).where(episodes.c.id == episode_id)).first()
    if row is None:
        return None
    query = select(ticks).where(ticks.c.episode_id == episode_id).order_by(ticks.c.timestep)
    stored = connection.execute(query).all()
    for expected, tick in enumerate(stored):
        if tick.timestep != expected:
            raise BrokenEpisode(f"episode {episode_id} has no tick {expected} although it has tick {tick.timestep}")
    last = tick_rows.record_of(stored[-1]) if stored else None
    held = pauses_of(connection, episode_id)
    return EpisodeRecord(
        episode=episode_id,
        participants=(row.participant_0, row.participant_1),
        spec=msgspec.convert(row.spec, EpisodeSpec),
        joint_actions=tuple((tick.action_0, tick.action_1) for tick in stored[1:]),
        last_hash=last.state_hash if last else None,
        status=row.status,
        paused_ms=_away_ms(held),
        next_actions=last.next_actions if last else None,
        displayed=last.displayed if last else None,
        known_at=_known_at(last, held),
        inputs=input_rows.stored(connection, episode_id),
        asked=last.asked if last else None,
        displayed_intention=last.displayed_intention if last else None,
        is_paused=row.paused_by is not None,
        more_time_s=events.more_time_s(connection, episode_id).get(episode_id, 0.0),
    )


def _known_at(last: TickRecord | None, held: Sequence[PauseRecord]) -> datetime | None:
    """Return the last moment of the episode that is stored: that of its last state, or of the end of a pause. None
    where a pause is still open (it covers the time since), or where the last state has no time (older versions)."""
    if last is None or last.made_unix_ms is None or any(one.duration_ms is None for one in held):
        return None
    # Not at the very end of a pause: an absence whose end nobody saw ends in the moment in which the next one begins.
    ends = [one.started_at + timedelta(milliseconds=one.duration_ms or 0, microseconds=1) for one in held]
    return max(datetime.fromtimestamp(last.made_unix_ms / 1000, UTC), *ends, _LONG_AGO)


def _away_ms(stored: Sequence[PauseRecord]) -> float:
    """Return how long people were away. Older versions stored the first reason of a pause only: if that is an absence,
    all of the pause counts, but not where a server died during it, as nobody knows how much of it was the person's."""
    away = 0.0
    for one, following in zip_longest(stored, stored[1:]):
        if one.away_ms is not None:
            away += one.away_ms
        elif one.reason in AWAY_REASONS and one.duration_ms is not None:
            end = one.started_at + timedelta(milliseconds=one.duration_ms)
            cut_off = following is not None and following.reason == "server" and following.started_at == end
            away += 0.0 if cut_off else one.duration_ms
    return away


def pause(connection: Connection, record: PauseRecord) -> None:
    """Store the beginning of a pause, and its end when called again with the same start.

    A game has one pause at a time: one that is still open was left by a server that died, and ends where this begins.
    How much of that one was a person's absence nobody knows, so it is not held against them.
    """
    here = {"episode": record.episode, "start": record.started_at}
    row = {name: getattr(record, name) for name in _STORED}
    if connection.execute(_END_PAUSE, here | row).rowcount:
        return input_rows.insert(connection, record.inputs)
    if connection.execute(_EPISODE_IS_STORED, here).first() is None:
        return None
    for left in connection.execute(_OPEN_BEFORE, here).all():
        lasted_ms = (record.started_at - left.started_at) / timedelta(milliseconds=1)
        pause(connection, replace(_pause_of(left), duration_ms=lasted_ms, away_ms=0.0))
    connection.execute(_BEGIN_PAUSE, {"episode_id": record.episode, "started_at": record.started_at, **row})
    return input_rows.insert(connection, record.inputs)


_STORED: Final = ("timestep", "reason", "duration_ms", "seat", "away_ms")
# Made once: many games pause in the same moment when a machine or a network halts, and building a statement each time
# took longer than running it.
_HERE: Final = pauses.c.episode_id == bindparam("episode")
_END_PAUSE: Final = update(pauses).where(_HERE, pauses.c.started_at == bindparam("start"))
_EPISODE_IS_STORED: Final = select(episodes.c.id).where(episodes.c.id == bindparam("episode"))
_IS_OPEN: Final = pauses.c.duration_ms.is_(None)
_OPEN_BEFORE: Final = select(pauses).where(_HERE, _IS_OPEN, pauses.c.started_at < bindparam("start"))
_BEGIN_PAUSE: Final = pauses.insert()


def pauses_of(connection: Connection, episode_id: str) -> list[PauseRecord]:
    """Return the episode's pauses, in order."""
    rows = connection.execute(select(pauses).where(pauses.c.episode_id == episode_id).order_by(pauses.c.started_at))
    return [_pause_of(row) for row in rows]


def _pause_of(row: Any) -> PauseRecord:
    return PauseRecord(row.episode_id, **{name: getattr(row, name) for name in ("started_at", *_STORED)})


def end(connection: Connection, result: EpisodeResult) -> bool:
    """Store how the episode ended. False if its end was stored before: the first one stays."""
    query = update(episodes).where(episodes.c.id == result.episode, episodes.c.status.in_(("new", "running")))
    values = {
        "status": result.status,
        "end_reason": result.reason,
        "score": result.score,
        "soups": result.soups,
        "progress": result.progress,
        "passed": result.passed,
        "final_hash": result.final_hash,
        "ended_at": datetime.now(UTC),
    }
    if is_first := connection.execute(query.values(values)).rowcount == 1:
        input_rows.insert(connection, result.inputs)
    return is_first


def _has(participants: Sequence[str | None]) -> Any:
    present = [participant for participant in participants if participant is not None]
    return or_(episodes.c.participant_0.in_(present), episodes.c.participant_1.in_(present))
