"""The tables, in SQLAlchemy Core. docs/reference/data_dictionary.md is printed from every column's meaning and unit.

Here is the table of episodes. tick_tables.py, people_tables.py, answer_tables.py, researcher_tables.py and
authoring_tables.py have the others, which are imported from here too.
What fills them: participants.py, episodes.py, answers.py, events.py, audit.py.
"""

from sqlalchemy import (
    JSON,
    BigInteger,
    Boolean,
    Double,
    ForeignKey,
    Index,
    Integer,
    SmallInteger,
    String,
    Table,
    Text,
    UniqueConstraint,
)

from server.store.answer_tables import answers, events, visits
from server.store.authoring_tables import kitchens, study_draft_versions, study_drafts, study_openings, study_reports
from server.store.columns import column, time
from server.store.people_tables import arrivals, participants, personal, studies, tombstones, withdrawals
from server.store.researcher_tables import (
    admin_sessions,
    admins,
    attempts,
    audit,
    audit_head,
    exclusions,
    heartbeat,
    study_pauses,
)
from server.store.table_base import (
    EPISODE_STATUSES,
    ID,
    KEY,
    PARTICIPANT,
    PARTICIPANT_STATUSES,
    RECRUITMENT_ID,
    ROLES,
    SHA256,
    metadata,
)
from server.store.tick_tables import inputs, pauses, ticks

__all__ = [
    "EPISODE_STATUSES",
    "PARTICIPANT_STATUSES",
    "RECRUITMENT_ID",
    "ROLES",
    "TABLES",
    "admin_sessions",
    "admins",
    "answers",
    "arrivals",
    "attempts",
    "audit",
    "audit_head",
    "episodes",
    "events",
    "exclusions",
    "heartbeat",
    "inputs",
    "kitchens",
    "metadata",
    "participants",
    "pauses",
    "personal",
    "studies",
    "study_draft_versions",
    "study_drafts",
    "study_openings",
    "study_pauses",
    "study_reports",
    "ticks",
    "tombstones",
    "visits",
    "withdrawals",
]

episodes = Table(
    "episodes",
    metadata,
    column("id", ID, primary_key=True, meaning="Random public id."),
    column(
        "study_id",
        Integer,
        ForeignKey("studies.id"),
        nullable=True,
        meaning="Study version; none: played outside a study.",
    ),
    column("step_key", KEY, meaning="Key of the participant's step."),
    column(
        "attempt", Integer, server_default="1", meaning="1 for the first attempt at the step, 2 for the second, ..."
    ),
    column("kind", String(16), meaning="tutorial, episode or watch."),
    column("number", Integer, meaning="1-based among the plan's episodes; 0 for the tutorial."),
    column("participant_0", ID, ForeignKey(PARTICIPANT), nullable=True, index=True, meaning="Participant on seat 0."),
    column("participant_1", ID, ForeignKey(PARTICIPANT), nullable=True, index=True, meaning="Participant on seat 1."),
    column("condition", KEY, nullable=True, meaning="Arm of the study."),
    column("layout", KEY, meaning="Name of the layout."),
    column("layout_sha256", SHA256, meaning="Hash of the grid."),
    column("grid", Text, meaning="The layout as drawn, so that the episode can be re-simulated from its own record."),
    column("agent_0", KEY, nullable=True, meaning="Agent on seat 0; none: a human."),
    column("agent_1", KEY, nullable=True, meaning="Agent on seat 1; none: a human."),
    column(
        "agent_name",
        KEY,
        nullable=True,
        meaning="Name of the partner in the study, e.g. mine for agents/mine.onnx, or of a human; none: older episode.",
    ),
    column("agent_0_sha256", SHA256, nullable=True, meaning="Hash of the agent's weights."),
    column("agent_1_sha256", SHA256, nullable=True, meaning="Hash of the agent's weights."),
    column("predictor", KEY, nullable=True, meaning="Predictor that ran at every timestep, shown or not."),
    column("predictor_sha256", SHA256, nullable=True, meaning="Hash of the predictor's weights."),
    column("watched_seat", SmallInteger, meaning="Seat whose next actions are predicted."),
    column(
        "shown",
        String(16),
        meaning="Source of the marks: nothing, predictor or random. If `spec` says `misleading`, they were wrong on "
        "purpose.",
    ),
    column("seed", BigInteger, meaning="63-bit seed of all randomness in the episode."),
    column("horizon", Integer, meaning="Timesteps to play; 0: endless.", unit="timesteps"),
    column("tick_ms", Integer, meaning="Length of a timestep.", unit="ms"),
    column("spec", JSON, meaning="The complete specification (server/play/episode_spec.py)."),
    column("status", String(16), server_default="new", meaning="One of: " + ", ".join(EPISODE_STATUSES) + "."),
    column("end_reason", String(64), nullable=True, meaning="Why it ended."),
    column("score", Integer, nullable=True, meaning="Sum of sparse rewards.", unit="points"),
    column("soups", Integer, nullable=True, meaning="Soups delivered."),
    column(
        "progress", Double, nullable=True, meaning="Credit for unfinished soups, apart from the score.", unit="points"
    ),
    column("passed", Boolean, nullable=True, meaning="Tutorial: passed. Episode: played to its end."),
    column("final_hash", String(16), nullable=True, meaning="Hash of the last state, 16 hexadecimal digits."),
    column("code_version", String(64), meaning="Version of this software."),
    column(
        "fence",
        Integer,
        server_default="0",
        meaning="How often a process took the game over; only the newest process may store.",
    ),
    column(
        "paused_by",
        KEY,
        nullable=True,
        meaning="The researcher who paused this game alone; none: nobody did, or it was resumed.",
    ),
    time("created_at", "When it was created."),
    time("started_at", "When its first state was stored.", nullable=True),
    time("ended_at", "When its end was stored.", nullable=True),
    UniqueConstraint("participant_0", "step_key", "attempt"),
    UniqueConstraint("participant_1", "step_key", "attempt"),
    Index(None, "study_id", "status"),
)

# In the order of the data dictionary.
TABLES = (
    studies,
    participants,
    personal,
    arrivals,
    withdrawals,
    tombstones,
    episodes,
    ticks,
    inputs,
    pauses,
    answers,
    visits,
    events,
    audit,
    audit_head,
    heartbeat,
    admins,
    admin_sessions,
    attempts,
    exclusions,
    study_pauses,
    kitchens,
    study_drafts,
    study_draft_versions,
    study_openings,
    study_reports,
)
