"""Simulated studies whose report is recomputed in R, as exports in CSV."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path

import numpy as np
import polars as pl

LAYOUTS = ("coordination_ring", "double_rings", "double_counters", "clear_division")
AGENTS = ("sp", "fcp")
QUESTIONS = ("partner_satisfaction", "efficiency")
ITEMS = {"tia_up1": 1, "tia_up2": -1, "tia_up3": 1, "tia_up4": -1, "tia_t1": 1, "tia_t2": 1}  # -1: reversed
DECLARED = "primary: {{comparison: [tom, none], {how}}}\nsmallest_effect: {{reward: 12, answers: 0.5}}\n"
HEAD = """title: {en: Simulated}
questionnaires: {after: {questions: [{type: published, scale: trust_in_automation}]}}
"""
WELCH = DECLARED.format(how="test: welch")


@dataclass(frozen=True)
class Case:
    """A simulated study. `people`: participants of each condition; `missing`: share of episodes without an end."""

    name: str
    people: Mapping[str, int]
    seed: int
    study: str = WELCH
    missing: float = 0.0
    left: float = 0.0  # share of participants who left
    person_sd: float = 10.0
    residual_sd: float = 15.0
    tom: float = 12.0  # points
    answers: float = 0.8  # points of the answer scale
    tied: int = 1  # rewards are multiples of it
    factors: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # between people: a condition a combination
    within: tuple[str, ...] = ()  # levels of `prediction`, in blocks of rounds; a condition is an order of them
    change: Callable[[pl.DataFrame], pl.DataFrame] | None = None  # of the answers


def _separated(answers: pl.DataFrame) -> pl.DataFrame:
    """Return all answers with ToM above all others."""
    value = pl.when(pl.col("condition") == "tom").then(pl.col("value").clip(5, 7)).otherwise(pl.col("value").clip(1, 4))
    return answers.with_columns(value=value)


THREE = ("none", "random", "tom")
FACTORS = {"prediction": ("none", "tom"), "opacity": ("off", "half", "on")}
CROSSED = [f"{one}_{other}" for one, other in product(*FACTORS.values())]
BLOCKS = "cells: {within: [prediction]}\nprimary: {effect: [prediction]}\n"
CASES = (
    Case("balanced", dict.fromkeys(THREE, 12), 1),
    Case(
        "unbalanced", dict(zip(THREE, (9, 17, 12), strict=True)), 2, missing=0.12, left=0.15,
        study=DECLARED.format(how="test: student, direction: greater, layouts: [double_rings, clear_division]"),
    ),
    Case(
        "no_person_variance", dict.fromkeys(THREE, 10), 3, left=0.03, person_sd=0.0, residual_sd=25.0, missing=0.05,
        study=DECLARED.format(how="test: mann_whitney"),
    ),
    Case(
        "tied", dict.fromkeys(("none", "tom"), 40), 4, tied=20, tom=16.0, left=0.2,
        study=DECLARED.format(how="test: mann_whitney, direction: less, looks: [20, 40, 80], agents: [sp]"),
    ),
    Case(
        "few", dict.fromkeys(("none", "tom"), 5), 5, left=0.15,
        study=DECLARED.format(how="test: mann_whitney, measure: efficiency"),
    ),
    Case("separated", dict.fromkeys(THREE, 8), 6, change=_separated, study=DECLARED.format(
        how="test: welch, looks: [10, 15, 30], spending: pocock")),
    Case(
        "crossed", dict(zip(CROSSED, (6, 8, 5, 9, 7, 4), strict=True)), 7, factors=FACTORS, missing=0.05,
        study="primary: {effect: [prediction, opacity]}\n",
    ),
    Case(
        "blocks", {"order_1": 9, "order_2": 7}, 8, within=("none", "tom"), left=0.1,
        study="factors: {prediction: [none, tom]}\n" + BLOCKS,
    ),
    Case(
        "three_blocks", {"order_1": 8, "order_2": 11}, 9, within=("none", "half", "tom"), missing=0.05,
        study="factors: {prediction: [none, half, tom]}\n" + BLOCKS,
    ),
)  # fmt: skip


def write_case(case: Case, folder: Path) -> None:
    """Write the export of a case: CSV tables, and its study file."""
    generator = np.random.default_rng(case.seed)
    participants = _participants(case, generator)
    episodes = _episodes(case, participants, generator)
    answers = _answers(case, episodes, generator)
    answers = case.change(answers) if case.change else answers
    tables = {
        "participants": participants,
        "episodes": episodes.drop("talent", strict=False),
        "answers": answers.drop("condition"),
        "ticks": _ticks(episodes, generator),
    }
    (folder / "data").mkdir(parents=True)
    (folder / "studies").mkdir()
    for name, table in tables.items():
        table.write_csv(folder / "data" / f"description-{name}_data.csv")
    text = HEAD + _factors(case) + case.study
    (folder / "studies" / "simulated_version-1.yaml").write_text(text, encoding="utf-8")
    (folder / "about.json").write_text(json.dumps({"simulated": True, "layouts": LAYOUTS}), encoding="utf-8")


def _factors(case: Case) -> str:
    return "" if not case.factors else "factors: " + json.dumps({k: list(v) for k, v in case.factors.items()}) + "\n"


def _participants(case: Case, generator: np.random.Generator) -> pl.DataFrame:
    conditions = [name for name, count in case.people.items() for _ in range(count)]
    left = generator.random(len(conditions)) < case.left * np.array([1 + (name == "none") for name in conditions])
    table = pl.DataFrame(
        {
            "participant": [f"p{number:03d}" for number in range(len(conditions))],
            "study": "simulated",
            "study_version": 1,
            "condition": conditions,
            "status": ["timed_out" if gone else "completed" for gone in left],
            "simulated": True,
        }
    )
    for index, name in enumerate(case.factors):
        table = table.with_columns(pl.col("condition").str.split("_").list.get(index).alias(f"factor_{name}"))
    return table


def _episodes(case: Case, participants: pl.DataFrame, generator: np.random.Generator) -> pl.DataFrame:
    rows = []
    for person, condition, status in participants.select("participant", "condition", "status").iter_rows():
        talent = generator.normal(0, case.person_sd)
        places = [(layout, agent) for layout in LAYOUTS for agent in AGENTS] * max(1, len(case.within))
        order = generator.permutation(len(places)) if not case.within else np.arange(len(places))
        for number, place in enumerate(order, start=1):
            layout, agent = places[place]
            block = (number - 1) * len(case.within) // len(places)
            level = case.within[:: -1 if condition == "order_2" else 1][block] if case.within else ""
            shown = level == "tom" if case.within else condition.startswith("tom")
            mean = 80 + 10 * LAYOUTS.index(layout) + 14 * AGENTS.index(agent) + talent + 1.5 * number
            mean += case.tom * shown * (0.3 + 0.35 * LAYOUTS.index(layout)) + 5 * condition.endswith("half")
            reward = max(0.0, round(generator.normal(mean, case.residual_sd) / case.tied, 1 if case.tied == 1 else 0))
            unfinished = generator.random() < case.missing or (status != "completed" and number > 5)
            rows.append(
                (f"{person}e{number:02d}", person, condition, layout, agent, number, reward * case.tied,
                 "aborted" if unfinished else "done", level, talent)
            )  # fmt: skip
    names = (
        "episode",
        "participant_0",
        "condition",
        "layout",
        "agent_1",
        "number",
        "score",
        "status",
        "level",
        "talent",
    )
    table = pl.DataFrame(rows, schema=names, orient="row").with_columns(
        participant_1=pl.lit(None, pl.String), agent_0=pl.lit(None, pl.String), watched_seat=1,
        kind=pl.lit("episode"), progress=0.0, horizon=400, tick_ms=200,
    )  # fmt: skip
    return table.rename({"level": "factor_prediction"}) if case.within else table.drop("level")


def _answers(case: Case, episodes: pl.DataFrame, generator: np.random.Generator) -> pl.DataFrame:
    rows = []
    mood: dict[str, float] = {}
    for episode, person, condition, number in (
        episodes.filter(pl.col("status") == "done")
        .select("episode", "participant_0", "condition", "number")
        .iter_rows()
    ):
        leaning = mood.setdefault(person, generator.normal(4.6, 0.7 if case.person_sd else 0.0))
        for question in (*QUESTIONS, *(ITEMS if number == 8 else ())):
            points, sign = (5 if question in ITEMS else 7), ITEMS.get(question, 1)
            value = generator.normal(leaning * points / 7 + case.answers * condition.startswith("tom"), 1.2)
            value = value if sign == 1 else points + 1 - value
            rows.append((person, condition, episode, question, int(np.clip(round(value), 1, points)), "after"))
    names = ("participant", "condition", "episode", "question", "value", "step")
    return pl.DataFrame(rows, schema=names, orient="row").with_columns(value_type=pl.lit("number"))


def _ticks(episodes: pl.DataFrame, generator: np.random.Generator) -> pl.DataFrame:
    """Return ticks with random actions; as few timesteps as let the rules of quality flag some episodes."""
    length = 20
    count = episodes.height * length
    idle = np.repeat(generator.random(episodes.height) < 0.06, length)
    columns: dict[str, object] = {
        "episode": np.repeat(episodes["episode"].to_numpy(), length),
        "timestep": np.tile(np.arange(length), episodes.height),
        "action_0": np.where(
            idle, np.where(np.arange(count) % length < 2, 5, 4), np.where(generator.random(count) < 0.5, 5, 0)
        ),
        "action_1": generator.integers(0, 6, count),
        "late": np.zeros(count, dtype=bool),
    }
    columns |= {f"predicted_{step}": generator.integers(0, 6, count) for step in (1, 2, 3)}
    return pl.DataFrame(columns)
