"""Every table and column of an export: type, unit, meaning. The export and codebook.json are built from it."""

from overcooked.constants import EVENT_NAMES
from server.export.codebook_columns import (
    EPISODE,
    PARTICIPANT,
    STEP,
    STUDY,
    Column,
    ExportTable,
    code,
    ms,
    points,
    seats,
    text,
    time,
    timesteps,
)
from server.export.codebook_intentions import INTENTION_COLUMNS
from server.export.codebook_pages import ANSWERS, EVENTS, VISITS
from server.export.codebook_studies import ARRIVALS, EXCLUSIONS, STUDIES, WITHDRAWALS
from server.play.recorder import INPUT_OUTCOMES
from server.store.tables import EPISODE_STATUSES, PARTICIPANT_STATUSES

TYPES = ("text", "integer", "number", "boolean", "time", "json")
ACTION_NAMES = ("north", "south", "east", "west", "stay", "interact")
STEPS = (1, 2, 3)
ACTION_CODE = "0 north, 1 south, 2 east, 3 west, 4 stay, 5 interact"
ESCAPED = (
    "In CSV files, a text that begins with = + - @ (also in their full-width forms), a tab or a line break, after any "
    "number of blanks and apostrophes, gets one more apostrophe in front, so that no spreadsheet runs it as a formula. "
    "The same applies to each part of a text after a semicolon, a tab or a line break. Numbers and Parquet files are "
    "exact."
)
_EVENTS = ", ".join(f"{1 << bit} {name}" for bit, name in enumerate((*EVENT_NAMES, "soup_from_pot")))


PARTICIPANTS = ExportTable(
    "participants",
    "a participant who consented and did not withdraw; the wide columns follow after these",
    (
        PARTICIPANT,
        *STUDY,
        Column("number", "integer", "1 to n in order of consent, including participants who withdrew.", bits=32),
        Column("allocation_number", "integer", "1 to n among people, or among bots: seed and order follow.", bits=32),
        text("condition", "Arm of the study."),
        text(
            "status",
            f"One of: {', '.join(PARTICIPANT_STATUSES)}. Returned: no partner came or stayed (event `alone`), or the "
            "researcher released the place.",
        ),
        text("language", "Language of the pages (BCP 47)."),
        Column(
            "simulated",
            "boolean",
            "True: a bot, not a person. Bots are built so that foresight can help: never pool them with people.",
        ),
        Column("seed", "integer", "Seed of all random choices for the participant."),
        Column("position", "integer", "Index of the step reached, from 0.", bits=32),
        time("started_at", "Consent."),
        time("last_seen_at", "Last request or message."),
        time("completed_at", "Last step submitted."),
        text("excluded", "Why the researcher excluded all data of the participant; empty: not excluded."),
        Column("attention_checks", "integer", "Attention checks that the participant answered.", bits=32),
        Column("attention_failed", "integer", "How many of them were failed.", bits=32),
    ),
)
FACTOR = text(
    "factor_{factor}",
    "Level of this factor, for the participant or in the episode; empty: the version has no such factor.",
)
BLOCK = Column("block", "integer", "Block of rounds, from 1, in a study with factors within people.", bits=16)
# Made for every participant from episodes and answers; the codebook has the patterns and the actual columns.
WIDE = (
    text("layout_{number}", "Layout of the participant's episode with this number."),
    text("agent_{number}", "Agent in this episode."),
    Column("score_{number}", "integer", "Sum of sparse rewards.", "points", bits=32),
    Column("progress_{number}", "number", "Credit for unfinished soups.", "points"),
    text("answer_{step}_{question}", "Answer to this question on this page; lists and yes/no as JSON."),
)
EPISODES = ExportTable(
    "episodes",
    "an episode that was created (kind: episode, tutorial or watch)",
    (
        EPISODE,
        *STUDY,
        *seats(text("participant", "Participant on the seat; empty: an agent.")),
        text("condition", "Arm of the study."),
        text("kind", "tutorial, episode or watch."),
        Column("number", "integer", "1-based among the study's episodes; 0 for the tutorial.", bits=32),
        STEP,
        Column("attempt", "integer", "1 for the first attempt at the step.", bits=32),
        text("layout", "Name of the kitchen."),
        text("layout_sha256", "Hash of its grid."),
        *seats(text("agent", "Agent on the seat; empty: a participant.")),
        text(
            "agent_name",
            "Name of the partner in the study, such as mine for agents/mine.onnx, also of a human partner; empty: an "
            "older episode.",
        ),
        *(text(f"agent_{seat}_sha256", f"Hash of the weights of the agent on seat {seat}.") for seat in (0, 1)),
        text("predictor", "Predictor that ran at every timestep, shown or not."),
        text("predictor_sha256", "Hash of its weights."),
        code("watched_seat", "Seat of the chef whose next actions are predicted."),
        text("shown", "Source of the marks: nothing, predictor or random; wrong on purpose if `misleading` is true."),
        text("display", "What of a prediction was drawn: actions (marks), intention, both, or none."),
        text("show", "When marks were drawn: always, on_key or toggle (only while the participant asked for them)."),
        Column(
            "view_radius",
            "integer",
            "How many columns and rows around their chef participants saw; 0: the whole kitchen.",
            "cells",
            bits=16,
        ),
        Column("misleading", "boolean", "True: the marks of the episode were made to mislead."),
        timesteps(
            "display_violations",
            "Timesteps whose frame did not show what `shown` and `show` say, for example because the predictor was "
            "late. With limited sight, marks are due while the watched chef is in view. The last state, on which "
            "nothing is shown, does not count.",
        ),
        timesteps("display_violations_late", "Those of them in which the models missed the deadline: a slow server."),
        Column("seed", "integer", "Seed of all randomness in the episode."),
        Column("horizon", "integer", "Timesteps to play; 0: endless.", "timesteps", bits=32),
        Column("tick_ms", "integer", "Length of a timestep.", "ms", bits=32),
        text("status", "One of: " + ", ".join(EPISODE_STATUSES) + "."),
        text("end_reason", "Why it ended."),
        Column("timesteps", "integer", "Timesteps that were played.", "timesteps", bits=32),
        Column("score", "integer", "Sum of sparse rewards.", "points", bits=32),
        Column("soups", "integer", "Soups delivered.", bits=32),
        Column("progress", "number", "Credit for unfinished soups, apart from the score.", "points"),
        Column("passed", "boolean", "Tutorial: passed. Episode: played to its end."),
        text("final_hash", "Hash of the last state."),
        time("created_at", "When it was created."),
        time("started_at", "When it began."),
        time("ended_at", "When it ended."),
        text("code_version", "Version of the software."),
        text(
            "excluded",
            "Why the researcher excluded this episode; empty: not excluded, or all of its participant's are.",
        ),
        Column("spec", "json", "The complete specification with the grid, sufficient to simulate the episode again."),
        Column("last_tick", "json", "The record of the last state, after which no actions follow."),
    ),
)
TICKS = ExportTable(
    "ticks",
    "a timestep t of an episode: the state before it, the prediction and display at that state, and the actions in it",
    (
        EPISODE,
        Column("timestep", "integer", "t, from 0.", "timesteps", bits=32),
        text(
            "state_hash", "Hash of state t, before the actions; the state after the last timestep: episodes.final_hash."
        ),
        *seats(code("action", f"Action in timestep t: {ACTION_CODE}.")),
        *seats(points("reward", "Sparse reward for it.")),
        *seats(points("shaped", "Shaped reward for it.")),
        *seats(Column("events", "integer", f"Events in it, as a sum of: {_EVENTS}.", bits=32)),
        *seats(code("decided", "The agent's decision for timestep t; empty: a person, or no answer in time.")),
        Column("late", "boolean", "The models missed their deadline: the agent waited in timestep t."),
        *(
            Column(f"p{step}_{name}", "number", f"Predicted probability of {name} in timestep t + {step - 1}.", bits=32)
            for step in STEPS
            for name in ACTION_NAMES
        ),
        *(code(f"predicted_{step}", f"Most probable action predicted for timestep t + {step - 1}.") for step in STEPS),
        *(code(f"displayed_{step}", f"Action drawn for timestep t + {step - 1}; 6: nothing.") for step in STEPS),
        *(Column(f"opacity_{step}", "integer", "Opacity of the drawn action.", "%", bits=16) for step in STEPS),
        Column(
            "asked",
            "boolean",
            "Whether the participant asked for the marks on state t; empty: they are always drawn. The frame of state "
            "t is decided when the state is made.",
        ),
        Column(
            "misleading",
            "boolean",
            "Whether the marks of state t are a wrong future; empty: the episode does not mislead. They were seen "
            "where `displayed_1` is not 6 or `displayed_intention_kind` is a kind, not 8.",
        ),
        Column(
            "in_sight",
            "boolean",
            "Whether the watched chef was in the participant's view in state t; empty: sight was not limited.",
        ),
        *INTENTION_COLUMNS,
        ms("scheduled_ms", "When state t was due, since state 0 was due, without pauses and their countdowns."),
        ms("late_ms", "Delay of the tick after its deadline."),
        ms("models_ms", "Time that state t waited for the models, also for those of other games in its batch."),
        *seats(Column("key_seq", "integer", "Number of the browser's message that decided the action of timestep t.")),
        *seats(ms("key_client_ms", "Browser's clock (performance.now()) at that key.")),
        *seats(ms("key_received_ms", "Its arrival, by the clock of `scheduled_ms`; the browser's counts pauses, too.")),
        time("made_at", "When state t was computed, by the server's wall clock."),
    ),
)
INPUTS = ExportTable(
    "inputs",
    "an input that a person's browser sent in an episode, whether or not it had an effect",
    (
        EPISODE,
        code("seat", "Seat of the person."),
        Column("number", "integer", "1, 2, ... in the order in which the person's inputs arrived.", bits=32),
        text("tab", "Random name of the browser tab."),
        Column("seq", "integer", "The browser's number of the message; a new page counts from the start."),
        code("held", f"Move whose key was held down; empty: none. {ACTION_CODE}."),
        code("tap", "Action whose key was just pressed; empty: none."),
        Column("marks", "boolean", "Whether the key that asks for the marks was down; empty: unchanged."),
        ms("client_ms", "Browser's clock (performance.now()) then."),
        time("received_at", "Its arrival, by the server's wall clock."),
        ms("received_ms", "Its arrival, by the clock of `scheduled_ms`; empty: the game was paused."),
        Column("timestep", "integer", "First timestep t in which it had an effect; empty: none.", "timesteps", bits=32),
        text("outcome", "; ".join(f"{outcome}: {meaning}" for outcome, meaning in INPUT_OUTCOMES.items()) + "."),
    ),
)
RELIANCE = ExportTable(
    "reliance",
    "what a participant did next to shown cells in an episode, before or after their first wrong mark; only for "
    "studies that mislead",
    (
        EPISODE,
        text(
            "phase",
            "before: up to and including the first timestep with a wrong mark in the study (`ticks.misleading`); "
            "after: from then on.",
        ),
        Column(
            "near",
            "integer",
            "Timesteps in which the participant's chef stood on or next to a cell that the shown marks lead to. The "
            "next four columns divide them.",
            "timesteps",
            bits=32,
        ),
        Column("waited", "integer", "The chef stayed where it was, without using anything.", "timesteps", bits=32),
        Column("avoided", "integer", "It walked to a cell to which no shown mark leads.", "timesteps", bits=32),
        Column("followed", "integer", "It walked to a cell to which a shown mark leads.", "timesteps", bits=32),
        Column("used", "integer", "It used what it faced.", "timesteps", bits=32),
    ),
)
PAUSES = ExportTable(
    "pauses",
    "an interruption of an episode",
    (
        EPISODE,
        Column("timestep", "integer", "State at which the game was paused.", "timesteps", bits=32),
        text("reason", "hidden, blur, lost, other_tab, database, researcher or server."),
        time("started_at", "When it began; after a crash of the server, the last stored moment."),
        ms("duration_ms", "Its length without the countdown that follows; empty: not over."),
        code(
            "seat",
            "Seat of the person whose absence began the pause, also where the other person left later; empty: not an "
            "absence, the person watched two agents, or an earlier version recorded it.",
        ),
        ms("away_ms", "How much of it counted as absence of people; empty: not over, or from an older version."),
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
    RELIANCE,
    PAUSES,
    ANSWERS,
    VISITS,
    EVENTS,
    EXCLUSIONS,
)
