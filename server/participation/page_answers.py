"""The questions of one page, and checks of its answers: valid, correct (quiz), attentive (attention checks)."""

from collections.abc import Mapping

from server.store.participants import Participant
from server.study.answer_checks import AnswerError, Checked, check_answers
from server.study.branching import EarlierAnswers, When
from server.study.definition import Study
from server.study.questionnaire import AnyQuestion, asked, asked_after, is_attentive, is_correct
from server.study.steps import StudyStep


def questions_of(
    study: Study, participant: Participant, step: StudyStep, earlier: EarlierAnswers | None
) -> tuple[AnyQuestion, ...]:
    """Return the questions that a participant with these earlier answers gets; none of a page without questions.
    `earlier` is None in a preview: questions that depend on an answer are shown."""
    if not step.asks:
        return ()
    condition = study.condition(participant.condition).at(step.block)
    questions = asked(study.questions(step.asks), condition.name, study.shows_predictions(condition))
    return asked_after(questions, earlier)


def is_shown(study: Study, participant: Participant, step: StudyStep, earlier: EarlierAnswers) -> bool:
    """Return whether a participant with these answers gets the page: what it depends on was answered, and where its
    questions depend on answers, one of them is asked."""
    when = _when(study, step)
    if when is not None and not when.holds(earlier):
        return False
    branches = step.kind == "questionnaire" and any(one.when is not None for one in study.questions(step.asks))
    return not branches or bool(questions_of(study, participant, step, earlier))


def not_asked(study: Study, participant: Participant, step: StudyStep, earlier: EarlierAnswers) -> list[str]:
    """Return the questions of a page that are not asked because of earlier answers, in order."""
    every = {question.key for question in questions_of(study, participant, step, earlier)}
    if not is_shown(study, participant, step, earlier):
        every = set()
    return [question.key for question in questions_of(study, participant, step, None) if question.key not in every]


def _when(study: Study, step: StudyStep) -> When | None:
    if step.kind == "questionnaire":
        return study.questionnaires[step.page].when
    return study.pages[step.page].when if step.kind == "page" else None


def check_page(
    study: Study, participant: Participant, step: StudyStep, form: Mapping[str, list[str]], earlier: EarlierAnswers
) -> tuple[Checked, dict[str, bool]]:
    """Return the answers of a page with questions, and whether each attention check among them was passed. `earlier`:
    the answers of earlier pages."""
    questions = questions_of(study, participant, step, earlier)
    if not questions:
        return Checked({}, {}), {}
    checked = check_answers(questions, form)
    checks = {question.key: is_attentive(question, checked.answers.get(question.key)) for question in questions}
    attention = {key: passed for key, passed in checks.items() if passed is not None and key in checked.answers}
    if step.kind == "quiz" and not checked.faults:
        wrong = {q.key: AnswerError("wrong", {}) for q in questions if not is_correct(q, checked.answers.get(q.key))}
        checked = Checked(checked.answers, wrong)
    return checked, attention
