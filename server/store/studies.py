"""Study files as they were when people took part: every version, unchanged."""

import hashlib
from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy import Connection, Row, func, select

from server.store.tables import studies


@dataclass(frozen=True)
class StudyVersion:
    """One version of one study file."""

    id: int
    key: str
    version: int
    sha256: str
    source: str
    started: int
    simulated_started: int
    created_at: datetime
    frozen_at: datetime | None

    def enrolled(self, simulated: bool) -> int:
        """Return how many bots consented, or how many people; those who withdrew included."""
        return self.simulated_started if simulated else self.started - self.simulated_started


def register(connection: Connection, key: str, source: str) -> StudyVersion:
    """Return the version with this text, creating it if there is none: only a changed file is a new version."""
    sha256 = hashlib.sha256(source.encode()).hexdigest()
    known = connection.execute(select(studies).where(studies.c.key == key, studies.c.sha256 == sha256)).first()
    if known is None:
        last = connection.execute(select(func.max(studies.c.version)).where(studies.c.key == key)).scalar() or 0
        row = {"key": key, "version": last + 1, "sha256": sha256, "source": source, "created_at": datetime.now(UTC)}
        known = connection.execute(studies.insert().values(row).returning(*studies.c)).one()
    return _study(known)


def get(connection: Connection, study_id: int) -> StudyVersion | None:
    """Return the version with this number."""
    row = connection.execute(select(studies).where(studies.c.id == study_id)).first()
    return _study(row) if row else None


def every(connection: Connection, key: str | None = None) -> list[StudyVersion]:
    """Return all versions (of one key), oldest first."""
    query = select(studies).order_by(studies.c.id)
    if key is not None:
        query = query.where(studies.c.key == key)
    return [_study(row) for row in connection.execute(query)]


def ids_of(connection: Connection, key: str) -> list[int]:
    """Return the numbers of all versions of a study, oldest first."""
    query = select(studies.c.id).where(studies.c.key == key).order_by(studies.c.id)
    return list(connection.execute(query).scalars())


def known_ids(connection: Connection, key: str) -> list[int]:
    """Return `ids_of` for a name that somebody typed. Raises ValueError, which lists the studies that exist."""
    found = ids_of(connection, key)
    if not found:
        known = sorted({version.key for version in every(connection)})
        raise ValueError(f"there is no study {key!r} here. There is: {', '.join(known) or 'none'}")
    return found


def started(connection: Connection, key: str) -> int:
    """Return how many participants ever consented to any version of a study."""
    return connection.execute(select(func.sum(studies.c.started)).where(studies.c.key == key)).scalar() or 0


def _study(row: "Row[tuple[object, ...]]") -> StudyVersion:
    return StudyVersion(**row._mapping)
