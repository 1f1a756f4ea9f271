"""The tables of an export about the study itself: its versions, visitors, withdrawals, and researchers' exclusions."""

from server.export.codebook_columns import PARTICIPANT, STUDY, Column, ExportTable, text, time

STUDIES = ExportTable(
    "studies",
    "a version of a study file",
    (
        *STUDY,
        text("sha256", "Hash of the file, which is in studies/."),
        Column("started", "integer", "Participants who ever consented.", bits=32),
        Column(
            "simulated_started", "integer", "How many of them are bots (counted since database revision 0016).", bits=32
        ),
        Column("withdrawn", "integer", "How many of them withdrew; nothing else is stored about these.", bits=32),
        time("created_at", "First seen by the server."),
        time("frozen_at", "First consent."),
    ),
)
ARRIVALS = ExportTable(
    "arrivals",
    "a count of browsers that opened the study's link, or were screened out before consent",
    (
        *STUDY,
        text("kind", "opened, declined, unsuitable, or suitable (unsuitable first, suitable in a later attempt)."),
        text("reason", "What was unsuitable: browser, screen, input, latency or websocket."),
        Column("count", "integer", "How many browsers.", bits=32),
    ),
)
WITHDRAWALS = ExportTable(
    "withdrawals",
    "a participant who withdrew and whose data were deleted",
    (
        *STUDY,
        text("condition", "Arm of the study."),
        Column("position", "integer", "Index of the participant's last step.", bits=32),
        Column("simulated", "boolean", "True: a bot, not a person. Empty in data of an earlier version: not known."),
        time("withdrawn_at", "When."),
    ),
)
EXCLUSIONS = ExportTable(
    "exclusions",
    "a researcher's decision to exclude data from the analysis; it may have been undone",
    (
        PARTICIPANT,
        text("episode", "This episode only; empty: all data of the participant."),
        text("reason", "Why."),
        text("note", "A note of the researcher."),
        time("excluded_at", "When."),
        time("restored_at", "When it was undone; empty: it is in force."),
    ),
)
