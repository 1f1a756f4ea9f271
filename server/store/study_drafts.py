"""Drafts of studies: the newest text, its history, and conflicts between two people who edit the same draft."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Final

from sqlalchemy import Connection, select, update

from server.store import audit
from server.store.tables import study_draft_versions, study_drafts

ONE_SITTING: Final = timedelta(minutes=5)  # what one author saves within it is one line of the history
EDITED: Final = "edited"
MERGED: Final = "merged"
SET_ASIDE: Final = "set aside"


@dataclass(frozen=True)
class StudyDraft:
    """A draft as it is now."""

    id: int
    name: str
    revision: int
    source: str
    created_by: str
    created_at: datetime
    changed_by: str
    changed_at: datetime
    deleted_at: datetime | None


@dataclass(frozen=True)
class DraftVersion:
    """A text that a draft had, or that somebody wrote while another one saved (`set aside`)."""

    id: int
    draft_id: int
    revision: int
    source: str
    author: str
    note: str
    began_at: datetime
    saved_at: datetime


@dataclass(frozen=True)
class DraftText:
    """A text to be saved: by whom, on top of which revision (0: a new draft), and how it came about. `base`: the text
    of that revision, if the author's page still has it; then the caller merges in a conflict, and sets aside what
    cannot be merged."""

    author: str
    source: str
    name: str
    based_on: int = 0
    note: str = EDITED
    base: str | None = None


class DraftConflict(Exception):
    """Somebody else has saved the draft since. The text of this author is kept in the history (`set aside`), unless it
    came with its base."""

    def __init__(self, newest: StudyDraft) -> None:
        self.newest = newest
        super().__init__(f"{newest.changed_by} has changed the draft: it is at revision {newest.revision} now")


def create(connection: Connection, text: DraftText) -> int:
    """Begin a draft; return its number."""
    now = datetime.now(UTC)
    row = {"name": text.name, "revision": 1, "source": text.source, "created_by": text.author, "created_at": now}
    row |= {"changed_by": text.author, "changed_at": now}
    made = connection.execute(study_drafts.insert().values(row).returning(study_drafts.c.id)).scalar_one()
    _keep(connection, made, 1, text)
    return int(made)


def get(connection: Connection, draft: int) -> StudyDraft | None:
    """Return the draft with this number, unless it was deleted."""
    query = select(study_drafts).where(study_drafts.c.id == draft, study_drafts.c.deleted_at.is_(None))
    row = connection.execute(query).first()
    return StudyDraft(**row._mapping) if row else None


def every(connection: Connection) -> list[StudyDraft]:
    """Return all drafts that were not deleted, the one that was changed last first."""
    query = select(study_drafts).where(study_drafts.c.deleted_at.is_(None))
    rows = connection.execute(query.order_by(study_drafts.c.changed_at.desc(), study_drafts.c.id.desc()))
    return [StudyDraft(**row._mapping) for row in rows]


def save(connection: Connection, draft: int, text: DraftText) -> StudyDraft | DraftConflict | None:
    """Save a text on top of the revision that it is based on; None: there is no such draft.

    A conflict is returned and not raised, as the text that cannot be saved is stored in the same transaction.
    """
    here = study_drafts.c
    values = {"source": text.source, "name": text.name, "revision": text.based_on + 1}
    values |= {"changed_by": text.author, "changed_at": datetime.now(UTC)}
    mine = (here.id == draft, here.revision == text.based_on, here.deleted_at.is_(None))
    if connection.execute(update(study_drafts).where(*mine).values(values)).rowcount:
        _keep(connection, draft, text.based_on + 1, text)
        return get(connection, draft)
    newest = get(connection, draft)
    if newest is None or newest.source == text.source:  # the same text twice: its answer was lost
        return newest
    if text.base is None:
        set_aside(connection, draft, text)
    return DraftConflict(newest)


def set_aside(connection: Connection, draft: int, text: DraftText) -> None:
    """Keep a text in the history without making it the draft's."""
    aside = DraftText(text.author, text.source, text.name, text.based_on, SET_ASIDE)
    _keep(connection, draft, text.based_on, aside)


def was_saved(connection: Connection, draft: int, source: str) -> bool:
    """Return whether the draft had this text, as far as the history knows."""
    here = study_draft_versions.c
    query = select(here.id).where(here.draft_id == draft, here.source == source, here.note != SET_ASIDE)
    return connection.execute(query.limit(1)).first() is not None


def delete(connection: Connection, draft: int) -> bool:
    """Delete a draft; its history stays in the database. False: there is none."""
    query = update(study_drafts).where(study_drafts.c.id == draft, study_drafts.c.deleted_at.is_(None))
    return connection.execute(query.values(deleted_at=datetime.now(UTC))).rowcount == 1


def history(connection: Connection, draft: int) -> list[DraftVersion]:
    """Return every text that is kept of a draft, newest first."""
    query = select(study_draft_versions).where(study_draft_versions.c.draft_id == draft)
    rows = connection.execute(query.order_by(study_draft_versions.c.saved_at.desc(), study_draft_versions.c.id.desc()))
    return [DraftVersion(**row._mapping) for row in rows]


def version(connection: Connection, draft: int, number: int) -> DraftVersion | None:
    """Return one text of the history, by its number."""
    here = study_draft_versions.c
    query = select(study_draft_versions).where(here.draft_id == draft, here.id == number)
    row = connection.execute(query).first()
    return DraftVersion(**row._mapping) if row else None


def _keep(connection: Connection, draft: int, revision: int, text: DraftText) -> None:
    """Add a text to the history: to the author's line of the same sitting if there is one, else as a new line, which
    the audit log has too."""
    now, here = datetime.now(UTC), study_draft_versions.c
    line = None if text.note == SET_ASIDE else _line_of_sitting(connection, draft, text, now - ONE_SITTING)
    if line is not None:
        values = {"revision": revision, "source": text.source, "saved_at": now}
        connection.execute(update(study_draft_versions).where(here.id == line).values(values))
        return
    if text.note == SET_ASIDE and _is_aside(connection, draft, text):
        return
    row = {"draft_id": draft, "revision": revision, "source": text.source, "author": text.author, "note": text.note}
    connection.execute(study_draft_versions.insert().values(row | {"began_at": now, "saved_at": now}))
    detail = {"draft": draft, "study": text.name, "revision": revision}
    audit.add(connection, text.author, f"study draft {text.note}", detail)


def _line_of_sitting(connection: Connection, draft: int, text: DraftText, since: datetime) -> int | None:
    """Return the line that a text continues: the author's own, also if others edit at the same time, unless somebody
    has restored an earlier text since."""
    here = study_draft_versions.c
    lines = connection.execute(
        select(here.id, here.author, here.note)
        .where(here.draft_id == draft, here.note != SET_ASIDE, here.began_at > since)
        .order_by(here.id.desc())
    )
    for line in lines:
        if line.note not in (EDITED, MERGED):
            return None
        if (line.author, line.note) == (text.author, text.note):
            return int(line.id)
    return None


def _is_aside(connection: Connection, draft: int, text: DraftText) -> bool:
    """Return whether the text that was set aside last is this one."""
    here = study_draft_versions.c
    query = select(here.author, here.source).where(here.draft_id == draft, here.note == SET_ASIDE)
    last = connection.execute(query.order_by(here.id.desc()).limit(1)).first()
    return last is not None and (last.author, last.source) == (text.author, text.source)
