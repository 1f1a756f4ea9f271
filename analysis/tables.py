"""The folder that `kitchenmind export` writes, as checked tables. Only this file knows how columns are spelled there.

Seats become roles here: everything after this file speaks of the person and the partner, never of chef 0 and chef 1.
"""

import json
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import polars as pl

STEPS = 3  # predicted actions a timestep
ACTIONS = 6
STAY = 4
INTERACT = 5

CONDITIONS = ("none", "random", "tom")  # order of the published design
LAYOUTS = ("coordination_ring", "double_rings", "double_counters", "matrix", "clear_division")
AGENTS = ("sp", "fcp")

# column here -> how an export may spell it, best first
SPELLINGS: dict[str, dict[str, tuple[str, ...]]] = {
    "participants": {"participant": ("participant", "participant_id", "id"), "condition": (), "status": ()},
    "episodes": {
        "episode": ("episode", "episode_id", "id"),
        "condition": (),
        "layout": (),
        "number": (),
        "status": (),
        "score": (),
        "progress": (),
        "watched_seat": (),
    },
    "answers": {
        "participant": ("participant", "participant_id"),
        "episode": ("episode", "episode_id"),
        "question": ("question", "question_key"),
        "value": (),
    },
    "ticks": {
        "episode": ("episode", "episode_id"),
        "timestep": (),
        "action_0": (),
        "action_1": (),
        "late": (),
    },
    "pauses": {"episode": ("episode", "episode_id"), "reason": (), "duration_ms": ()},
}
OPTIONAL = ("pauses",)


class ExportError(ValueError):
    """The folder is no export that this analysis can read; the text says what to do."""


@dataclass(frozen=True)
class Export:
    """The tables of one export, in the roles of the study.

    participants: participant, condition, status, excluded. episodes: episode, participant, condition, layout, agent,
    number, score, progress, status, excluded, tick_ms, horizon. answers: participant, episode, question, value (numbers
    only). ticks: episode, timestep, person, partner (actions that made this state; null at timestep 0), predicted_1..3
    (most probable actions of the partner at timesteps n, n+1, n+2), late. pauses: episode, reason, duration_ms.
    `excluded` is the researcher's reason, empty for what is analysed. Tutorials and watched games are left out.
    """

    folder: Path
    participants: pl.DataFrame
    episodes: pl.DataFrame
    answers: pl.DataFrame
    ticks: pl.DataFrame
    pauses: pl.DataFrame
    about: dict[str, Any] = field(default_factory=dict)  # name, title, revision, offline accuracy, ...

    @property
    def conditions(self) -> tuple[str, ...]:
        return in_order(self.participants["condition"], CONDITIONS)

    @property
    def layouts(self) -> tuple[str, ...]:
        return in_order(self.episodes["layout"], LAYOUTS)

    @property
    def agents(self) -> tuple[str, ...]:
        return in_order(self.episodes["agent"], AGENTS)


def in_order(values: pl.Series, known: tuple[str, ...]) -> tuple[str, ...]:
    """The distinct values: the known ones in the published order, then the others as they come."""
    present = [str(value) for value in values.drop_nulls().unique(maintain_order=True)]
    return tuple([name for name in known if name in present] + [name for name in present if name not in known])


def read_export(folder: Path) -> Export:
    """The export in `folder` (tables as Parquet or CSV, also in a data/ folder below). Raises ExportError."""
    if not folder.is_dir():
        raise ExportError(f"{folder} is no folder. Give the folder that `kitchenmind export --out` wrote.")
    raw = {name: _read_table(folder, name) for name in SPELLINGS}
    episodes = _episodes(raw["episodes"])
    played = set(episodes["episode"])
    participants = _with_default(raw["participants"], "excluded", "").with_columns(pl.col("excluded").fill_null(""))
    return Export(
        folder,
        participants.with_columns(_text("participant", "condition", "status")),
        episodes,
        _answers(raw["answers"]),
        _ticks(raw["ticks"].filter(pl.col("episode").is_in(played)), episodes),
        raw["pauses"].filter(pl.col("episode").is_in(played)),
        _about(folder),
    )


def table_file(folder: Path, name: str) -> Path | None:
    """The file of a table: its name is one of the words of the file's name (Psych-DS: study-x_ticks_data.csv)."""
    found = [
        path
        for path in sorted(folder.rglob("*"))
        if path.suffix in (".parquet", ".csv") and name in re.split(r"[-_.]", path.stem)
    ]
    return min(found, key=lambda path: (path.suffix != ".parquet", len(path.parts), path.name), default=None)


def _read_table(folder: Path, name: str) -> pl.DataFrame:
    path = table_file(folder, name)
    if path is None:
        if name in OPTIONAL:
            return pl.DataFrame(schema=dict.fromkeys(SPELLINGS[name], pl.String)).cast({"duration_ms": pl.Float64})
        raise ExportError(f"{folder} has no table of {name} ({name}.csv or {name}.parquet). Export the study again.")
    table = pl.read_parquet(path) if path.suffix == ".parquet" else pl.read_csv(path, infer_schema_length=None)
    for column, spellings in SPELLINGS[name].items():
        known = next((spelling for spelling in (spellings or (column,)) if spelling in table.columns), None)
        if known is None:
            raise ExportError(
                f"{path} has no column {column}. Export the study again with this version of kitchenmind."
            )
        table = table.rename({known: column}) if known != column else table
    return table


def _text(*columns: str) -> list[pl.Expr]:
    return [pl.col(column).cast(pl.String) for column in columns]


def _with_default(table: pl.DataFrame, column: str, value: object) -> pl.DataFrame:
    return table if column in table.columns else table.with_columns(pl.lit(value).alias(column))


def _episodes(table: pl.DataFrame) -> pl.DataFrame:
    """Episodes of the plan, with the person and the partner looked up from the seats."""
    if "kind" in table.columns:
        table = table.filter(pl.col("kind") == "episode")
    partner = pl.col("watched_seat") == 0
    for role, column, at_seat in (("partner", "agent", partner), ("person", "participant", ~partner)):
        if column not in table.columns:
            if f"{column}_0" not in table.columns:
                raise ExportError(f"The table of episodes names no {role}: it needs the column {column} or {column}_0.")
            table = table.with_columns(
                pl.when(at_seat).then(pl.col(f"{column}_0")).otherwise(pl.col(f"{column}_1")).alias(column)
            )
    defaults = {"excluded": "", "tick_ms": 200, "horizon": 400}
    for column, value in defaults.items():
        table = _with_default(table, column, value)
    return table.with_columns(
        *_text("episode", "participant", "condition", "layout", "agent", "status"),
        pl.col("excluded").fill_null(""),
        pl.col("score", "progress").cast(pl.Float64),
    ).sort("participant", "number")


def _answers(table: pl.DataFrame) -> pl.DataFrame:
    """Numeric answers about an episode; free text is no matter of statistics."""
    value = pl.col("value").cast(pl.String).str.strip_chars('"').cast(pl.Float64, strict=False)
    return table.with_columns(value, *_text("participant", "episode", "question")).drop_nulls(["episode", "value"])


def _ticks(table: pl.DataFrame, episodes: pl.DataFrame) -> pl.DataFrame:
    """Actions by role and the most probable action of each step."""
    table = table.with_columns(pl.col("episode").cast(pl.String))
    table = table.join(episodes.select("episode", "watched_seat"), on="episode")
    partner = pl.col("watched_seat") == 0
    columns = [
        pl.when(partner).then(pl.col("action_0")).otherwise(pl.col("action_1")).cast(pl.Int8).alias("partner"),
        pl.when(partner).then(pl.col("action_1")).otherwise(pl.col("action_0")).cast(pl.Int8).alias("person"),
        pl.col("late").cast(pl.Boolean),
    ]
    keys = [key for key in ("key_client_ms", "key_received_ms") if f"{key}_0" in table.columns]
    columns += [pl.when(partner).then(pl.col(f"{key}_1")).otherwise(pl.col(f"{key}_0")).alias(key) for key in keys]
    missing = [step for step in range(1, STEPS + 1) if f"predicted_{step}" not in table.columns]
    columns += [_most_probable(table, step) for step in missing]
    return table.with_columns(columns).sort("episode", "timestep")


def _most_probable(table: pl.DataFrame, step: int) -> pl.Expr:
    probabilities = [column for column in table.columns if column.startswith(f"p{step}_")]
    if len(probabilities) != ACTIONS:
        return pl.lit(None, dtype=pl.Int8).alias(f"predicted_{step}")
    best = pl.concat_list(probabilities).list.arg_max().cast(pl.Int8)
    return pl.when(pl.col(probabilities[0]).is_null()).then(None).otherwise(best).alias(f"predicted_{step}")


def _about(folder: Path) -> dict[str, Any]:
    """What the export says about itself beside its tables."""
    about: dict[str, Any] = {}
    for path in (folder / "about.json", folder / "dataset_description.json"):
        if path.is_file():
            found = json.loads(path.read_text(encoding="utf-8"))
            about = {**found, **about} if isinstance(found, dict) else about
    return about
