"""Reports that were made in the dashboard: of each study the newest one, and how the newest attempt goes or went.

A report has what participants did, so it is deleted as soon as one of them withdraws.
"""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Final

from sqlalchemy import Connection, delete, select, update

from server.store.tables import studies, study_reports

SEEN_EVERY: Final = timedelta(seconds=5)  # how often the process that makes a report says that it runs
_GONE_AFTER: Final = 6 * SEEN_EVERY
WITHDRAWN: Final = "A participant withdrew while the report was made. Make it again."
_STOPPED: Final = "The server stopped while the report was made. Make it again."
_here = study_reports.c
_COLUMNS = tuple(column for column in _here if column is not _here.archive)


@dataclass(frozen=True)
class StoredReport:
    """One attempt to make a report, without its files."""

    id: int
    study: str
    started_by: str
    started_at: datetime
    stage: str
    seen_at: datetime
    failure: str | None
    made_at: datetime | None
    participants: int | None
    simulated: bool | None

    @property
    def is_running(self) -> bool:
        since = abs(datetime.now(UTC) - self.seen_at)  # also if the machine's clock was set back
        return self.made_at is None and self.failure is None and since < _GONE_AFTER

    @property
    def reason(self) -> str:
        """Why the attempt failed; empty while it runs, and if it did not fail."""
        if self.is_running or self.made_at is not None:
            return ""
        return self.failure or _STOPPED


def begin(connection: Connection, study: str, by: str, stage: str) -> int | None:
    """Begin an attempt; return its number, or None while another report of any study is being made."""
    unfinished = select(*_COLUMNS).where(_here.made_at.is_(None), _here.failure.is_(None))
    if any(StoredReport(**row._mapping).is_running for row in connection.execute(unfinished)):
        return None
    connection.execute(delete(study_reports).where(_here.study == study, _here.made_at.is_(None)))
    now = datetime.now(UTC)
    row = {"study": study, "started_by": by, "started_at": now, "stage": stage, "seen_at": now}
    return int(connection.execute(study_reports.insert().values(row).returning(_here.id)).scalar_one())


def progress(connection: Connection, number: int, stage: str) -> None:
    """Say that the process still runs, and what it does."""
    values = {"stage": stage, "seen_at": datetime.now(UTC)}
    connection.execute(update(study_reports).where(_here.id == number).values(values))


def finish(connection: Connection, number: int, archive: bytes, participants: int, simulated: bool) -> bool:
    """Keep the report in the place of the one before. False: somebody withdrew since it was begun, so it is dropped."""
    made = {"made_at": datetime.now(UTC), "archive": archive, "participants": participants, "simulated": simulated}
    query = update(study_reports).where(_here.id == number).values(made).returning(_here.study)
    study = connection.execute(query).scalar_one_or_none()
    if study is None:
        return False
    connection.execute(delete(study_reports).where(_here.study == study, _here.id < number))
    return True


def fail(connection: Connection, number: int, study: str, by: str, reason: str) -> None:
    """Keep why the attempt failed, also if a withdrawal has deleted it."""
    query = update(study_reports).where(_here.id == number)
    if not connection.execute(query.values(failure=reason)).rowcount:
        now = datetime.now(UTC)
        row = {"study": study, "started_by": by, "started_at": now, "stage": "", "seen_at": now, "failure": reason}
        connection.execute(study_reports.insert().values(row))


def newest(connection: Connection, study: str) -> tuple[StoredReport | None, StoredReport | None]:
    """Return the newest attempt of a study, and the report that is kept."""
    query = select(*_COLUMNS).where(_here.study == study).order_by(_here.id.desc())
    found = [StoredReport(**row._mapping) for row in connection.execute(query)]
    return next(iter(found), None), next((one for one in found if one.made_at is not None), None)


def archive_of(connection: Connection, study: str) -> bytes | None:
    """Return the files of the report that is kept, as a zip archive."""
    query = select(_here.archive).where(_here.study == study, _here.made_at.is_not(None))
    return connection.execute(query.order_by(_here.id.desc()).limit(1)).scalar_one_or_none()


def forget(connection: Connection, study_id: int) -> None:
    """Delete the reports of the study that this version belongs to, also one that is being made."""
    name = select(studies.c.key).where(studies.c.id == study_id).scalar_subquery()
    connection.execute(delete(study_reports).where(_here.study == name))
