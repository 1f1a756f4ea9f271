"""The tables of what researchers make in the dashboard: kitchens, drafts of studies and which are open, reports."""

from sqlalchemy import Boolean, ForeignKey, Integer, LargeBinary, Table, Text, UniqueConstraint

from server.store.columns import column, number, time
from server.store.table_base import KEY, metadata

kitchens = Table(
    "kitchens",
    metadata,
    number("Number of the saved kitchen."),
    column("name", KEY, meaning="The name by which studies use it."),
    column("version", Integer, meaning="Counts what was saved under this name, from 1."),
    column("grid", Text, nullable=True, meaning="The grid, one row a line; none: the kitchen was removed."),
    column("saved_by", KEY, meaning="The researcher who saved or removed it."),
    time("saved_at", "When."),
    UniqueConstraint("name", "version"),
)

study_drafts = Table(
    "study_drafts",
    metadata,
    number("Number of the draft."),
    column("name", KEY, meaning="The study's name, as it last stood in the text."),
    column(
        "revision", Integer, meaning="Counts the saved changes, from 1; a change is saved on top of the newest only."
    ),
    column("source", Text, meaning="The text of the study as it is now."),
    column("created_by", KEY, meaning="The researcher who began it."),
    time("created_at", "When it was begun."),
    column("changed_by", KEY, meaning="The researcher who saved the newest revision."),
    time("changed_at", "When that was saved."),
    time("deleted_at", "When it was deleted; its history stays.", nullable=True),
)

study_draft_versions = Table(
    "study_draft_versions",
    metadata,
    number("Number of the saved text."),
    column("draft_id", Integer, ForeignKey("study_drafts.id"), index=True, meaning="Of which draft."),
    column("revision", Integer, meaning="The draft's revision; of a text that was set aside, the one it was based on."),
    column("source", Text, meaning="The text."),
    column("author", KEY, meaning="The researcher who wrote it."),
    column("note", KEY, meaning="How it came about: created, edited, restored, merged or set aside (by a conflict)."),
    time("began_at", "When the author began with these changes; changes within a few minutes are one row."),
    time("saved_at", "When the text was last saved."),
)

study_openings = Table(
    "study_openings",
    metadata,
    number("Number of the opening."),
    column("study", KEY, index=True, meaning="The study's name."),
    column("study_id", Integer, ForeignKey("studies.id"), meaning="The study version that new participants got."),
    column("draft_id", Integer, ForeignKey("study_drafts.id"), meaning="The draft that was opened."),
    column("draft_revision", Integer, meaning="The draft's revision that was opened."),
    column("opened_by", KEY, meaning="The researcher who opened it."),
    time("opened_at", "When it was opened."),
    column("closed_by", KEY, nullable=True, meaning="Who closed it, or opened a newer version; none: it is open."),
    time("closed_at", "When it was closed.", nullable=True),
)

study_reports = Table(
    "study_reports",
    metadata,
    number("Number of the report."),
    column("study", KEY, index=True, meaning="The study's name."),
    column("started_by", KEY, meaning="The researcher who asked for it."),
    time("started_at", "When the data were read, or a moment before."),
    column("stage", KEY, meaning="What the process that makes it does, or did last."),
    time("seen_at", "When that process was last known to run."),
    column("failure", Text, nullable=True, meaning="Why it could not be made; none: it runs, or is made."),
    time("made_at", "When it was made.", nullable=True),
    column("participants", Integer, nullable=True, meaning="How many participants it analyses."),
    column("simulated", Boolean, nullable=True, meaning="Whether these are bots."),
    column("archive", LargeBinary, nullable=True, meaning="The files of the report, as a zip archive."),
)
