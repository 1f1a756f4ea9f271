"""The audit log: who did what. Entries are only ever added; each carries the hash of the one before.

A changed or missing entry shows, also one that is missing at the end: `audit_head` keeps where the log ends. A detail
that names a participant who withdrew is blanked; the chain holds, as it goes over the salted hash of the detail.
"""

import hashlib
import json
import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection, or_, select, update

from server.store.tables import audit, audit_head

_WORDS = 100  # in one statement: each search reads the whole log


@dataclass(frozen=True)
class Entry:
    """One entry; `detail` is None where it was blanked."""

    id: int
    at: datetime
    actor: str
    action: str
    detail: dict[str, Any] | None


def add(connection: Connection, actor: str, action: str, detail: Mapping[str, Any] | None = None) -> int:
    """Add an entry and return its number. `detail` is JSON without secrets."""
    number, previous = _end(connection)
    entry_id = number + 1
    at = datetime.now(UTC)
    text, salt = json.dumps(dict(detail or {}), sort_keys=True), secrets.token_hex(16)
    detail_hash = _sha256(salt, text)
    row = {"id": entry_id, "at": at, "actor": actor, "action": action, "detail": text, "salt": salt}
    row |= {"detail_hash": detail_hash, "hash": _sha256(previous, entry_id, at.isoformat(), actor, action, detail_hash)}
    connection.execute(audit.insert().values(row))
    head = {"entries": entry_id, "hash": row["hash"]}
    if not connection.execute(update(audit_head).values(head)).rowcount:
        connection.execute(audit_head.insert().values(id=1, **head))
    return entry_id


def _end(connection: Connection) -> tuple[int, str]:
    """Return the number and hash of the last entry that was ever added; (0, "") if there is none.

    Takes the row's lock, as on PostgreSQL the command line adds entries while the server runs.
    """
    head = connection.execute(select(audit_head.c.entries, audit_head.c.hash).with_for_update()).first()
    last = connection.execute(select(audit.c.id, audit.c.hash).order_by(audit.c.id.desc()).limit(1)).first()
    return max([(0, ""), *(tuple(row) for row in (head, last) if row is not None)])


def entries(connection: Connection) -> list[Entry]:
    """Return the whole log, oldest first."""
    return [
        Entry(row.id, row.at, row.actor, row.action, None if row.detail is None else json.loads(row.detail))
        for row in connection.execute(select(audit).order_by(audit.c.id))
    ]


def first_forged(connection: Connection) -> int | None:
    """Return the number of the first entry that was changed or is missing; None: the log is whole."""
    previous, expected = "", 0
    for expected, row in enumerate(connection.execute(select(audit).order_by(audit.c.id)), start=1):
        wanted = _sha256(previous, row.id, row.at.isoformat(), row.actor, row.action, row.detail_hash)
        is_detail_intact = row.detail is None or _sha256(row.salt, row.detail) == row.detail_hash
        if row.id != expected or row.hash != wanted or not is_detail_intact:
            return expected
        previous = row.hash
    head = connection.execute(select(audit_head.c.entries, audit_head.c.hash)).first()
    return None if (head or (0, "")) == (expected, previous) else expected + 1


def forget(connection: Connection, *words: str) -> int:
    """Blank every detail in which one of the words (ids of participants or episodes) occurs; return how many."""
    blanked = 0
    for start in range(0, len(words), _WORDS):
        named = (audit.c.detail.contains(word, autoescape=True) for word in words[start : start + _WORDS])
        blank = update(audit).where(or_(*named)).values(detail=None, salt=None)
        blanked += connection.execute(blank).rowcount
    return blanked


def _sha256(*parts: object) -> str:
    return hashlib.sha256(json.dumps([str(part) for part in parts]).encode()).hexdigest()
