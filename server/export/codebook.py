"""Every table and column of an export: type, unit, meaning. The export is built from it, and codebook.json printed."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from overcooked.constants import EVENT_NAMES
from server.play.recorder import INPUT_OUTCOMES
from server.store.tables import EPISODE_STATUSES, PARTICIPANT_STATUSES

TYPES = ("text", "integer", "number", "boolean", "time", "json")
ACTION_NAMES = ("north", "south", "east", "west", "stay", "interact")
STEPS = (1, 2, 3)
ACTION_CODE = "0 north, 1 south, 2 east, 3 west, 4 stay, 5 interact"
ESCAPED = (
    "In CSV a text that begins with = + - @ (also in their full-width forms), a tab or a line break (after any number "
    "of apostrophes) carries one more apostrophe in front, so that no spreadsheet runs it; so does a part of a text "
    "after a semicolon, a tab or a line break. Numbers, and all Parquet files, are exact."
)
_EVENTS = ", ".join(f"{1 << bit} {name}" for bit, name in enumerate((*EVENT_NAMES, "soup_from_pot")))


@dataclass(frozen=True)
class Column:
    """One column of a table. `small`: an integer of 16 bits."""

    name: str
    type: str
    meaning: str
    unit: str = ""
    bits: int = 64

    def described(self) -> dict[str, Any]:
        return {"type": self.type, "unit": self.unit or None, "meaning": self.meaning}


@dataclass(frozen=True)
class ExportTable:
    """One table: `row` says what a row is."""

    name: str
    row: str
    columns: tuple[Column, ...]

    @cached_property
    def names(self) -> list[str]:
        return [column.name for column in self.columns]


def _text(name: str, meaning: str) -> Column:
    return Column(name, "text", meaning)


def _code(name: str, meaning: str) -> Column:
    return Column(name, "integer", meaning, bits=16)


def _ms(name: str, meaning: str) -> Column:
    return Column(name, "number", meaning, "ms")


def _points(name: str, meaning: str) -> Column:
    return Column(name, "integer", meaning, "points", bits=16)


def _time(name: str, meaning: str) -> Column:
    return Column(name, "time", meaning, "UTC")


def _seats(column: Column) -> tuple[Column, Column]:
    """The column for each of the two chefs."""
    meanings = (f"{column.meaning} Chef {seat}." for seat in (0, 1))
    first, second = (
        Column(f"{column.name}_{seat}", column.type, meaning, column.unit, column.bits)
        for seat, meaning in enumerate(meanings)
    )
    return first, second


_STUDY = (
    _text("study", "The study's name."),
    Column("study_version", "integer", "1 for the first text of the study file, 2 for the next, ...", bits=32),
)
_PARTICIPANT = _text("participant", "Random id, made by this platform; not the recruiter's.")
_EPISODE = _text("episode", "Random id of the episode.")
_STEP = _text("step", "Step of the participant's way through the study.")

PARTICIPANTS = ExportTable(
    "participants",
    "a participant who consented and did not withdraw; after these columns follow the wide ones",
    (
        _PARTICIPANT,
        *_STUDY,
        Column("number", "integer", "1 to n in order of consent, those who withdrew counted.", bits=32),
        _text("condition", "Arm of the study."),
        _text("status", "One of: " + ", ".join(PARTICIPANT_STATUSES) + "."),
        _text("language", "Language of the pages (BCP 47)."),
        Column("simulated", "boolean", "True: a bot, not a person."),
        Column("seed", "integer", "All random choices for the participant come from it."),
        Column("position", "integer", "Index of the step reached, from 0.", bits=32),
        _time("started_at", "Consent."),
        _time("last_seen_at", "Last sign of life."),
        _time("completed_at", "Last step submitted."),
        _text("excluded", "Why the researcher excluded all data of the participant; empty: not excluded."),
        Column("attention_checks", "integer", "Attention checks that the participant answered.", bits=32),
        Column("attention_failed", "integer", "Those of them that were answered wrongly.", bits=32),
    ),
)
# Made for every participant from episodes and answers; the patterns stand in the codebook, the columns themselves too.
WIDE = (
    _text("layout_{number}", "Layout of the participant's episode with this number."),
    _text("agent_{number}", "Agent that the participant played it with."),
    Column("score_{number}", "integer", "Sum of sparse rewards.", "points", bits=32),
    Column("progress_{number}", "number", "Credit for unfinished soups.", "points"),
    _text("answer_{step}_{question}", "Answer to this question on this page; lists and yes/no as JSON."),
)
EPISODES = ExportTable(
    "episodes",
    "an episode that was drawn up (kind: episode, tutorial or watch)",
    (
        _EPISODE,
        *_STUDY,
        *_seats(_text("participant", "Participant on the seat; empty: an agent.")),
        _text("condition", "Arm of the study."),
        _text("kind", "tutorial, episode or watch."),
        Column("number", "integer", "1-based among the study's episodes; 0 for the tutorial.", bits=32),
        _STEP,
        Column("attempt", "integer", "1 for the first try at the step.", bits=32),
        _text("layout", "Name of the kitchen."),
        _text("layout_sha256", "Hash of its grid."),
        *_seats(_text("agent", "Agent on the seat; empty: a participant.")),
        _text("agent_name", "What the study calls the agent, e.g. mine for agents/mine.onnx; empty: an older episode."),
        *(_text(f"agent_{seat}_sha256", f"Hash of the weights of the agent on seat {seat}.") for seat in (0, 1)),
        _text("predictor", "Predictor that was asked at every timestep, shown or not."),
        _text("predictor_sha256", "Hash of its weights."),
        _code("watched_seat", "Seat of the chef whose next actions are predicted."),
        _text("shown", "What the participant saw: nothing, predictor or random."),
        Column(
            "display_violations",
            "integer",
            "In how many timesteps the frame did not show what `shown` says, e.g. as the predictor was late; 0: always "
            "as it is meant to be. The last state, on which nothing is shown, does not count.",
            "timesteps",
            bits=32,
        ),
        Column("seed", "integer", "All randomness of the episode comes from it."),
        Column("horizon", "integer", "Timesteps to play; 0: endless.", "timesteps", bits=32),
        Column("tick_ms", "integer", "Length of a timestep.", "ms", bits=32),
        _text("status", "One of: " + ", ".join(EPISODE_STATUSES) + "."),
        _text("end_reason", "Why it ended."),
        Column("timesteps", "integer", "Timesteps that were played.", "timesteps", bits=32),
        Column("score", "integer", "Sum of sparse rewards.", "points", bits=32),
        Column("soups", "integer", "Soups delivered.", bits=32),
        Column("progress", "number", "Credit for unfinished soups, apart from the score.", "points"),
        Column("passed", "boolean", "Tutorial: passed. Episode: played to its end."),
        _text("final_hash", "Hash of the last state."),
        _time("created_at", "When it was drawn up."),
        _time("started_at", "When it began."),
        _time("ended_at", "When it ended."),
        _text("code_version", "Version of the software."),
        _text(
            "excluded",
            "Why the researcher excluded this episode; empty: not excluded, or all of its participant's are.",
        ),
        Column("spec", "json", "The whole specification, with the grid: enough to simulate the episode again."),
        Column("last_tick", "json", "What was recorded about the last state, in which nothing was done any more."),
    ),
)
TICKS = ExportTable(
    "ticks",
    "a timestep t of an episode: the state before it, what was predicted and shown then, what was done in it",
    (
        _EPISODE,
        Column("timestep", "integer", "t, from 0.", "timesteps", bits=32),
        _text(
            "state_hash", "Hash of state t, before the actions; the state after the last timestep: episodes.final_hash."
        ),
        *_seats(_code("action", f"Action done in timestep t: {ACTION_CODE}.")),
        *_seats(_points("reward", "Sparse reward for it.")),
        *_seats(_points("shaped", "Shaped reward for it.")),
        *_seats(Column("events", "integer", f"What happened in it, a sum of: {_EVENTS}.", bits=32)),
        *_seats(_code("decided", "What the agent decided for timestep t; empty: a person, or no answer in time.")),
        Column("late", "boolean", "The models missed their deadline: the agent waited in timestep t."),
        *(
            Column(f"p{step}_{name}", "number", f"Predicted probability of {name} in timestep t + {step - 1}.", bits=32)
            for step in STEPS
            for name in ACTION_NAMES
        ),
        *(_code(f"predicted_{step}", f"Most probable action predicted for timestep t + {step - 1}.") for step in STEPS),
        *(_code(f"displayed_{step}", f"Action drawn for timestep t + {step - 1}; 6: nothing.") for step in STEPS),
        *(Column(f"opacity_{step}", "integer", "Opacity it was drawn with.", "%", bits=16) for step in STEPS),
        _ms("scheduled_ms", "When state t was due, since the first; pauses not counted."),
        _ms("late_ms", "How much later than that it began."),
        _ms("models_ms", "Time the models took on state t."),
        *_seats(Column("key_seq", "integer", "Number of the browser's message that decided the action of timestep t.")),
        *_seats(_ms("key_client_ms", "Browser's clock (performance.now()) at that key.")),
        *_seats(_ms("key_received_ms", "Its arrival at the server, since the first tick was due.")),
        _time("made_at", "When state t was made, by the server's wall clock."),
    ),
)
INPUTS = ExportTable(
    "inputs",
    "an input that a person's browser sent in an episode, whether it counted or not",
    (
        _EPISODE,
        _code("seat", "Seat of the person."),
        Column("number", "integer", "1, 2, ... in the order in which the person's inputs arrived.", bits=32),
        _text("tab", "Random name of the browser tab."),
        Column("seq", "integer", "The browser's number of the message; a new page counts from the start."),
        _code("held", f"Move whose key was held down; empty: none. {ACTION_CODE}."),
        _code("tap", "Action whose key had just gone down; empty: none."),
        _ms("client_ms", "Browser's clock (performance.now()) then."),
        _time("received_at", "Its arrival, by the server's wall clock."),
        _ms("received_ms", "Its arrival, since the first tick was due; empty: the game stood still."),
        Column("timestep", "integer", "First timestep t in which it counted; empty: in none.", "timesteps", bits=32),
        _text("outcome", "; ".join(f"{outcome}: {meaning}" for outcome, meaning in INPUT_OUTCOMES.items()) + "."),
    ),
)
PAUSES = ExportTable(
    "pauses",
    "an interruption of an episode",
    (
        _EPISODE,
        Column("timestep", "integer", "State that stood still.", "timesteps", bits=32),
        _text("reason", "hidden, blur, lost, other_tab, database, researcher or server."),
        _time("started_at", "When it began; after a crash of the server, the last moment that was stored."),
        _ms("duration_ms", "How long it lasted, without the countdown after it; empty: not over."),
    ),
)
ANSWERS = ExportTable(
    "answers",
    "an answer to a question",
    (
        _PARTICIPANT,
        _text("episode", "Episode that the question is about; empty: about the study."),
        _STEP,
        _text("question", "Key of the question in the study file."),
        _text("value", "The answer; lists and yes/no as JSON."),
        _text("value_type", "text, number, boolean, list or null."),
        _time("submitted_at", "When the page was submitted."),
        _ms("took_ms", "Time spent on the page."),
        Column(
            "attention",
            "boolean",
            "True: an attention check that was passed; false: one that was failed; empty: no check.",
        ),
    ),
)
VISITS = ExportTable(
    "visits",
    "a page asked for by a participant",
    (
        _PARTICIPANT,
        _STEP,
        _time("entered_at", "Page asked for."),
        _time("left_at", "Page submitted; empty: it was not."),
    ),
)
EVENTS = ExportTable(
    "events",
    "something that happened beside the game",
    (
        _text("participant", "Who."),
        _text("episode", "During which episode."),
        _time("at", "When."),
        _text("kind", "reload, takeover, trouble, rtt, ..."),
        Column("detail", "json", "What else is known."),
    ),
)
STUDIES = ExportTable(
    "studies",
    "a version of a study file",
    (
        *_STUDY,
        _text("sha256", "Hash of the file, which lies in studies/."),
        Column("started", "integer", "Participants who ever consented.", bits=32),
        Column("withdrawn", "integer", "Those of them who withdrew: nothing else is kept of them.", bits=32),
        _time("created_at", "First seen by the server."),
        _time("frozen_at", "First consent."),
    ),
)
ARRIVALS = ExportTable(
    "arrivals",
    "a count of browsers that opened the study's link, or were turned away before consent",
    (
        *_STUDY,
        _text("kind", "opened, declined, unsuitable, or suitable: unsuitable at first and suitable at a later try."),
        _text("reason", "What was unsuitable: browser, screen, input, latency or websocket."),
        Column("count", "integer", "How many browsers.", bits=32),
    ),
)
WITHDRAWALS = ExportTable(
    "withdrawals",
    "a participant who withdrew and whose data were deleted",
    (
        *_STUDY,
        _text("condition", "Arm of the study."),
        Column("position", "integer", "Index of the step at which it was.", bits=32),
        _time("withdrawn_at", "When."),
    ),
)
EXCLUSIONS = ExportTable(
    "exclusions",
    "a researcher's decision that data are not to be analysed; it may have been taken back",
    (
        _PARTICIPANT,
        _text("episode", "This episode only; empty: all data of the participant."),
        _text("reason", "Why."),
        _text("note", "What else was said."),
        _time("excluded_at", "When."),
        _time("restored_at", "When it was taken back; empty: it holds."),
    ),
)
TABLES = (
    STUDIES,
    ARRIVALS,
    PARTICIPANTS,
    WITHDRAWALS,
    EPISODES,
    TICKS,
    INPUTS,
    PAUSES,
    ANSWERS,
    VISITS,
    EVENTS,
    EXCLUSIONS,
)
