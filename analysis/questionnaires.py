"""Answers of the questionnaires after an episode: means, and tests between conditions on chosen layouts, per agent.

A person answers after every episode, so beside the published t-test over answers stands the same test over people.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import polars as pl

from analysis import effects
from analysis.compare import adjust, pairs, samples, t_test
from analysis.results import Result

# The published questions, in short.
TITLES = {
    "partner_satisfaction": "Satisfied with partner",
    "predictor_satisfaction": "Satisfied with predictor",
    "situational_awareness": "Can predict the partner",
    "efficiency": "Efficiency of cooperation",
}


def title(question: str) -> str:
    """A question's short name for tables and figures."""
    return TITLES.get(question, question.replace("_", " ").capitalize())


def answers_on(answers: pl.DataFrame, episodes: pl.DataFrame, layouts: Sequence[str]) -> pl.DataFrame:
    """The answers about the given episodes on the chosen layouts, with condition, layout and agent beside."""
    chosen = episodes.filter(pl.col("layout").is_in(list(layouts)))
    return answers.select("episode", "question", "value").join(
        chosen.select("episode", "participant", "condition", "layout", "agent", "number"), on="episode"
    )


def questions(answers: pl.DataFrame) -> list[str]:
    """The questions as they were asked, known ones in the published order."""
    present = [str(name) for name in answers["question"].unique(maintain_order=True)]
    return sorted(present, key=lambda name: list(TITLES).index(name) if name in TITLES else len(TITLES))


def means(answers: pl.DataFrame, conditions: Sequence[str], agents: Sequence[str]) -> list[Result]:
    """Mean answer with standard error and 95 % interval for every question, agent and condition that was asked."""
    rows = []
    for question in questions(answers):
        for agent in agents:
            found = samples(answers, "value", conditions, question=question, agent=agent)
            for condition, values in found.items():
                if values.size:
                    mean = effects.mean_interval(values)
                    rows.append(
                        Result(
                            "questionnaire",
                            "mean",
                            "chosen",
                            agent,
                            condition=condition,
                            question=question,
                            estimate=mean.value,
                            estimate_low=mean.low,
                            estimate_high=mean.high,
                            se=effects.standard_error(values),
                            n=values.size,
                            unit="answers",
                            ci_level=mean.level,
                        )
                    )
    return rows


def tests(answers: pl.DataFrame, conditions: Sequence[str], agents: Sequence[str]) -> list[Result]:
    """t-tests between conditions for every question and agent: over answers as published (`t_test`), and over the mean
    of every person (`t_test_people`). Benjamini-Hochberg within the tests of one agent and kind."""
    people = answers.group_by("participant", "condition", "question", "agent", maintain_order=True).agg(
        pl.col("value").mean()
    )
    rows: list[Result] = []
    for agent in agents:
        for name, table, unit in (("t_test", answers, "answers"), ("t_test_people", people, "people")):
            family = []
            for question in questions(answers):
                found = samples(table, "value", conditions, question=question, agent=agent)
                for first, second in pairs(conditions):
                    if not _asked(found, first, second):
                        continue
                    base = Result("questionnaire", name, "chosen", agent, question=question, unit=unit)
                    base = replace(base, contrast=f"{first} - {second}")
                    family.append(t_test(base, found[first], found[second]))
            rows += adjust(family)
    return rows


def _asked(found: dict[str, "np.ndarray[tuple[int], np.dtype[np.float64]]"], first: str, second: str) -> bool:
    """False where one of the conditions was not asked: there is no predictor to be satisfied with."""
    return found[first].size > 0 and found[second].size > 0
