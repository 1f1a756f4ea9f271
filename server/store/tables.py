"""The tables, in SQLAlchemy Core. docs/reference/data_dictionary.md is printed from every column's meaning and unit.

Here are the tables of games. people_tables.py, answer_tables.py and researcher_tables.py have the others, which are
imported from here too. What fills them: participants.py, episodes.py, answers.py, events.py, audit.py.
"""

from sqlalchemy import (
    JSON,
    BigInteger,
    Boolean,
    Double,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    SmallInteger,
    String,
    Table,
    Text,
    UniqueConstraint,
)

from server.play.recorder import INPUT_OUTCOMES
from server.store.answer_tables import answers, events, visits
from server.store.columns import column, number, time
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
    EPISODE,
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
    "metadata",
    "participants",
    "pauses",
    "personal",
    "studies",
    "study_pauses",
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
        meaning="Name of the agent in the study, e.g. mine for agents/mine.onnx; none: no agent, or an older episode.",
    ),
    column("agent_0_sha256", SHA256, nullable=True, meaning="Hash of the agent's weights."),
    column("agent_1_sha256", SHA256, nullable=True, meaning="Hash of the agent's weights."),
    column("predictor", KEY, nullable=True, meaning="Predictor that ran at every timestep, shown or not."),
    column("predictor_sha256", SHA256, nullable=True, meaning="Hash of the predictor's weights."),
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
    column("episode_id", ID, ForeignKey(EPISODE), primary_key=True, meaning="Which episode."),
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
    column("episode_id", ID, ForeignKey(EPISODE), primary_key=True, meaning="Which episode."),
    column("seat", SmallInteger, primary_key=True, autoincrement=False, meaning="Seat of the person."),
    column(
        "number",
        Integer,
        primary_key=True,
        autoincrement=False,
        meaning="1, 2, ... in the order in which the person's inputs arrived in the episode.",
    ),
    column("tab", KEY, meaning="Random name of the browser tab."),
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
    column("episode_id", ID, ForeignKey(EPISODE), meaning="Which episode."),
    column("timestep", Integer, meaning="State at which the game was paused.", unit="timesteps"),
    column("reason", String(64), meaning="hidden, blur, lost, other_tab, database, researcher or server."),
    time("started_at", "When it began; after a crash of the server, the last stored moment."),
    column("duration_ms", Double, nullable=True, meaning="Its length; none: not over.", unit="ms"),
    UniqueConstraint("episode_id", "started_at"),
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
)
