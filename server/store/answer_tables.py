"""The tables of what participants answer, of their visits, and of events beyond the games."""

from sqlalchemy import JSON, Boolean, Double, ForeignKey, String, Table, UniqueConstraint

from server.store.columns import column, number, time
from server.store.table_base import EPISODE, ID, KEY, PARTICIPANT, metadata

answers = Table(
    "answers",
    metadata,
    number("Number of the answer."),
    column("participant_id", ID, ForeignKey(PARTICIPANT), meaning="Who."),
    column(
        "episode_id",
        ID,
        ForeignKey(EPISODE),
        nullable=True,
        index=True,
        meaning="About which episode; none: about the study, or about a round deleted with its partner.",
    ),
    column("step_key", KEY, meaning="Page of the participant's plan."),
    column("question_key", KEY, meaning="Question in the study file."),
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
    column("participant_id", ID, ForeignKey(PARTICIPANT), index=True, meaning="Who."),
    column("step_key", KEY, meaning="Page or game of the participant's plan."),
    time("entered_at", "When the page was requested."),
    time("left_at", "When it was submitted; none: reloaded, left or still open.", nullable=True),
)

events = Table(
    "events",
    metadata,
    number("Number of the event."),
    column("participant_id", ID, ForeignKey(PARTICIPANT), nullable=True, index=True, meaning="Who; none: the server."),
    column("episode_id", ID, ForeignKey(EPISODE), nullable=True, index=True, meaning="During which episode."),
    time("at", "When."),
    column("kind", String(64), meaning="reload, takeover, trouble, rtt, ..."),
    column("detail", JSON, meaning="Further details."),
)
