"""The tables of researchers and of the server itself: accounts, decisions, the audit log, the heartbeat."""

from sqlalchemy import Boolean, CheckConstraint, ForeignKey, Index, Integer, String, Table, Text

from server.store.columns import column, number, time
from server.store.table_base import EPISODE, ID, KEY, PARTICIPANT, ROLES, SHA256, metadata

audit = Table(
    "audit",
    metadata,
    column("id", Integer, primary_key=True, autoincrement=False, meaning="1 to n without a gap."),
    time("at", "When."),
    column("actor", KEY, meaning="Who did it: an account's name, or server."),
    column("action", KEY, meaning="What was done."),
    column(
        "detail",
        Text,
        nullable=True,
        meaning="Object and reason, as JSON; blanked if it named a participant who withdrew.",
    ),
    column(
        "salt", String(32), nullable=True, meaning="Random, so that a blanked detail cannot be guessed from its hash."
    ),
    column("detail_hash", SHA256, meaning="SHA-256 of salt and detail."),
    column(
        "hash",
        SHA256,
        meaning="SHA-256 of the entry and of the previous hash, which reveals changed and missing entries.",
    ),
    CheckConstraint("id > 0", name="counts_from_one"),
)

audit_head = Table(
    "audit_head",
    metadata,
    column("id", Integer, primary_key=True, autoincrement=False, meaning="Always 1."),
    column(
        "entries", Integer, meaning="Number of the last entry of the audit log, which reveals removed last entries."
    ),
    column("hash", SHA256, meaning="Its hash."),
)

heartbeat = Table(
    "heartbeat",
    metadata,
    column("id", Integer, primary_key=True, autoincrement=False, meaning="Always 1."),
    time("at", "When the server last proved that the database can commit."),
)

admins = Table(
    "admins",
    metadata,
    column("name", KEY, primary_key=True, meaning="A researcher's account; the audit log's actor."),
    column("password_hash", Text, meaning="Argon2id."),
    column("role", String(16), meaning="One of: " + ", ".join(ROLES) + "."),
    time("created_at", "When it was created."),
)

admin_sessions = Table(
    "admin_sessions",
    metadata,
    column("token_hash", SHA256, primary_key=True, meaning="SHA-256 of the token in the researcher's cookie."),
    column("admin", KEY, ForeignKey("admins.name"), index=True, meaning="Whose."),
    column("blind", Boolean, meaning="True: conditions are not sent to this browser."),
    time("created_at", "Sign-in."),
    time("seen_at", "Last request, to the minute."),
)

attempts = Table(
    "attempts",
    metadata,
    number("Number of the attempt."),
    column(
        "kind",
        String(32),
        meaning="Kind: password, password from a known browser, completion code, new participant, turned away.",
    ),
    column(
        "name",
        KEY,
        meaning="The researcher's account (a hash where there is none); empty for a completion code; of a participant "
        "a keyed hash of the network; of those turned away the study.",
    ),
    column(
        "origin",
        SHA256,
        meaning="Origin of a guess: a keyed hash of the address, or of the known browser; empty for participants.",
    ),
    time("at", "When. Deleted with the next of its kind, guesses after 15 minutes and participants after an hour."),
    Index(None, "kind", "name", "at"),
)

exclusions = Table(
    "exclusions",
    metadata,
    number("Number of the decision."),
    column("participant_id", ID, ForeignKey(PARTICIPANT), index=True, meaning="Whose data."),
    column(
        "episode_id", ID, ForeignKey(EPISODE), nullable=True, index=True, meaning="This episode only; none: all data."
    ),
    column("reason", KEY, meaning="Why the data are excluded from the analysis."),
    column("note", Text, meaning="A note of the researcher."),
    column("excluded_by", KEY, meaning="The researcher who decided."),
    time("excluded_at", "When."),
    column("restored_by", KEY, nullable=True, meaning="Who undid it; none: it is in force."),
    time("restored_at", "When it was undone.", nullable=True),
)

study_pauses = Table(
    "study_pauses",
    metadata,
    number("Number of the pause."),
    column("study", KEY, index=True, meaning="The study's name; all its versions are paused."),
    column("paused_by", KEY, meaning="The researcher who paused it."),
    time("paused_at", "When it was paused: nobody can join and no game runs."),
    column("resumed_by", KEY, nullable=True, meaning="Who resumed it; none: it is still paused."),
    time("resumed_at", "When it was resumed.", nullable=True),
)
