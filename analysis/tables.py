"""The folder that `kitchenmind export` writes, as the tables of one study. Only this file and `table_files` use the
export's column names. Seats become roles here: the rest of the analysis has the person and the partner, not chef 0 and
chef 1.
"""

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any

import polars as pl
import yaml

from analysis.simulated_participants import PEOPLE, SIMULATED, Subjects, is_simulated, without_pooling
from analysis.table_files import COLUMNS, read_table
from analysis.table_files import ExportError as ExportError
from analysis.within_effects import PREFIX

STEPS = 3  # predicted actions a timestep
ACTIONS = 6
STAY = 4
INTERACT = 5

CONDITIONS = ("none", "random", "tom")  # order of the published design
LAYOUTS = ("coordination_ring", "double_rings", "double_counters", "matrix", "clear_division")
AGENTS = ("sp", "fcp")
PERSON = "person"  # the partner in a round of two people, where the export does not name it


@dataclass(frozen=True)
class Export:
    """The tables of one study, in its roles.

    participants: participant, condition, status, excluded, and study_version where the export has it. withdrawals:
    condition. episodes: episode, participant, condition, layout, agent, number, score, progress, status, excluded,
    tick_ms, and watched_person, which is empty except in a round of two people: such a round counts once, for the
    participant who is not watched. answers: participant, episode, question, value (only what was stored as a number,
    never text that looks like one), of the participant for whom the episode counts. pauses: episode, reason,
    duration_ms, of_person (false: the watched person's absence, true also where nobody knows whose it was), and
    started_at where the export has it. ticks: episode, timestep, person and partner (actions of this
    timestep), predicted_1..3 (the partner's most probable actions in this timestep and the next two), late, and the
    person's key_client_ms and key_received_ms. `excluded` is the researcher's
    reason, empty for what is analysed. Tutorials and watched games are left out.
    """

    folder: Path
    study: str
    participants: pl.DataFrame
    withdrawals: pl.DataFrame
    episodes: pl.DataFrame
    answers: pl.DataFrame
    ticks: pl.DataFrame
    pauses: pl.DataFrame
    about: dict[str, Any] = field(default_factory=dict)  # name, title, revision, offline accuracy, ...
    version: int | None = None  # of the study file, if one was chosen
    reliance: pl.DataFrame = field(default_factory=pl.DataFrame)  # as exported; empty where a study does not mislead
    all_answers: pl.DataFrame = field(default_factory=pl.DataFrame)  # as `answers`, and about the study; with the step
    simulated_left_out: int = 0  # simulated participants, where the export has people, too

    @property
    def is_simulated(self) -> bool:
        """True if the participants are simulated, or the export says that it was made up."""
        return bool(self.about.get("simulated")) or bool(is_simulated(self.participants).any())

    @property
    def subjects(self) -> Subjects:
        """What the report calls those who took part."""
        return SIMULATED if self.is_simulated else PEOPLE

    @property
    def versions(self) -> dict[int, int]:
        """Number of participants by version of the study file, oldest first; empty where the export names none."""
        if "study_version" not in self.participants.columns:
            return {}
        counts = self.participants["study_version"].drop_nulls().cast(pl.Int64).value_counts().sort("study_version")
        return {int(version): int(count) for version, count in counts.iter_rows()}

    @property
    def conditions(self) -> tuple[str, ...]:
        """The conditions of all who were assigned, those who withdrew included."""
        assigned = [table["condition"].cast(pl.String) for table in (self.participants, self.withdrawals)]
        return in_order(pl.concat(assigned), tuple(self.about.get("conditions") or CONDITIONS))

    @property
    def layouts(self) -> tuple[str, ...]:
        return in_order(self.episodes["layout"], tuple(self.about.get("layouts") or LAYOUTS))

    @property
    def agents(self) -> tuple[str, ...]:
        return in_order(self.episodes["agent"], AGENTS)


def in_order(values: pl.Series, known: tuple[str, ...]) -> tuple[str, ...]:
    """Return the distinct values: the known ones in the published order, then the others as they come."""
    present = [str(value) for value in values.drop_nulls().unique(maintain_order=True)]
    return tuple([name for name in known if name in present] + [name for name in present if name not in known])


def read_export(folder: Path, study: str | None = None, version: int | None = None) -> Export:
    """Read the export in `folder` (tables as Parquet or CSV, also in a data/ folder below). `study` chooses one where
    there are several, `version` one version of its file. Bots are read only if there are no people. Raises
    ExportError."""
    if not folder.is_dir():
        raise ExportError(f"{folder} is not a folder. Give the folder that `kitchenmind export --out` wrote.")
    raw = {name: read_table(folder, name) for name in COLUMNS}
    study = _chosen_study(raw["participants"], study)
    raw |= {name: raw[name].filter(pl.col("study") == study) for name in ("participants", "withdrawals")}
    if version is not None:
        raw |= _of_version(raw, version)
    raw, left_out = without_pooling(raw)
    return replace(export_of(raw, folder, study, version), simulated_left_out=left_out)


def _of_version(raw: Mapping[str, pl.DataFrame], version: int) -> dict[str, pl.DataFrame]:
    """Return the participants and withdrawals of one version of the study file."""
    people = raw["participants"]
    known = people["study_version"].drop_nulls().unique().sort().to_list() if "study_version" in people.columns else []
    if version not in known:
        names = ", ".join(str(name) for name in known) or "no versions at all"
        raise ExportError(f"The export holds no version {version} of this study. It has: {names}.")
    chosen = {"participants": people.filter(pl.col("study_version") == version)}
    withdrawals = raw["withdrawals"]
    if "study_version" in withdrawals.columns:
        chosen["withdrawals"] = withdrawals.filter(pl.col("study_version").cast(pl.Int64, strict=False) == version)
    return chosen


def export_of(raw: Mapping[str, pl.DataFrame], folder: Path, study: str, version: int | None = None) -> Export:
    """Return the tables of one study, as they are exported, in its roles. `folder` has the rest, if it has
    anything."""
    participants = _with_default(raw["participants"], "excluded", "").with_columns(pl.col("excluded").fill_null(""))
    participants = _with_own_factors(_with_default(participants, "attention_failed", 0))
    episodes = _episodes(raw["episodes"]).join(participants.select("participant"), on="participant", how="semi")
    episodes = _with_own_factors(episodes)
    played = episodes.select("episode")
    numbers = _of_own_episodes(_numbers(raw["answers"]), episodes)
    return Export(
        folder,
        study,
        participants,
        raw["withdrawals"],
        episodes,
        numbers.drop_nulls("episode"),
        _ticks(raw["ticks"].join(played, on="episode", how="semi"), episodes),
        _pauses(raw["pauses"], episodes),
        _about(folder, study, version, participants) if study else {},
        version,
        raw.get("reliance", pl.DataFrame()),
        numbers.join(participants.select("participant"), on="participant", how="semi"),
    )


def _chosen_study(participants: pl.DataFrame, study: str | None) -> str:
    present = sorted(str(name) for name in participants["study"].drop_nulls().unique())
    if study is None and len(present) == 1:
        return present[0]
    if study in present:
        return str(study)
    if not present:
        raise ExportError("Nobody has taken part yet: the table of participants is empty.")
    raise ExportError(
        f"The export holds several studies. Choose one with --study: {', '.join(present)}."
        if study is None
        else f"The export holds no study {study}. It has: {', '.join(present)}."
    )


def _with_own_factors(table: pl.DataFrame) -> pl.DataFrame:
    """Return the table without the factors of other studies and versions: an export has one column for all of them,
    and where a factor has its column says whether it varies within people."""
    names = [name for name in table.columns if name.startswith(PREFIX)]
    return table.drop(name for name in names if table[name].null_count() == table.height)


def _with_default(table: pl.DataFrame, column: str, value: object) -> pl.DataFrame:
    return table if column in table.columns else table.with_columns(pl.lit(value).alias(column))


def _episodes(table: pl.DataFrame) -> pl.DataFrame:
    """Return episodes of the plan, with the person and the partner looked up from the seats."""
    partner = pl.col("watched_seat") == 0
    return (
        _with_default(table.filter(pl.col("kind") == "episode"), "excluded", "")
        .pipe(_with_default, "display_violations", None)
        .pipe(_with_default, "display_violations_late", None)
        .pipe(_with_default, "agent_name", None)
        .with_columns(
            display_violations=pl.col("display_violations").cast(pl.Int64),
            display_violations_late=pl.col("display_violations_late").cast(pl.Int64),
            agent=pl.coalesce(
                pl.col("agent_name").cast(pl.String),
                pl.when(partner).then(pl.col("agent_0")).otherwise(pl.col("agent_1")).cast(pl.String),
                pl.lit(PERSON),
            ),
            participant=pl.when(partner).then(pl.col("participant_1")).otherwise(pl.col("participant_0")),
            watched_person=pl.when(partner).then(pl.col("participant_0")).otherwise(pl.col("participant_1")),
            excluded=pl.col("excluded").fill_null(""),
            score=pl.col("score").cast(pl.Float64),
            progress=pl.col("progress").cast(pl.Float64),
        )
        .sort("participant", "number")
    )


def _of_own_episodes(answers: pl.DataFrame, episodes: pl.DataFrame) -> pl.DataFrame:
    """Return the answers about the study, and each participant's about the episodes that count for them. In a round of
    two people both answer, and the episode counts for one of them."""
    own = episodes.select("episode", "participant", own=pl.lit(value=True))
    answers = answers.join(own, on=["episode", "participant"], how="left", maintain_order="left")
    return answers.filter(pl.col("episode").is_null() | pl.col("own").fill_null(value=False)).drop("own")


def _numbers(table: pl.DataFrame) -> pl.DataFrame:
    """Return answers that were stored as numbers, without attention checks. Free text is left out even where it reads
    "10" or "nan"."""
    table = _with_default(table, "step", "")
    table = _with_default(table, "attention", None).filter(pl.col("attention").is_null())
    numbers = table.filter(pl.col("value_type").cast(pl.String) == "number")
    value = pl.col("value").cast(pl.String).cast(pl.Float64, strict=False)
    return numbers.with_columns(value).filter(pl.col("value").is_finite()).drop_nulls("value")


def _ticks(table: pl.DataFrame, episodes: pl.DataFrame) -> pl.DataFrame:
    """Return actions and key times by role."""
    table = table.join(episodes.select("episode", "watched_seat"), on="episode")
    partner = pl.col("watched_seat") == 0

    def at(seat_of_partner: bool, column: str) -> pl.Expr:
        first, second = (0, 1) if seat_of_partner else (1, 0)
        return pl.when(partner).then(pl.col(f"{column}_{first}")).otherwise(pl.col(f"{column}_{second}"))

    keys = [key for key in ("key_client_ms", "key_received_ms") if f"{key}_0" in table.columns]
    return table.with_columns(
        at(True, "action").cast(pl.Int8).alias("partner"),
        at(False, "action").cast(pl.Int8).alias("person"),
        pl.col("late").cast(pl.Boolean),
        *[at(False, key).cast(pl.Float64).alias(key) for key in keys],
    ).sort("episode", "timestep")


def _pauses(table: pl.DataFrame, episodes: pl.DataFrame) -> pl.DataFrame:
    """Return pauses of these episodes with `of_person`, and `started_at` as a time, where they have it: in CSV it is
    text."""
    table = _with_default(table, "seat", None).join(episodes.select("episode", "watched_seat"), on="episode")
    of_partner = pl.col("seat").cast(pl.Int64, strict=False) == pl.col("watched_seat").cast(pl.Int64)
    table = table.with_columns(of_person=~of_partner.fill_null(value=False)).drop("watched_seat")
    if table.schema.get("started_at") != pl.String:
        return table
    return table.with_columns(pl.col("started_at").str.to_datetime(time_unit="us", time_zone="UTC", strict=False))


def _taken_part(files: list[Path], participants: pl.DataFrame) -> list[Path]:
    """Return the versions of the study file under which somebody took part; none where the export does not say."""
    if "study_version" not in participants.columns:
        return []
    numbers = participants["study_version"].cast(pl.Int64, strict=False).drop_nulls().unique()
    return [file for file in files if file.stem.rpartition("-")[2] in {str(number) for number in numbers}]


def _about(folder: Path, study: str, version: int | None, participants: pl.DataFrame) -> dict[str, Any]:
    """Return what the export has in addition to its tables: about.json, and `title`, `factors` (with levels),
    `left_out` (combinations of levels), `conditions` and `layouts` (names in order) of the chosen version of the study
    file, else of the newest one under which somebody took part, if the export contains it."""
    path = folder / "about.json"
    try:
        said = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    except ValueError as error:
        raise ExportError(f"{path} is not valid JSON: {error}. Export the study again.") from None
    about: dict[str, Any] = dict(said) if isinstance(said, dict) else {}
    plain = re.fullmatch(r"[\w-]+", study)  # never outside the folder
    files = folder.glob(f"studies/{study}_version-{'*' if version is None else version}.yaml") if plain else ()
    versions = sorted(files, key=lambda file: (len(file.name), file.name))
    versions = _taken_part(versions, participants) or versions
    try:
        text = versions[-1].read_text(encoding="utf-8") if versions else "{}"
        said = yaml.load(text, Loader=yaml.BaseLoader)  # noqa: S506 - texts only, as they were written
        title = said.get("title")
        about["title"] = next(iter(title.values())) if isinstance(title, dict) else title or about.get("title")
        about["factors"] = {name: list(levels) for name, levels in (said.get("factors") or {}).items()}
        about |= {key: [part["name"] for part in said.get(key) or []] for key in ("conditions", "layouts")}
        cells = said.get("cells") or {}
        about["left_out"] = [str(name) for name in cells.get("without") or ()]
        if about["factors"]:
            about["conditions"] = _crossed(about["factors"], cells.get("within") or ())
    except (yaml.YAMLError, AttributeError, KeyError, TypeError, RecursionError):
        pass  # title and order are optional
    return about


def _crossed(factors: Mapping[str, list[str]], within: Sequence[str]) -> list[str]:
    """Return the names of the conditions in the order of the study file: combinations of levels, and with blocks the
    orders of these (more than there are: those that nobody had are left out)."""
    between = ["_".join(levels) for levels in product(*(factors[name] for name in factors if name not in within))]
    blocks = math.prod(len(factors[name]) for name in within)
    orders = [f"order_{number}" for number in range(1, 2 * blocks + 1)] if blocks > 1 else [""]
    return ["_".join(filter(None, names)) for names in product(between, orders)]
