"""The studies that were opened from drafts, which the server serves in addition to its files, also after a restart."""

from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy import Connection, func, select, update

from server.store.tables import participants, studies, study_openings


@dataclass(frozen=True)
class StudyOpening:
    """The newest opening of a study: which version new participants get, or got until it was closed."""

    study: str
    study_id: int
    draft_id: int
    draft_revision: int
    sha256: str
    opened_by: str
    opened_at: datetime
    closed_by: str | None
    closed_at: datetime | None

    @property
    def is_open(self) -> bool:
        return self.closed_at is None


def open_study(connection: Connection, version: tuple[str, int], draft: tuple[int, int], by: str) -> datetime:
    """Let new participants into a version (the study's name, the number of the version) from now on; return when.
    `draft`: its number and revision."""
    (name, study_id), (draft_id, revision) = version, draft
    now = datetime.now(UTC)
    close_study(connection, name, by)
    row = {"study": name, "study_id": study_id, "draft_id": draft_id, "draft_revision": revision}
    connection.execute(study_openings.insert().values(row | {"opened_by": by, "opened_at": now}))
    return now


def close_study(connection: Connection, name: str, by: str) -> bool:
    """Let nobody new into a study. False: it was not open."""
    query = update(study_openings).where(study_openings.c.study == name, study_openings.c.closed_at.is_(None))
    return connection.execute(query.values(closed_by=by, closed_at=datetime.now(UTC))).rowcount > 0


def newest(connection: Connection) -> dict[str, StudyOpening]:
    """Return the newest opening of every study that was ever opened from a draft, by the study's name."""
    here, version = study_openings.c, studies.c
    last = select(func.max(here.id)).group_by(here.study)
    of_opening = (here.study, here.study_id, here.draft_id, here.draft_revision, version.sha256)
    columns = (*of_opening, here.opened_by, here.opened_at, here.closed_by, here.closed_at)
    query = select(*columns).join_from(study_openings, studies, here.study_id == version.id)
    rows = connection.execute(query.where(here.id.in_(last)).order_by(here.id))
    return {row.study: StudyOpening(*row) for row in rows}


def needed(connection: Connection) -> list[StudyOpening]:
    """Return the openings that a server needs: those that are open, and closed ones with people who are still in some
    version of the study."""
    query = select(studies.c.key).join_from(participants, studies).where(participants.c.status == "active")
    busy = set(connection.execute(query.distinct()).scalars())
    return [one for one in newest(connection).values() if one.is_open or one.study in busy]


class StudyClosed(Exception):
    """A researcher closed the study, or it is no longer served: new participants can no longer join."""


def check_open(connection: Connection, name: str) -> None:
    """Raise StudyClosed for a study that was opened from a draft and closed again."""
    if name in closed(connection):
        raise StudyClosed(name)


def closed(connection: Connection) -> set[str]:
    """Return the names of the studies that were opened from a draft and no longer take new participants."""
    here = study_openings.c
    last = select(func.max(here.id)).group_by(here.study)
    query = select(here.study).where(here.id.in_(last), here.closed_at.is_not(None))
    return set(connection.execute(query).scalars())


def is_taken(connection: Connection, name: str, draft: int) -> bool:
    """Return whether another draft is open under this name."""
    opened = newest(connection).get(name)
    return opened is not None and opened.is_open and opened.draft_id != draft
