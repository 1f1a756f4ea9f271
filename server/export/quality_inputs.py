"""Read some episodes in the form of the export, as input for the quality rules."""

from collections.abc import Sequence

import polars as pl
from sqlalchemy import Connection, Label, or_, select

from server.export import codebook, tick_rows
from server.export.rows import attention_counts, value_text
from server.export.writer import schema
from server.store import wrong_displays
from server.store.tables import answers, episodes, participants, pauses, studies

OVER = ("done", "aborted")
_e, _p, _a = episodes.c, participants.c, answers.c
Key = tuple[str, str, str]  # episode, participant, and the participant's status: later answers may change the result


def over(connection: Connection, study_ids: Sequence[int], most: int = 2000) -> list[Key]:
    """Return the episodes that are over, latest first."""
    mine = or_(_e.participant_0 == _p.id, _e.participant_1 == _p.id)
    query = select(_e.id, _p.id, _p.status).join_from(episodes, participants, mine)
    query = query.where(_e.study_id.in_(study_ids), _e.kind == "episode", _e.status.in_(OVER))
    return [(row[0], row[1], row[2]) for row in connection.execute(query.order_by(_e.ended_at.desc()).limit(most))]


_OF_EPISODES = (
    "participant_0", "participant_1", "agent_0", "agent_1", "agent_name", "condition", "kind", "layout",
    "number", "status", "score", "progress", "watched_seat", "tick_ms",
)  # fmt: skip


_OF_PAUSES = ("timestep", "reason", "started_at", "duration_ms", "seat", "away_ms")


def _failed() -> Label[int]:
    """Return the number of attention checks that a participant failed."""
    failed: Label[int] = attention_counts()[1].label("attention_failed")
    return failed


def tables(connection: Connection, chosen: Sequence[str]) -> dict[str, pl.DataFrame]:
    """Return the export's tables for these episodes: all episodes and answers of their participants, as a rule is about
    all of them together, but ticks and pauses of these episodes alone."""
    seats = select(_e.participant_0, _e.participant_1).where(_e.id.in_(chosen))
    people = {person for row in connection.execute(seats) for person in row} - {None}
    theirs = or_(_e.id.in_(chosen), _e.participant_0.in_(people), _e.participant_1.in_(people))
    own = [_e[name] for name in _OF_EPISODES]
    broken = wrong_displays.violations(connection, chosen)
    found = connection.execute(select(_e.id.label("episode"), *own).where(theirs)).mappings().all()
    played = [
        dict(row) | {"display_violations": broken.get(row["episode"], wrong_displays.NO_VIOLATIONS).timesteps}
        for row in found
    ]
    of_people = select(_p.id.label("participant"), studies.c.key.label("study"), _p.condition, _p.status, _failed())
    of_people = of_people.join_from(participants, studies).where(_p.id.in_(people))
    query = select(_a.participant_id, _a.episode_id, _a.question_key, _a.value, _a.attention)
    query = query.where(_a.participant_id.in_(people))
    held = select(pauses.c.episode_id.label("episode"), *(pauses.c[name] for name in _OF_PAUSES))
    named = ("participant", "episode", "question", "value", "value_type", "attention")
    given = [
        dict(zip(named, (*row[:3], *value_text(row[3]), row[4]), strict=True))
        for row in connection.execute(query.order_by(_a.id))
    ]
    types = schema(codebook.TICKS.columns)
    ticks = list(tick_rows.chunks(connection, iter(chosen), types))
    rows = {
        "participants": connection.execute(of_people).mappings().all(),
        "episodes": played,
        "answers": given,
        "pauses": connection.execute(held.where(pauses.c.episode_id.in_(chosen))).mappings().all(),
        "withdrawals": [],
    }
    made = {name: _table(name, [dict(row) for row in found]) for name, found in rows.items()}
    return made | {"ticks": pl.concat(ticks) if ticks else pl.DataFrame(schema=types)}


def _table(name: str, rows: Sequence[dict[str, object]]) -> pl.DataFrame:
    """Return the wanted columns, with the export's types."""
    table = next(one for one in codebook.TABLES if one.name == name)
    types = schema(table.columns)
    present = rows[0].keys() if rows else types.names()
    return pl.DataFrame(list(rows), schema={name: kind for name, kind in types.items() if name in present})
