"""Answers of the questionnaires after an episode: means, and tests between conditions on chosen layouts, per agent.

A person answers after every episode, so the same test over people stands next to the published t-test over answers.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import polars as pl

from analysis.compare import adjust, mean_row, t_test
from analysis.groups import Groups, pairs
from analysis.results import Result
from analysis.within_effects import level_columns

# The published questions, in short.
TITLES = {
    "partner_satisfaction": "Satisfied with partner",
    "predictor_satisfaction": "Satisfied with predictor",
    "situational_awareness": "Can predict the partner",
    "efficiency": "Efficiency of cooperation",
}


def title(question: str) -> str:
    """Return a question's short name for tables and figures."""
    return TITLES.get(question, question.replace("_", " ").capitalize())


def answers_on(answers: pl.DataFrame, episodes: pl.DataFrame, layouts: Sequence[str]) -> pl.DataFrame:
    """Return the answers that participants gave about their episodes on the chosen layouts, with condition, layout,
    agent and the levels that people met in blocks."""
    chosen = episodes.filter(pl.col("layout").is_in(list(layouts)))
    about = ("episode", "participant", "condition", "layout", "agent", "number", *level_columns(episodes))
    return answers.select("episode", "question", "value", "participant").join(
        chosen.select(about),
        on=["episode", "participant"],
    )


def questions(answers: pl.DataFrame) -> list[str]:
    """Return the questions as they were asked, known ones in the published order."""
    present = [str(name) for name in answers["question"].unique(maintain_order=True)]
    return sorted(present, key=lambda name: list(TITLES).index(name) if name in TITLES else len(TITLES))


def of_people(answers: pl.DataFrame) -> pl.DataFrame:
    """Return one row per person, question and agent with the mean of the person's answers."""
    keys = ("participant", "condition", "question", "agent")
    return answers.group_by(*keys, maintain_order=True).agg(pl.col("value").mean())


def _grouped(table: pl.DataFrame) -> Groups:
    """Return the answers by question (as the first key), agent and condition."""
    return Groups(table, "value", "question")


def rows(answers: pl.DataFrame, conditions: Sequence[str], agents: Sequence[str]) -> list[Result]:
    """Return means and tests of every question that was asked."""
    return [*means(answers, conditions, agents), *tests(answers, conditions, agents)]


def means(answers: pl.DataFrame, conditions: Sequence[str], agents: Sequence[str]) -> list[Result]:
    """Mean answer with standard error and 95 % interval for every question, agent and condition that was asked; over
    the means of people, as a person answers several times."""
    people = _grouped(of_people(answers))
    rows = []
    for question in questions(answers):
        for agent in agents:
            found = people.at(question, agent, conditions)
            base = Result("questionnaire", "mean", "chosen", agent, question=question, unit="people")
            rows += [mean_row(replace(base, condition=name), values) for name, values in found.items() if values.size]
    return rows


def tests(answers: pl.DataFrame, conditions: Sequence[str], agents: Sequence[str]) -> list[Result]:
    """Return t-tests between conditions for every question and agent. `t_test`: over answers as published,
    Benjamini-Hochberg within an agent. `t_test_people`: over the mean of every person, Benjamini-Hochberg over all of
    them."""
    published: list[Result] = []
    for agent in agents:
        published += adjust(_tests(answers, conditions, agent, Result("questionnaire", "t_test", unit="answers")))
    base, people = Result("questionnaire", "t_test_people", unit="people"), of_people(answers)
    return published + adjust([row for agent in agents for row in _tests(people, conditions, agent, base)])


def _tests(table: pl.DataFrame, conditions: Sequence[str], agent: str, base: Result) -> list[Result]:
    rows, groups = [], _grouped(table)
    for question in questions(table):
        found = groups.at(question, agent, conditions)
        for first, second in pairs(conditions):
            if _asked(found, first, second):
                row = replace(base, layout="chosen", agent=agent, question=question, contrast=f"{first} - {second}")
                rows.append(t_test(row, found[first], found[second]))
    return rows


def _asked(found: dict[str, "np.ndarray[tuple[int], np.dtype[np.float64]]"], first: str, second: str) -> bool:
    """Return false if one of the conditions did not get the question, such as one about the predictor."""
    return found[first].size > 0 and found[second].size > 0
