"""The tables of an export about a participant's pages: answers, visits, and what happened outside the game."""

from server.export.codebook_columns import PARTICIPANT, STEP, Column, ExportTable, ms, text, time

ANSWERS = ExportTable(
    "answers",
    "an answer to a question",
    (
        PARTICIPANT,
        text(
            "episode",
            "Episode that the question is about; empty: about the study, or about a round that was deleted because its "
            "partner withdrew (`step` then ends with the number of the round).",
        ),
        STEP,
        text("question", "Key of the question in the study file, or of the item of a published scale (`scales`)."),
        text("value", "The answer; lists and yes/no as JSON."),
        text("value_type", "text, number, boolean, list or null."),
        time("submitted_at", "When the page was submitted."),
        ms("took_ms", "Time spent on the page."),
        Column(
            "attention",
            "boolean",
            "True: passed attention check; false: failed attention check; empty: not an attention check.",
        ),
    ),
)
VISITS = ExportTable(
    "visits",
    "a page that a participant requested",
    (
        PARTICIPANT,
        STEP,
        time("entered_at", "When the page was requested."),
        time("left_at", "When the page was submitted; empty: it was not."),
    ),
)
EVENTS = ExportTable(
    "events",
    "an event outside the game",
    (
        text("participant", "Who."),
        text("episode", "During which episode."),
        time("at", "When."),
        text(
            "kind",
            "reload, takeover, trouble, rtt, not_asked (because of an earlier answer), partner_withdrew, more_time (a "
            "researcher lets people be away longer in this episode), ...",
        ),
        Column("detail", "json", "Further details."),
    ),
)
