"""Simulated exports with known effects: for tests and for trying a report before there is a study, never as a finding.
It writes the same files and columns as `kitchenmind export`, marked as `simulated`.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import polars as pl

from analysis.tables import ACTIONS, AGENTS, CONDITIONS, LAYOUTS, STEPS

SOUP = 20
BASELINE = {  # mean reward by layout, invented
    "coordination_ring": 78.0,
    "double_rings": 65.0,
    "double_counters": 55.0,
    "matrix": 74.0,
    "clear_division": 119.0,
}
ACCURACY = {"sp": (0.80, 0.72, 0.66), "fcp": (0.88, 0.80, 0.74)}
QUESTIONS = ("partner_satisfaction", "predictor_satisfaction", "situational_awareness", "efficiency")


@dataclass(frozen=True)
class Truth:
    """The true parameters of the simulation. Effects are points of reward and points of the answer scale against
    none."""

    participants: int = 29  # in each condition
    conditions: tuple[str, ...] = CONDITIONS
    layouts: tuple[str, ...] = LAYOUTS
    agents: tuple[str, ...] = AGENTS
    reward_effect: Mapping[str, float] = field(default_factory=dict)  # by condition
    answer_effect: Mapping[str, float] = field(default_factory=dict)  # by condition, all questions
    agent_bonus: float = 16.0  # of every agent over the one before
    person_sd: float = 8.0
    residual_sd: float = 14.0
    accuracy: Mapping[str, tuple[float, ...]] = field(default_factory=lambda: dict(ACCURACY))  # of the steps, by agent
    timesteps: int = 400
    broken: float = 0.011  # share of episodes that the researcher removes
    seed: int = 1


def write_export(truth: Truth, folder: Path) -> None:
    """Write the simulated study as Parquet files and about.json into `folder`, which is created."""
    folder.mkdir(parents=True, exist_ok=True)
    generator = np.random.default_rng(truth.seed)
    participants = _participants(truth)
    episodes = _episodes(truth, participants, generator)
    tables = {
        "participants": participants,
        "episodes": episodes,
        "answers": _answers(truth, episodes, generator),
        "ticks": _ticks(truth, episodes, generator),
    }
    for name, table in tables.items():
        table.write_parquet(folder / f"{name}.parquet")
    about = {"title": "Simulated study", "simulated": True, "seed": truth.seed, "offline_accuracy": _offline(truth)}
    (folder / "about.json").write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")


def _offline(truth: Truth) -> dict[str, dict[str, list[float]]]:
    better = {agent: [min(1.0, share + 0.04) for share in truth.accuracy[agent]] for agent in truth.agents}
    return {agent: dict.fromkeys(truth.layouts, shares) for agent, shares in better.items()}


def _participants(truth: Truth) -> pl.DataFrame:
    conditions = [name for _ in range(truth.participants) for name in truth.conditions]
    return pl.DataFrame(
        {
            "participant": [f"p{number:05d}" for number in range(len(conditions))],
            "study": "simulated",
            "condition": conditions,
            "status": "completed",
            "simulated": True,
        }
    )


def _episodes(truth: Truth, participants: pl.DataFrame, generator: np.random.Generator) -> pl.DataFrame:
    """Return episodes in which everybody plays every layout with every agent: reward = layout + agent + condition +
    person + noise."""
    rows = []
    for person, condition in participants.select("participant", "condition").iter_rows():
        talent = generator.normal(0, truth.person_sd)
        for number, (layout, agent) in enumerate([(x, y) for x in truth.layouts for y in truth.agents], start=1):
            mean = BASELINE.get(layout, 70.0) + truth.agent_bonus * truth.agents.index(agent)
            mean += talent + truth.reward_effect.get(condition, 0.0)
            reward = max(0.0, round(generator.normal(mean, truth.residual_sd), 1))
            removed = "technical fault" if generator.random() < truth.broken else ""
            rows.append((f"{person}e{number:02d}", person, condition, layout, agent, number, reward, removed))
    names = ["episode", "participant_0", "condition", "layout", "agent_1", "number", "reward", "excluded"]
    score = (pl.col("reward") // SOUP) * SOUP
    return (
        pl.DataFrame(rows, schema=names, orient="row")
        .with_columns(
            score=score,
            progress=(pl.col("reward") - score).round(1),
            soups=score // SOUP,
            participant_1=pl.lit(None, dtype=pl.String),
            agent_0=pl.lit(None, dtype=pl.String),
            watched_seat=1,
            kind=pl.lit("episode"),
            status=pl.lit("done"),
            horizon=truth.timesteps,
            tick_ms=200,
        )
        .drop("reward")
    )


def _answers(truth: Truth, episodes: pl.DataFrame, generator: np.random.Generator) -> pl.DataFrame:
    rows = []
    mood: dict[str, float] = {}
    for episode, person, condition in episodes.select("episode", "participant_0", "condition").iter_rows():
        leaning = mood.setdefault(person, generator.normal(4.2, 0.6))
        for question in QUESTIONS:
            if question == "predictor_satisfaction" and condition == "none":
                continue
            answer = generator.normal(leaning + truth.answer_effect.get(condition, 0.0), 1.1)
            rows.append((person, episode, question, int(np.clip(round(answer), 1, 7))))
    answers = pl.DataFrame(rows, schema=["participant", "episode", "question", "value"], orient="row")
    return answers.with_columns(value=pl.col("value").cast(pl.String), value_type=pl.lit("number"))


def _ticks(truth: Truth, episodes: pl.DataFrame, generator: np.random.Generator) -> pl.DataFrame:
    """Return ticks with random actions and predictions that are right as often as the truth says."""
    games, length = episodes.height, truth.timesteps
    actions = generator.integers(0, ACTIONS, (2, games, length), dtype=np.int8)  # (seats, games, timesteps)
    columns = {
        "episode": np.repeat(episodes["episode"].to_numpy(), length),
        "timestep": np.tile(np.arange(length), games),
        "action_0": actions[0].ravel(),
        "action_1": actions[1].ravel(),
        "late": np.zeros(games * length, dtype=bool),
        "late_ms": generator.exponential(0.4, games * length).round(2),
    }
    for step in range(1, STEPS + 1):
        coming = np.full((games, length), 4, dtype=np.int8)
        coming[:, : length + 1 - step] = actions[1, :, step - 1 :]
        wrong = (coming + generator.integers(1, ACTIONS, coming.shape)) % ACTIONS
        share = np.array([truth.accuracy[agent][step - 1] for agent in episodes["agent_1"]])
        right = generator.random(coming.shape) < share[:, None]
        columns[f"predicted_{step}"] = np.where(right, coming, wrong).astype(np.int8).ravel()
    return pl.DataFrame(columns)
