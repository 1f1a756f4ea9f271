"""Tombstones: salted hashes of the ids of deleted participants, so that importing an older export does not restore a
person. A participant's id is random, 64 bits long and made by this platform. A hash reveals nothing about the person,
unless one has an older copy of the data with the ids.
"""

import hashlib
import hmac
import json
import secrets
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from sqlalchemy import Connection, inspect, select

from server.store.tables import tombstones

FILE = "withdrawn.json"  # of an export


@dataclass(frozen=True)
class Tombstone:
    """A deleted participant. `hash`: HMAC-SHA-256 of the participant's id, keyed with the salt."""

    hash: str
    salt: str
    deleted_at: datetime

    def is_of(self, participant_id: str) -> bool:
        return hmac.compare_digest(self.hash, _hash(self.salt, participant_id))


def keep(connection: Connection, participant_id: str, at: datetime) -> None:
    """Remember that this participant was deleted."""
    salt = secrets.token_hex(16)
    row = {"hash": _hash(salt, participant_id), "salt": salt, "deleted_at": at}
    connection.execute(tombstones.insert().values(row))


def every(connection: Connection) -> list[Tombstone]:
    """Return all tombstones; none for a database of a version that kept none."""
    if not inspect(connection).has_table(tombstones.name):
        return []
    rows = connection.execute(select(tombstones).order_by(tombstones.c.deleted_at, tombstones.c.hash))
    return [Tombstone(row.hash, row.salt, row.deleted_at) for row in rows]


def add(connection: Connection, new: Iterable[Tombstone]) -> None:
    """Keep the tombstones of another database; duplicates are kept once."""
    there = {stone.hash for stone in every(connection)}
    rows = {stone.hash: vars(stone) for stone in new if stone.hash not in there}
    if rows:
        connection.execute(tombstones.insert(), list(rows.values()))


def deleted(participant_ids: Iterable[str], stones: Iterable[Tombstone]) -> dict[str, datetime]:
    """Return those of the participants who have a tombstone, and when they were deleted."""
    known = list(stones)
    found = {}
    for participant_id in participant_ids:
        stone = next((stone for stone in known if stone.is_of(participant_id)), None)
        if stone is not None:
            found[participant_id] = stone.deleted_at
    return found


def write(folder: Path, stones: Iterable[Tombstone]) -> None:
    """Put the tombstones into an export."""
    rows = [vars(stone) | {"deleted_at": stone.deleted_at.isoformat()} for stone in stones]
    (folder / FILE).write_text(json.dumps({"withdrawn": rows}, indent=2) + "\n", encoding="utf-8")


def read(folder: Path) -> list[Tombstone]:
    """Return the tombstones of an export; none if it was made by a version that kept none. Raises ValueError."""
    path = folder / FILE
    if not path.is_file():
        return []
    try:
        rows = json.loads(path.read_text(encoding="utf-8"))["withdrawn"]
        return [_stone(row) for row in rows]
    except (ValueError, KeyError, TypeError, RecursionError):
        raise ValueError(f"{path} is damaged: it does not list who withdrew. Export the study again.") from None


def _stone(row: dict[str, str]) -> Tombstone:
    at = datetime.fromisoformat(row["deleted_at"]).astimezone(UTC)
    for name, length in (("hash", 64), ("salt", 32)):
        if len(row[name]) != length or not set(row[name]) <= set("0123456789abcdef"):
            raise ValueError(name)
    return Tombstone(row["hash"], row["salt"], at)


def _hash(salt: str, participant_id: str) -> str:
    return hmac.new(salt.encode(), participant_id.encode(), hashlib.sha256).hexdigest()
