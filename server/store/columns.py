"""Constructors for the columns of tables.py, with meaning and unit next to the type; times are always aware and in
UTC.
"""

from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Column, DateTime, Dialect, Integer, TypeDecorator


class UtcDateTime(TypeDecorator[datetime]):
    """An aware datetime in UTC on every database; a naive one is refused."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        if value is None:
            return None
        if value.tzinfo is None:
            raise ValueError(f"{value!r} has no time zone. Use datetime.now(UTC).")
        value = value.astimezone(UTC)
        return value.replace(tzinfo=None) if dialect.name == "sqlite" else value

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:  # noqa: ARG002
        if value is None:
            return None
        return value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)


def column(name: str, type_: Any, *rest: Any, meaning: str, unit: str = "", **options: Any) -> Column[Any]:
    """Return a column that is never empty unless `nullable=True` says so."""
    options.setdefault("nullable", False)
    return Column(name, type_, *rest, doc=meaning, info={"unit": unit}, **options)


def number(meaning: str) -> Column[Any]:
    """Return an `id` that the database counts up."""
    return column("id", Integer, primary_key=True, autoincrement=True, meaning=meaning)


def time(name: str, meaning: str, **options: Any) -> Column[Any]:
    """Return an instant."""
    return column(name, UtcDateTime(), meaning=meaning, unit="UTC", **options)
