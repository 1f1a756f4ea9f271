"""Participants, episodes and answers of a study as a table: filtered, sorted and paged by the database.

Nothing personal, no token and no completion code is read here.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import JSON, ColumnElement, Connection, Select, String, and_, case, cast, func, not_, or_, select

from server.store.tables import answers, episodes, exclusions, participants, studies

PAGE_ROWS: Final = 50
_p, _e, _a, _s = participants.c, episodes.c, answers.c, studies.c


@dataclass(frozen=True)
class ViewColumn:
    """One column. `blinds`: it reveals the condition, so blind mode hides it."""

    name: str
    title: str
    value: ColumnElement[Any]
    blinds: bool = False


@dataclass(frozen=True)
class DataTable:
    """One table. `joined` adds to a query from where the columns come; `order`: how its rows come by themselves."""

    name: str
    columns: tuple[ViewColumn, ...]
    joined: Callable[["Select[Any]"], "Select[Any]"]
    order: tuple[ColumnElement[Any], ...]


@dataclass(frozen=True)
class DataQuery:
    """What is shown. `sort`: a column's name, with - before it for the other way round; `column`: where `contains` is
    looked for, empty: in all. `hidden_questions`: questions that reveal the condition by being asked."""

    table: str
    study_ids: tuple[int, ...]
    contains: str = ""
    column: str = ""
    sort: str = ""
    blind: bool = True
    hidden_questions: tuple[str, ...] = ()


@dataclass(frozen=True)
class DataPage:
    """Some rows of a table, in the order of `columns`; `person` is the participant's id for a link."""

    columns: tuple[ViewColumn, ...]
    rows: list[tuple[Any, ...]]
    people: list[str | None]
    total: int


def _excluded(episode: bool) -> ColumnElement[Any]:
    x = exclusions.c
    about = (x.episode_id == _e.id) if episode else and_(x.participant_id == _p.id, x.episode_id.is_(None))
    newest = select(x.reason).where(about, x.restored_at.is_(None)).order_by(x.id.desc()).limit(1)
    return newest.scalar_subquery()


def _checks(failed: bool) -> ColumnElement[Any]:
    query = select(func.count()).where(_a.participant_id == _p.id, _a.attention.is_not(None))
    return (query.where(_a.attention.is_(False)) if failed else query).scalar_subquery()


_WHO = (
    ViewColumn("participant", "Participant", _p.number),
    ViewColumn("version", "Study version", _s.version),
    ViewColumn("simulated", "Simulated", _p.simulated),
)
_CONDITION = ViewColumn("condition", "Condition", _p.condition, blinds=True)
_AGENT = func.coalesce(_e.agent_name, case((_e.watched_seat == 0, _e.agent_0), else_=_e.agent_1), "")

TABLES: Final = {
    table.name: table
    for table in (
        DataTable(
            "participants",
            (
                *_WHO,
                _CONDITION,
                ViewColumn("status", "Status", _p.status),
                ViewColumn("language", "Language", _p.language),
                ViewColumn("position", "Step", _p.position),
                ViewColumn("started_at", "Consent", _p.started_at),
                ViewColumn("last_seen_at", "Last seen", _p.last_seen_at),
                ViewColumn("completed_at", "Completed", _p.completed_at),
                ViewColumn("excluded", "Excluded", _excluded(episode=False)),
                ViewColumn("attention_checks", "Attention checks", _checks(failed=False)),
                ViewColumn("attention_failed", "Failed", _checks(failed=True)),
            ),
            lambda query: query.join_from(participants, studies),
            (_p.study_id, _p.number),
        ),
        DataTable(
            "episodes",
            (
                *_WHO,
                _CONDITION,
                ViewColumn("kind", "Kind", _e.kind),
                ViewColumn("number", "Number", _e.number),
                ViewColumn("attempt", "Attempt", _e.attempt),
                ViewColumn("layout", "Layout", _e.layout),
                ViewColumn("agent", "Agent", _AGENT),
                ViewColumn("shown", "Shown", _e.shown, blinds=True),
                ViewColumn("status", "Status", _e.status),
                ViewColumn("end_reason", "End", _e.end_reason),
                ViewColumn("score", "Score", _e.score),
                ViewColumn("soups", "Soups", _e.soups),
                ViewColumn("progress", "Progress", _e.progress),
                ViewColumn("started_at", "Began", _e.started_at),
                ViewColumn("ended_at", "Ended", _e.ended_at),
                ViewColumn("excluded", "Excluded", _excluded(episode=True)),
            ),
            lambda query: query.join_from(
                episodes, participants, or_(_e.participant_0 == _p.id, _e.participant_1 == _p.id)
            ).join(studies, _s.id == _p.study_id),
            (_p.study_id, _p.number, _e.created_at, _e.id),
        ),
        DataTable(
            "answers",
            (
                *_WHO,
                _CONDITION,
                ViewColumn("step", "Page", _a.step_key),
                ViewColumn("question", "Question", _a.question_key),
                ViewColumn("value", "Answer", _a.value),
                ViewColumn("attention", "Attention check passed", _a.attention),
                ViewColumn("submitted_at", "Sent", _a.submitted_at),
                ViewColumn("took_ms", "Time on the page (ms)", _a.took_ms),
            ),
            lambda query: query.join_from(answers, participants, _a.participant_id == _p.id).join(
                studies, _s.id == _p.study_id
            ),
            (_p.study_id, _p.number, _a.id),
        ),
    )
}


def columns_of(wanted: DataQuery) -> tuple[ViewColumn, ...]:
    """Return the columns of a table that may be seen. Raises KeyError for an unknown table."""
    return tuple(one for one in TABLES[wanted.table].columns if not (wanted.blind and one.blinds))


def data_page(connection: Connection, wanted: DataQuery, first: int, most: int = PAGE_ROWS) -> DataPage:
    """Return `most` rows from row `first` (0: the first one), and how many there are in all."""
    table, columns = TABLES[wanted.table], columns_of(wanted)
    filters = _filters(wanted, columns)
    total = connection.execute(table.joined(select(func.count())).where(*filters)).scalar_one()
    query = table.joined(select(_p.id, *(one.value.label(f"c_{one.name}") for one in columns))).where(*filters)
    found = connection.execute(query.order_by(*_order(wanted, columns, table)).offset(first).limit(most)).all()
    return DataPage(columns, [tuple(row[1:]) for row in found], [row[0] for row in found], total)


def _filters(wanted: DataQuery, columns: Sequence[ViewColumn]) -> list[ColumnElement[bool]]:
    filters: list[ColumnElement[bool]] = [_p.study_id.in_(wanted.study_ids)]
    if wanted.table == "answers" and wanted.blind and wanted.hidden_questions:
        filters.append(not_(_a.question_key.in_(wanted.hidden_questions)))
    if wanted.contains:
        places = [one for one in columns if wanted.column in ("", one.name)]
        filters.append(or_(*(_contains(one.value, wanted.contains) for one in places)))
    return filters


def _contains(value: ColumnElement[Any], words: str) -> ColumnElement[bool]:
    """Return whether a value's text has these words in it, in capitals or not."""
    if isinstance(value.type, JSON):
        words = json.dumps(words)[1:-1]  # as JSON is stored: other than ASCII letters are escaped
    return func.lower(cast(value, String)).contains(words.lower(), autoescape=True)


def _order(wanted: DataQuery, columns: Sequence[ViewColumn], table: DataTable) -> list[ColumnElement[Any]]:
    """Return the wanted order, then the table's own, so that no row is on two pages."""
    found = next((one for one in columns if one.name == wanted.sort.removeprefix("-")), None)
    if found is None:
        return list(table.order)
    value = cast(found.value, String) if isinstance(found.value.type, JSON) else found.value
    first = value.desc() if wanted.sort.startswith("-") else value.asc()
    return [first.nulls_last(), *table.order]
