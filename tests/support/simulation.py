"""Simulated studies without files, and the report's sentences about them: for many studies at a time."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import polars as pl

from analysis import apa_text, mixed_model, questionnaires
from analysis.groups import main_contrast
from analysis.results import Result
from analysis.simulated_participants import PEOPLE
from analysis.study import MEASURE, AnalysisDesign
from analysis.study import reward_tests as reward_tests_of

CONDITIONS = ("none", "random", "tom")
LAYOUTS = ("coordination_ring", "double_rings", "double_counters", "matrix", "clear_division")
LEVELS = np.array([78.0, 65.0, 55.0, 74.0, 119.0])  # mean rewards of the layouts
AGENTS = ("sp", "fcp")
QUESTIONS = ("partner_satisfaction", "situational_awareness", "efficiency")


@dataclass(frozen=True)
class World:
    """The true parameters. `effect`: points that ToM adds, for each layout; `answers`: points of the scale that it
    adds."""

    arm: int = 29
    effect: tuple[float, ...] = (0.0,) * 5
    answers: float = 0.0
    person_sd: float = 20.0
    residual_sd: float = 25.0
    missing: float = 0.01


def episodes_of(world: World, seed: int) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Episodes with rewards (never below zero), and answers 1 to 7 with every person's own leaning."""
    generator = np.random.default_rng(seed)
    people = world.arm * len(CONDITIONS)
    shape = (people, len(LAYOUTS), len(AGENTS))
    tom = np.repeat(CONDITIONS, world.arm) == "tom"
    reward = generator.normal(0, world.residual_sd, shape) + LEVELS[:, None] + 16 * np.arange(2)
    reward += generator.normal(0, world.person_sd, people)[:, None, None]
    reward += tom[:, None, None] * np.array(world.effect)[:, None]
    leaning = generator.normal(4.2, 0.6, people) + world.answers * tom
    said = leaning[:, None, None, None] + generator.normal(0, 1.1, (len(QUESTIONS), *shape)).transpose(1, 2, 3, 0)
    kept = (generator.random(shape) >= world.missing).ravel()
    places = np.indices(shape).reshape(3, -1)
    table = pl.DataFrame(
        {
            "episode": [f"e{index}" for index in range(kept.size)],
            "participant": [f"p{index:04d}" for index in places[0]],
            "condition": np.repeat(CONDITIONS, world.arm)[places[0]],
            "layout": np.array(LAYOUTS)[places[1]],
            "agent": np.array(AGENTS)[places[2]],
            "reward": np.maximum(0.0, reward.round(0)).ravel(),
        }
    ).with_columns(watched_person=pl.lit(None, pl.String))
    answers = [
        table.select(
            "episode", "participant", "condition", "layout", "agent",
            question=pl.lit(question), value=pl.Series(np.clip(said[..., index].round(), 1, 7).ravel()),
        )
        for index, question in enumerate(QUESTIONS)
    ]  # fmt: skip
    keep = pl.Series(kept)
    return table.filter(keep), pl.concat([one.filter(keep) for one in answers])


@dataclass(frozen=True)
class ReportText:
    """The headlines and sentences about one study, and the rows that they are made of."""

    findings: list[str]
    sentences: list[str]
    rows: tuple[Result, ...]


def report_text(world: World, seed: int, draws: int = 200) -> ReportText:
    """What the report says of one simulated study, by the report's own code."""
    episodes, answers = episodes_of(world, seed)
    return report_text_of(episodes, answers, seed, draws)


def report_text_of(episodes: pl.DataFrame, answers: pl.DataFrame, seed: int = 1, draws: int = 200) -> ReportText:
    """What the report says of these episodes and answers, without flow, accuracy and figures."""
    design = AnalysisDesign(CONDITIONS, LAYOUTS, AGENTS, main_contrast(CONDITIONS))
    model = mixed_model.fit(episodes, MEASURE, CONDITIONS)
    rows = (
        Result("exclusions", "analysed", condition="all", unit="people", n=episodes["participant"].n_unique()),
        *reward_tests_of(episodes, design, draws, seed),
        *model.rows,
        *questionnaires.rows(answers, CONDITIONS, AGENTS),
    )
    analysis = SimpleNamespace(
        rows=rows,
        model=model,
        episodes=episodes,
        conditions=CONDITIONS,
        agents=AGENTS,
        contrast=design.contrast,
        layouts=LAYOUTS,
        questionnaire_layouts=LAYOUTS[:4],
        subjects=PEOPLE,
        within=(),
    )
    return ReportText(apa_text.findings(analysis), apa_text.sentences(analysis), rows)  # type: ignore[arg-type]
