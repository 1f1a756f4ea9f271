"""The tables, in SQLAlchemy Core. docs/reference/data_dictionary.md is printed from every column's meaning and unit.

Nothing in here knows how the tables are filled: see participants.py, episodes.py, answers.py, events.py, audit.py.
"""

from sqlalchemy import (
    JSON,
    BigInteger,
    Boolean,
    CheckConstraint,
    Double,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    SmallInteger,
    String,
    Table,
    Text,
    UniqueConstraint,
)

from server.play.recorder import INPUT_OUTCOMES
from server.store.columns import column, number, time

metadata = MetaData(
    naming_convention={
        "ix": "ix_%(table_name)s_%(column_0_N_name)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "ck": "ck_%(table_name)s_%(constraint_name)s",
        "fk": "fk_%(table_name)s_%(column_0_N_name)s_%(referred_table_name)s",
        "pk": "pk_%(table_name)s",
    }
)

PARTICIPANT_STATUSES = ("active", "completed", "screened_out", "withdrawn", "timed_out", "returned")
EPISODE_STATUSES = ("new", "running", "done", "aborted")
ROLES = ("watch", "act", "own")  # of researchers, each with the rights of those before it
RECRUITMENT_ID = "recruitment_id"  # key in `personal` of the recruiter's id of a person: one row per person and study


_Id = String(32)
_Key = String(128)
_Sha256 = String(64)
_Participant = "participants.id"
_Episode = "episodes.id"

studies = Table(
    "studies",
    metadata,
    number("Number of the study version in this database."),
    column("key", _Key, meaning="The study's name in its file and its address."),
    column("version", Integer, meaning="Counts the versions of one key, from 1."),
    column("sha256", _Sha256, meaning="Hash of the study file."),
    column("source", Text, meaning="The study file, word for word."),
    column(
        "started", Integer, server_default="0", meaning="Participants who ever consented, including those who withdrew."
    ),
    time("created_at", "When the server first saw this version."),
    time("frozen_at", "First consent; the version never changes after it.", nullable=True),
    UniqueConstraint("key", "version"),
    UniqueConstraint("key", "sha256"),
)

participants = Table(
    "participants",
    metadata,
    column("id", _Id, primary_key=True, meaning="Random public id, which reveals nothing about the person."),
    column("study_id", Integer, ForeignKey("studies.id"), meaning="Study version that the participant is in."),
    column("number", Integer, meaning="1 to n, in order of consent within the study version."),
    column("condition", _Key, meaning="Arm of the study; it never changes."),
    column("seed", BigInteger, meaning="63-bit seed of all random choices for this participant."),
    column("position", Integer, server_default="0", meaning="Index of the current step in the participant's plan."),
    column("status", String(16), server_default="active", meaning="One of: " + ", ".join(PARTICIPANT_STATUSES) + "."),
    column("language", String(16), server_default="en", meaning="Language of the pages (BCP 47)."),
    column("simulated", Boolean, meaning="True: a bot, not a person."),
    time("started_at", "Consent."),
    time("last_seen_at", "Last request or message."),
    time("completed_at", "The last step was submitted.", nullable=True),
    column(
        "completion_code", String(64), nullable=True, meaning="Code shown at the end; stored so that it never changes."
    ),
    column("token_hash", _Sha256, unique=True, meaning="SHA-256 of the token in the participant's cookie."),
    UniqueConstraint("study_id", "number"),
    Index(None, "study_id", "condition", "status"),
)

personal = Table(
    "personal",
    metadata,
    column("participant_id", _Id, ForeignKey(_Participant), primary_key=True, meaning="Whose."),
    column("key", _Key, primary_key=True, meaning="What it is: recruitment_id, PROLIFIC_PID, contact, ..."),
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
    column("condition", _Key, meaning="Arm of the participant."),
    column("position", Integer, meaning="Index of the step at which the participant left."),
    time("withdrawn_at", "When. All other data of the participant are deleted."),
)

tombstones = Table(
    "tombstones",
    metadata,
    column("hash", _Sha256, primary_key=True, meaning="HMAC-SHA-256 of a deleted person's id, keyed with the salt."),
    column(
        "salt", String(32), meaning="Random. The hash can be matched to a person only with an older copy of the data."
    ),
    time("deleted_at", "When. An import leaves the participant out of older exports."),
)

episodes = Table(
    "episodes",
    metadata,
    column("id", _Id, primary_key=True, meaning="Random public id."),
    column(
        "study_id",
        Integer,
        ForeignKey("studies.id"),
        nullable=True,
        meaning="Study version; none: played outside a study.",
    ),
    column("step_key", _Key, meaning="Key of the participant's step."),
    column(
        "attempt", Integer, server_default="1", meaning="1 for the first attempt at the step, 2 for the second, ..."
    ),
    column("kind", String(16), meaning="tutorial, episode or watch."),
    column("number", Integer, meaning="1-based among the plan's episodes; 0 for the tutorial."),
    column("participant_0", _Id, ForeignKey(_Participant), nullable=True, index=True, meaning="Participant on seat 0."),
    column("participant_1", _Id, ForeignKey(_Participant), nullable=True, index=True, meaning="Participant on seat 1."),
    column("condition", _Key, nullable=True, meaning="Arm of the study."),
    column("layout", _Key, meaning="Name of the layout."),
    column("layout_sha256", _Sha256, meaning="Hash of the grid."),
    column("grid", Text, meaning="The layout as drawn, so that the episode can be re-simulated from its own record."),
    column("agent_0", _Key, nullable=True, meaning="Agent on seat 0; none: a human."),
    column("agent_1", _Key, nullable=True, meaning="Agent on seat 1; none: a human."),
    column(
        "agent_name",
        _Key,
        nullable=True,
        meaning="Name of the agent in the study, e.g. mine for agents/mine.onnx; none: no agent, or an older episode.",
    ),
    column("agent_0_sha256", _Sha256, nullable=True, meaning="Hash of the agent's weights."),
    column("agent_1_sha256", _Sha256, nullable=True, meaning="Hash of the agent's weights."),
    column("predictor", _Key, nullable=True, meaning="Predictor that ran at every timestep, shown or not."),
    column("predictor_sha256", _Sha256, nullable=True, meaning="Hash of the predictor's weights."),
    column("watched_seat", SmallInteger, meaning="Seat whose next actions are predicted."),
    column("shown", String(16), meaning="What the participant saw: nothing, predictor or random."),
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
    time("created_at", "When it was created."),
    time("started_at", "When its first state was stored.", nullable=True),
    time("ended_at", "When its end was stored.", nullable=True),
    UniqueConstraint("participant_0", "step_key", "attempt"),
    UniqueConstraint("participant_1", "step_key", "attempt"),
    Index(None, "study_id", "status"),
)

ticks = Table(
    "ticks",
    metadata,
    column("episode_id", _Id, ForeignKey(_Episode), primary_key=True, meaning="Which episode."),
    column(
        "timestep",
        Integer,
        primary_key=True,
        autoincrement=False,
        meaning="n: tick n produced state n.",
        unit="timesteps",
    ),
    column(
        "action_0",
        SmallInteger,
        nullable=True,
        meaning="Seat 0's action on state n-1: 0 N 1 S 2 E 3 W 4 stay 5 interact.",
    ),
    column("action_1", SmallInteger, nullable=True, meaning="Seat 1's action on state n-1."),
    column("state_hash", LargeBinary(8), meaning="BLAKE2b-64 of state n (overcooked/state.py)."),
    column("reward_0", SmallInteger, meaning="Sparse reward of seat 0 in the step to state n.", unit="points"),
    column("reward_1", SmallInteger, meaning="Sparse reward of seat 1.", unit="points"),
    column("shaped_0", SmallInteger, meaning="Shaped reward of seat 0.", unit="points"),
    column("shaped_1", SmallInteger, meaning="Shaped reward of seat 1.", unit="points"),
    column("events_0", Integer, meaning="Bits of seat 0's events (overcooked/constants.py)."),
    column("events_1", Integer, meaning="Bits of seat 1's events."),
    column(
        "next_action_0",
        SmallInteger,
        nullable=True,
        meaning="Agent's decision on state n; none: a human, or no answer in time.",
    ),
    column("next_action_1", SmallInteger, nullable=True, meaning="The same for seat 1."),
    column(
        "prediction",
        LargeBinary(72),
        nullable=True,
        meaning="3 x 6 probabilities for timesteps n, n+1, n+2: float32, little endian.",
    ),
    column(
        "displayed",
        LargeBinary(24),
        meaning="What the frame showed: two bytes per step, action (6: nothing) and opacity.",
        unit="%",
    ),
    column("late", Boolean, meaning="The models missed the deadline: the agent waits."),
    column("scheduled_ms", Double, meaning="Deadline, from the episode's first tick on, without pauses.", unit="ms"),
    column("late_ms", Double, meaning="Delay of the tick after its deadline.", unit="ms"),
    column("models_ms", Double, meaning="Time that the models needed.", unit="ms"),
    column(
        "key_seq_0", BigInteger, nullable=True, meaning="Number of the browser message that decided seat 0's action."
    ),
    column("key_client_ms_0", Double, nullable=True, meaning="performance.now() of the browser then.", unit="ms"),
    column(
        "key_received_ms_0", Double, nullable=True, meaning="Its arrival, since the first tick's deadline.", unit="ms"
    ),
    column("key_seq_1", BigInteger, nullable=True, meaning="The same for seat 1."),
    column("key_client_ms_1", Double, nullable=True, meaning="The same for seat 1.", unit="ms"),
    column("key_received_ms_1", Double, nullable=True, meaning="The same for seat 1.", unit="ms"),
    column("made_unix_ms", Double, nullable=True, meaning="Wall clock then, since 1970 (UTC).", unit="ms"),
    sqlite_with_rowid=False,
)

inputs = Table(
    "inputs",
    metadata,
    column("episode_id", _Id, ForeignKey(_Episode), primary_key=True, meaning="Which episode."),
    column("seat", SmallInteger, primary_key=True, autoincrement=False, meaning="Seat of the person."),
    column(
        "number",
        Integer,
        primary_key=True,
        autoincrement=False,
        meaning="1, 2, ... in the order in which the person's inputs arrived in the episode.",
    ),
    column("tab", _Key, meaning="Random name of the browser tab."),
    column("seq", BigInteger, meaning="The browser's number of the message; a new page counts from the start."),
    column("held", SmallInteger, nullable=True, meaning="Move whose key was held down; none: no key."),
    column("tap", SmallInteger, nullable=True, meaning="Action whose key was just pressed; none: no key."),
    column("client_ms", Double, meaning="performance.now() of the browser then.", unit="ms"),
    column("received_unix_ms", Double, meaning="Its arrival by the wall clock, since 1970 (UTC).", unit="ms"),
    column(
        "received_ms",
        Double,
        nullable=True,
        meaning="Its arrival, since the first tick's deadline; none: the game was paused.",
        unit="ms",
    ),
    column(
        "timestep",
        Integer,
        nullable=True,
        meaning="n: the first tick in which it had an effect; none: no effect.",
        unit="timesteps",
    ),
    column("outcome", String(16), meaning="Outcome: " + ", ".join(INPUT_OUTCOMES) + "."),
    sqlite_with_rowid=False,
)

pauses = Table(
    "pauses",
    metadata,
    number("Number of the pause."),
    column("episode_id", _Id, ForeignKey(_Episode), meaning="Which episode."),
    column("timestep", Integer, meaning="State at which the game was paused.", unit="timesteps"),
    column("reason", String(64), meaning="hidden, blur, lost, other_tab, database, researcher or server."),
    time("started_at", "When it began; after a crash of the server, the last stored moment."),
    column("duration_ms", Double, nullable=True, meaning="Its length; none: not over.", unit="ms"),
    UniqueConstraint("episode_id", "started_at"),
)

answers = Table(
    "answers",
    metadata,
    number("Number of the answer."),
    column("participant_id", _Id, ForeignKey(_Participant), meaning="Who."),
    column(
        "episode_id",
        _Id,
        ForeignKey(_Episode),
        nullable=True,
        index=True,
        meaning="About which episode; none: about the study.",
    ),
    column("step_key", _Key, meaning="Page of the participant's plan."),
    column("question_key", _Key, meaning="Question in the study file."),
    column("value", JSON, meaning="The answer: number, text, list or true/false."),
    time("submitted_at", "When the page was submitted."),
    column("took_ms", Double, nullable=True, meaning="Time spent on the page.", unit="ms"),
    column(
        "attention",
        Boolean,
        nullable=True,
        meaning="Whether an attention check was passed; none: not an attention check.",
    ),
    UniqueConstraint("participant_id", "step_key", "question_key"),
)

visits = Table(
    "visits",
    metadata,
    number("Number of the visit."),
    column("participant_id", _Id, ForeignKey(_Participant), index=True, meaning="Who."),
    column("step_key", _Key, meaning="Page or game of the participant's plan."),
    time("entered_at", "When the page was requested."),
    time("left_at", "When it was submitted; none: reloaded, left or still open.", nullable=True),
)

events = Table(
    "events",
    metadata,
    number("Number of the event."),
    column(
        "participant_id", _Id, ForeignKey(_Participant), nullable=True, index=True, meaning="Who; none: the server."
    ),
    column("episode_id", _Id, ForeignKey(_Episode), nullable=True, index=True, meaning="During which episode."),
    time("at", "When."),
    column("kind", String(64), meaning="reload, takeover, trouble, rtt, ..."),
    column("detail", JSON, meaning="Further details."),
)

audit = Table(
    "audit",
    metadata,
    column("id", Integer, primary_key=True, autoincrement=False, meaning="1 to n without a gap."),
    time("at", "When."),
    column("actor", _Key, meaning="Who did it: an account's name, or server."),
    column("action", _Key, meaning="What was done."),
    column(
        "detail",
        Text,
        nullable=True,
        meaning="Object and reason, as JSON; blanked if it named a participant who withdrew.",
    ),
    column(
        "salt", String(32), nullable=True, meaning="Random, so that a blanked detail cannot be guessed from its hash."
    ),
    column("detail_hash", _Sha256, meaning="SHA-256 of salt and detail."),
    column(
        "hash",
        _Sha256,
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
    column("hash", _Sha256, meaning="Its hash."),
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
    column("name", _Key, primary_key=True, meaning="A researcher's account; the audit log's actor."),
    column("password_hash", Text, meaning="Argon2id."),
    column("role", String(16), meaning="One of: " + ", ".join(ROLES) + "."),
    time("created_at", "When it was created."),
)

admin_sessions = Table(
    "admin_sessions",
    metadata,
    column("token_hash", _Sha256, primary_key=True, meaning="SHA-256 of the token in the researcher's cookie."),
    column("admin", _Key, ForeignKey("admins.name"), index=True, meaning="Whose."),
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
        _Key,
        meaning="The researcher's account (a hash where there is none); empty for a completion code; of a participant "
        "a keyed hash of the network; of those turned away the study.",
    ),
    column(
        "origin",
        _Sha256,
        meaning="Origin of a guess: a keyed hash of the address, or of the known browser; empty for participants.",
    ),
    time("at", "When. Deleted with the next of its kind, guesses after 15 minutes and participants after an hour."),
    Index(None, "kind", "name", "at"),
)

exclusions = Table(
    "exclusions",
    metadata,
    number("Number of the decision."),
    column("participant_id", _Id, ForeignKey(_Participant), index=True, meaning="Whose data."),
    column(
        "episode_id", _Id, ForeignKey(_Episode), nullable=True, index=True, meaning="This episode only; none: all data."
    ),
    column("reason", _Key, meaning="Why the data are excluded from the analysis."),
    column("note", Text, meaning="A note of the researcher."),
    column("excluded_by", _Key, meaning="The researcher who decided."),
    time("excluded_at", "When."),
    column("restored_by", _Key, nullable=True, meaning="Who undid it; none: it is in force."),
    time("restored_at", "When it was undone.", nullable=True),
)

study_pauses = Table(
    "study_pauses",
    metadata,
    number("Number of the pause."),
    column("study", _Key, index=True, meaning="The study's name; all its versions are paused."),
    column("paused_by", _Key, meaning="The researcher who paused it."),
    time("paused_at", "When it was paused: nobody can join and no game runs."),
    column("resumed_by", _Key, nullable=True, meaning="Who resumed it; none: it is still paused."),
    time("resumed_at", "When it was resumed.", nullable=True),
)
