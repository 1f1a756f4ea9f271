"""The tables of studies and of the people in them: who takes part, who left, and what is personal."""

from sqlalchemy import BigInteger, Boolean, ForeignKey, Index, Integer, String, Table, Text, UniqueConstraint

from server.store.columns import column, number, time
from server.store.table_base import ID, KEY, PARTICIPANT, PARTICIPANT_STATUSES, RECRUITMENT_ID, SHA256, metadata

studies = Table(
    "studies",
    metadata,
    number("Number of the study version in this database."),
    column("key", KEY, meaning="The study's name in its file and its address."),
    column("version", Integer, meaning="Counts the versions of one key, from 1."),
    column("sha256", SHA256, meaning="Hash of the study file."),
    column("source", Text, meaning="The study file, word for word."),
    column(
        "started", Integer, server_default="0", meaning="Participants who ever consented, including those who withdrew."
    ),
    column(
        "simulated_started", Integer, server_default="0", meaning="How many of them are bots (since revision 0016)."
    ),
    time("created_at", "When the server first saw this version."),
    time("frozen_at", "First consent; the version never changes after it.", nullable=True),
    UniqueConstraint("key", "version"),
    UniqueConstraint("key", "sha256"),
)

participants = Table(
    "participants",
    metadata,
    column("id", ID, primary_key=True, meaning="Random public id, which reveals nothing about the person."),
    column("study_id", Integer, ForeignKey("studies.id"), meaning="Study version that the participant is in."),
    column(
        "number",
        Integer,
        meaning="From 1, in order of consent through all versions of the study; until release 0.2.0 within a version.",
    ),
    column(
        "allocation_number",
        Integer,
        server_default="0",
        meaning="In order of consent within the version, among people only or among bots only: condition, seed and "
        "order of episodes follow from it.",
    ),
    column("condition", KEY, meaning="Arm of the study; it never changes."),
    column("seed", BigInteger, meaning="63-bit seed of all random choices for this participant."),
    column("position", Integer, server_default="0", meaning="Index of the current step in the participant's plan."),
    column("status", String(16), server_default="active", meaning="One of: " + ", ".join(PARTICIPANT_STATUSES) + "."),
    column("language", String(16), server_default="en", meaning="Language of the pages (BCP 47)."),
    column("simulated", Boolean, meaning="True: a bot, not a person. Never pool bots with people."),
    time("started_at", "Consent."),
    time("last_seen_at", "Last request or message."),
    time("completed_at", "The last step was submitted.", nullable=True),
    column(
        "completion_code", String(64), nullable=True, meaning="Code shown at the end; stored so that it never changes."
    ),
    column("token_hash", SHA256, unique=True, meaning="SHA-256 of the token in the participant's cookie."),
    UniqueConstraint("study_id", "number"),
    Index(None, "study_id", "condition", "status"),
)

personal = Table(
    "personal",
    metadata,
    column("participant_id", ID, ForeignKey(PARTICIPANT), primary_key=True, meaning="Whose."),
    column("key", KEY, primary_key=True, meaning="What it is: recruitment_id, PROLIFIC_PID, contact, ..."),
    column("study_id", Integer, ForeignKey("studies.id"), meaning="The participant's study version."),
    column("value", Text, meaning="Personal data. Never exported; deleted when the participant withdraws."),
)
Index(
    "one_row_per_person_and_study",
    personal.c.study_id,
    personal.c.value,
    unique=True,
    sqlite_where=personal.c.key == RECRUITMENT_ID,
    postgresql_where=personal.c.key == RECRUITMENT_ID,
)

arrivals = Table(
    "arrivals",
    metadata,
    column("study_id", Integer, ForeignKey("studies.id"), primary_key=True, meaning="Study version."),
    column("kind", String(16), primary_key=True, meaning="opened, declined, unsuitable or suitable (at a later try)."),
    column(
        "reason",
        String(16),
        primary_key=True,
        meaning="What was unsuitable: browser, screen, input, latency or websocket.",
    ),
    column("count", Integer, meaning="Number of browsers. Nothing else is stored about people who do not consent."),
)

withdrawals = Table(
    "withdrawals",
    metadata,
    number("Number of the withdrawal."),
    column("study_id", Integer, ForeignKey("studies.id"), index=True, meaning="Study version."),
    column("condition", KEY, meaning="Arm of the participant."),
    column("position", Integer, meaning="Index of the step at which the participant left."),
    column("simulated", Boolean, nullable=True, meaning="True: a bot. Empty in rows of an earlier version: not known."),
    time("withdrawn_at", "When. All other data of the participant are deleted."),
)

tombstones = Table(
    "tombstones",
    metadata,
    column("hash", SHA256, primary_key=True, meaning="HMAC-SHA-256 of a deleted person's id, keyed with the salt."),
    column(
        "salt", String(32), meaning="Random. The hash can be matched to a person only with an older copy of the data."
    ),
    time("deleted_at", "When. An import leaves the participant out of older exports."),
)
