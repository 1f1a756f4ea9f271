"""The rows of the dashboard's data view as text: for its page, and as CSV escaped for spreadsheets."""

import csv
import io
from collections.abc import Iterable, Sequence
from datetime import datetime
from typing import Any

from server.export.rows import value_text
from server.export.spreadsheet_text import escaped_text
from server.store.data_view import DataPage, ViewColumn
from server.store.participants import label
from server.study.definition import Study

ANSWER = "value"


def asked_of_some(studies: Iterable[Study]) -> tuple[str, ...]:
    """Return the keys of questions that not every condition asks: in blind mode, an answer to one would reveal the
    condition."""
    keys: set[str] = set()
    for study in studies:
        questionnaires = [*study.questionnaires.values(), *([study.quiz] if study.quiz else [])]
        keys |= {question.key for one in questionnaires for question in one.asks if question.conditions != "all"}
    return tuple(sorted(keys))


def shown_rows(page: DataPage) -> list[list[str]]:
    """Return each row as the page shows it: people by their label, times to the second (UTC)."""
    names = [column.name for column in page.columns]
    rows = []
    for row in page.rows:
        values = dict(zip(names, row, strict=True))
        values["participant"] = label(values["participant"], values["simulated"])
        rows.append([_shown(name, values[name]) for name in names])
    return rows


def _shown(name: str, value: Any) -> str:
    if name == ANSWER:
        return value_text(value)[0] or ""
    if isinstance(value, datetime):
        return f"{value:%Y-%m-%d %H:%M:%S}"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    return "" if value is None else str(value)


def csv_head(columns: Sequence[ViewColumn]) -> str:
    """Return the first line, after the byte order mark by which spreadsheets recognise UTF-8."""
    return "\ufeff" + _csv([[column.name for column in columns]])


def csv_rows(page: DataPage) -> str:
    """Return the rows as lines of CSV; texts that a spreadsheet would run get an apostrophe in front."""
    return _csv([[escaped_text(text) for text in row] for row in shown_rows(page)])


def _csv(rows: list[list[str]]) -> str:
    lines = io.StringIO()
    csv.writer(lines).writerows(rows)
    return lines.getvalue()
