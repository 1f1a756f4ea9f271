"""Check that the planned analysis of a study file fits the study. Pure: yields problems."""

from collections.abc import Iterator, Sequence
from typing import Any

from server.study.analysis_plan import PrimaryTest
from server.study.checks import Path, Problem
from server.study.definition import Condition, Study
from server.study.questionnaire import ScaleQuestion, asked
from server.study.quick_fixes import leave_out


def plan_problems(study: Study) -> Iterator[Problem]:
    """Yield everything wrong with the primary test and the smallest effects of a study whose single values are
    valid."""
    yield from _primary(study)
    yield from _smallest_effect(study)


def _primary(study: Study) -> Iterator[Problem]:
    """Check that the study has what the primary test is about."""
    primary = study.primary
    if primary is None:
        return
    yield from _compared(study, primary)
    yield from _known_once(study.layouts, primary.layouts, ("primary", "layouts"), "layout")
    yield from _known_once(study.agents, primary.agents, ("primary", "agents"), "agent")
    wanted = primary.comparison or [condition.name for condition in study.conditions]
    conditions = [condition for condition in study.conditions if condition.name in wanted]
    measures = [set(_measures(study, seen)) for condition in conditions for seen in condition.displays]
    if any(primary.measure not in names for names in measures):
        known = ", ".join(["reward", *sorted(set.intersection(*measures) - {"reward"})])
        which = "all" if primary.effect else "both"
        reason = f"{primary.measure!r} is not measured after every episode in {which} conditions"
        yield Problem(("primary", "measure"), reason, f"Known: {known}.")
    yield from _looks(primary.looks, [condition.quota for condition in conditions])


def _compared(study: Study, primary: PrimaryTest) -> Iterator[Problem]:
    """Check that two conditions or an effect of factors are compared, with a suitable test."""
    if bool(primary.comparison) == bool(primary.effect):
        reason = (
            "it names both two conditions and an effect"
            if primary.effect
            else "it has neither `comparison` nor `effect`"
        )
        remedy = "Write either `comparison: [A, B]` with two conditions, or `effect: [FACTOR]`."
        yield Problem(("primary",), reason, remedy)
    if primary.comparison and study.cells.within:
        reason = "the conditions are orders of blocks: what is compared lies within people"
        yield Problem(("primary", "comparison"), reason, f"Name an effect: `effect: [{study.cells.within[0]}]`.")
        return
    yield from _known_once(study.conditions, primary.comparison, ("primary", "comparison"), "condition")
    if primary.effect:
        yield from _effect(study, primary)
    elif primary.test == "anova":
        remedy = "Use welch, student or mann_whitney, or name an `effect`."
        yield Problem(("primary", "test"), "`anova` tests an effect of factors, not two conditions", remedy)


def _effect(study: Study, primary: PrimaryTest) -> Iterator[Problem]:
    for index, name in enumerate(primary.effect):
        if name not in study.factors:
            known = f"Known: {', '.join(study.factors)}." if study.factors else "Declare `factors`, or compare two."
            yield Problem(("primary", "effect", index), f"there is no factor {name!r}", known)
        if name in primary.effect[:index]:
            yield Problem(("primary", "effect", index), f"{name!r} occurs twice", "Name each once.")
    if study.cells.without:
        reason = f"effects cannot be separated, as the study leaves out {', '.join(study.cells.without)}"
        yield Problem(("primary", "effect"), reason, "Remove `cells.without`, or compare two conditions.")
    if primary.test != "anova":
        yield Problem(("primary", "test"), f"an effect of factors has no {primary.test}", "Remove `test`.")
    if primary.looks:
        reason = "an effect of factors is tested once, at the end"
        yield Problem(("primary", "looks"), reason, "Remove `looks`, or compare two conditions.")
    many = [name for name in primary.effect if len(study.factors.get(name, ())) > 2]
    if many and primary.direction != "two_sided":
        reason = f"an effect of {many[0]}, which has more than two levels, has no direction"
        yield Problem(("primary", "direction"), reason, "Remove `direction`.")


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
    if study.cells.within:
        reason = "the report tests no equivalence, as the conditions are orders of blocks"
        yield Problem(("smallest_effect",), reason, "Remove `smallest_effect`, or `cells.within`.", warning=True)


def _measures(study: Study, seen: Condition) -> Iterator[str]:
    """Return what can be compared between conditions: reward, and the scale questions that follow every episode."""
    yield "reward"
    if study.after_episode in study.questionnaires:
        shows = study.shows_predictions(seen)
        for question in asked(study.questions(str(study.after_episode)), seen.name, shows):
            always = question.when is None and study.questionnaires[str(study.after_episode)].when is None
            if isinstance(question, ScaleQuestion) and question.attention is None and always:
                yield question.key


def _known_once(parts: Sequence[Any], names: Sequence[str], path: Path, kind: str) -> Iterator[Problem]:
    known = [part.name for part in parts]
    for index, name in enumerate(names):
        fix = None if kind == "condition" else leave_out(f"Leave {name} out", (*path, index))
        if name not in known:
            yield Problem((*path, index), f"there is no {kind} {name!r}", f"Known: {', '.join(known)}.", fix=fix)
        if name in names[:index]:
            yield Problem((*path, index), f"{name!r} occurs twice", "Name each once.", fix=fix)
