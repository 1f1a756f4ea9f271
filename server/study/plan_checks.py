"""What must fit together in the planned analysis of a study file. Pure: yields problems."""

from collections.abc import Iterator, Sequence
from typing import Any

from server.study.checks import Path, Problem
from server.study.definition import Study
from server.study.questionnaire import ScaleQuestion, asked


def plan_problems(study: Study) -> Iterator[Problem]:
    """Everything wrong with the primary test and the smallest effects of a study whose single values are right."""
    yield from _primary(study)
    yield from _smallest_effect(study)


def _primary(study: Study) -> Iterator[Problem]:
    """The primary test must be about what the study has, or nobody could compute it."""
    primary = study.primary
    if primary is None:
        return
    yield from _known_once(study.conditions, primary.comparison, ("primary", "comparison"), "condition")
    yield from _known_once(study.layouts, primary.layouts, ("primary", "layouts"), "layout")
    yield from _known_once(study.agents, primary.agents, ("primary", "agents"), "agent")
    conditions = [condition for condition in study.conditions if condition.name in primary.comparison]
    measures = [set(_measures(study, condition.name)) for condition in conditions]
    if any(primary.measure not in names for names in measures):
        known = ", ".join(["reward", *sorted(set.intersection(*measures) - {"reward"})])
        reason = f"{primary.measure!r} is not measured after every episode in both conditions"
        yield Problem(("primary", "measure"), reason, f"Known: {known}.")
    yield from _looks(primary.looks, [condition.quota for condition in conditions])


def _looks(looks: Sequence[int], quotas: Sequence[int | None]) -> Iterator[Problem]:
    path = ("primary", "looks")
    if len(looks) == 1:
        yield Problem(path, "one look alone is the final test", "List two or more, or leave `looks` out.")
    if list(looks) != sorted(set(looks)):
        yield Problem(path, "the looks do not grow", "List the numbers of people from the first look to the last.")
    most = sum(quota or 0 for quota in quotas)
    if looks and None not in quotas and looks[-1] > most:
        reason = f"the last look is at {looks[-1]} people, and the quotas end at {most}"
        yield Problem(path, reason, "Lower the last look, or raise the quotas.")


def _smallest_effect(study: Study) -> Iterator[Problem]:
    smallest = study.smallest_effect
    if smallest is None:
        return
    yield from _known_once(study.layouts, smallest.layouts, ("smallest_effect", "layouts"), "layout")
    if smallest.reward is None and smallest.answers is None:
        yield Problem(("smallest_effect",), "no effect is set", "Add `reward: 5` or `answers: 0.5`, in points.")


def _measures(study: Study, condition: str) -> Iterator[str]:
    """What can be compared between conditions: reward, and the scale questions that follow every episode."""
    yield "reward"
    if study.after_episode in study.questionnaires:
        shows = study.shows_predictions(study.condition(condition))
        for question in asked(study.questions(str(study.after_episode)), condition, shows):
            if isinstance(question, ScaleQuestion) and question.attention is None:
                yield question.key


def _known_once(parts: Sequence[Any], names: Sequence[str], path: Path, kind: str) -> Iterator[Problem]:
    known = [part.name for part in parts]
    for index, name in enumerate(names):
        if name not in known:
            yield Problem((*path, index), f"there is no {kind} {name!r}", f"Known: {', '.join(known)}.")
        if name in names[:index]:
            yield Problem((*path, index), f"{name!r} is there twice", "Name each once.")
