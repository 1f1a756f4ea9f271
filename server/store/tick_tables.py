"""The tables of what happens in a game: timesteps, inputs, pauses."""

from sqlalchemy import (
    BigInteger,
    Boolean,
    Double,
    ForeignKey,
    Integer,
    LargeBinary,
    SmallInteger,
    String,
    Table,
    UniqueConstraint,
)

from server.play.recorder import INPUT_OUTCOMES
from server.store.columns import column, number, time
from server.store.table_base import EPISODE, ID, KEY, metadata

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
    column("scheduled_ms", Double, meaning="Deadline, since state 0 was due, without pauses.", unit="ms"),
    column("late_ms", Double, meaning="Delay of the tick after its deadline.", unit="ms"),
    column(
        "models_ms",
        Double,
        meaning="Time that the state waited for the models, also for those of other games in its batch.",
        unit="ms",
    ),
    column(
        "key_seq_0", BigInteger, nullable=True, meaning="Number of the browser message that decided seat 0's action."
    ),
    column("key_client_ms_0", Double, nullable=True, meaning="performance.now() of the browser then.", unit="ms"),
    column(
        "key_received_ms_0", Double, nullable=True, meaning="Its arrival, by the clock of `scheduled_ms`.", unit="ms"
    ),
    column("key_seq_1", BigInteger, nullable=True, meaning="The same for seat 1."),
    column("key_client_ms_1", Double, nullable=True, meaning="The same for seat 1.", unit="ms"),
    column("key_received_ms_1", Double, nullable=True, meaning="The same for seat 1.", unit="ms"),
    column("made_unix_ms", Double, nullable=True, meaning="Wall clock then, since 1970 (UTC).", unit="ms"),
    column(
        "asked",
        Boolean,
        nullable=True,
        meaning="Whether the participant asked for the marks on state n; none: they are always drawn.",
    ),
    column(
        "misleading",
        Boolean,
        nullable=True,
        meaning="Whether the marks of state n are a wrong future; none: the episode does not mislead.",
    ),
    column(
        "in_sight",
        Boolean,
        nullable=True,
        meaning="Whether the watched chef was in the participant's view in state n; none: sight was not limited.",
    ),
    column(
        "intentions",
        LargeBinary(16),
        nullable=True,
        meaning="What the watched chef does next, the likeliest and the runner-up: kind, x, y, timesteps until it is "
        "done (a byte each), probability (float32); none: not predicted. Kinds: overcooked/interactions.py.",
    ),
    column(
        "displayed_intention",
        LargeBinary(4),
        nullable=True,
        meaning="The intention that the frame showed: kind (8: nothing), x, y, opacity; none: it could not show any.",
        unit="%",
    ),
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
        meaning="Its arrival, by the clock of `scheduled_ms`; none: the game was paused.",
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
    column("marks", Boolean, nullable=True, meaning="Whether the marks key was down; none: no news of it."),
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
    column(
        "seat",
        SmallInteger,
        nullable=True,
        meaning="Seat of the person whose absence began it; none: not an absence, the person watched two agents, or an "
        "earlier version stored it.",
    ),
    column(
        "away_ms",
        Double,
        nullable=True,
        meaning="How much of it counted as absence of people; none: not over, or recorded by an older version.",
        unit="ms",
    ),
    UniqueConstraint("episode_id", "started_at"),
)
