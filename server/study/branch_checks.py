"""Check that the answers on which pages and questions depend can be given before them. Pure: yields problems."""

from collections.abc import Iterator

from server.study.branching import When
from server.study.checks import Path, Problem
from server.study.definition import IN_QUIZ, Study
from server.study.questionnaire import AnyQuestion, ChoiceQuestion, MultipleQuestion, ScaleQuestion


def branch_problems(study: Study) -> Iterator[Problem]:
    """Yield everything wrong with `when` in a study whose single values are valid."""
    for path, when, before in _branches(study):
        yield from _problems(study, (*path, "when"), when, before)
    for index, of_question in enumerate(_of_questions(study.quiz)):
        if of_question is not None:
            yield Problem(("quiz", "questions", index, "when"), IN_QUIZ, "Remove `when`.")
    page = study.pages.get(study.debriefing or "")
    if page is not None and page.when is not None:
        place: Path = ("pages", str(study.debriefing), "when")
        yield Problem(place, "everybody who was misled reads the debriefing", "Remove `when`.")


def _of_questions(block: object) -> Iterator[When | None]:
    return (entry.when for entry in getattr(block, "questions", ()))


def _branches(study: Study) -> Iterator[tuple[Path, When, int]]:
    """Yield each `when`: its place in the file, and how many entries of the flow come before its page."""
    for block in ("pages", "questionnaires"):
        for key, part in getattr(study, block).items():
            entry = "episodes" if key == study.after_episode else key
            place = study.flow.index(entry) if entry in study.flow else len(study.flow)
            if part.when is not None:
                yield (block, key), part.when, place
            for index, when in enumerate(_of_questions(part)):
                if when is not None:
                    yield (block, key, "questions", index), when, place


def _problems(study: Study, path: Path, when: When, place: int) -> Iterator[Problem]:
    asked = {
        key: question
        for key in study.flow[:place]
        if key in study.questionnaires
        for question in study.questions(key)
        if question.key == when.question
    }
    if not asked:
        yield Problem((*path, "question"), *_not_before(study, when.question, place))
    elif len(asked) > 1:
        reason = f"{when.question!r} is asked in {' and in '.join(asked)}"
        yield Problem((*path, "question"), reason, "Give the questions keys of their own.")
    else:
        yield from _values((*path, "one_of"), when, next(iter(asked.values())))


def _not_before(study: Study, question: str, place: int) -> tuple[str, str]:
    """Return why the question does not come before, and the remedy."""
    after = study.questionnaires.get(study.after_episode or "")
    if after is not None and any(one.key == question for one in after.asks):
        return f"{question!r} is asked after every round", "Name a question of a page that comes once, before this one."
    if any(one.key == question for block in study.questionnaires.values() for one in block.asks):
        return f"{question!r} is not asked before this page", "Ask it on a page that comes earlier in `flow`."
    earlier = [one.key for key in study.flow[:place] if key in study.questionnaires for one in study.questions(key)]
    return f"there is no question {question!r}", f"Known on earlier pages: {', '.join(earlier) or 'none'}."


def _values(path: Path, when: When, question: AnyQuestion) -> Iterator[Problem]:
    match question:
        case ChoiceQuestion() | MultipleQuestion():
            known = [option.value for option in question.options]
        case ScaleQuestion():
            known = [str(value) for value in question.values]
        case _:
            reason = f"nothing can depend on {question.key!r}, which is a {question.type} question"
            yield Problem(path, reason, "Name a choice, multiple or scale question.")
            return
    for index, value in enumerate(when.one_of):
        if value not in known:
            yield Problem((*path, index), f"{question.key!r} has no answer {value!r}", f"Known: {', '.join(known)}.")
