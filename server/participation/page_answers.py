"""Check the answers of one page: valid, right (quiz), and attentive (attention checks)."""

from collections.abc import Mapping

from server.store.participants import Participant
from server.study.answer_checks import AnswerError, Checked, check_answers
from server.study.definition import Study
from server.study.questionnaire import asked, is_attentive, is_correct
from server.study.steps import StudyStep


def check_page(
    study: Study, participant: Participant, step: StudyStep, form: Mapping[str, list[str]]
) -> tuple[Checked, dict[str, bool]]:
    """Return the answers of a page with questions, and whether each attention check among them was passed."""
    if not step.asks:
        return Checked({}, {}), {}
    condition = study.condition(participant.condition)
    questions = asked(study.questions(step.asks), condition.name, study.shows_predictions(condition))
    checked = check_answers(questions, form)
    checks = {question.key: is_attentive(question, checked.answers.get(question.key)) for question in questions}
    attention = {key: passed for key, passed in checks.items() if passed is not None and key in checked.answers}
    if step.kind == "quiz" and not checked.faults:
        wrong = {q.key: AnswerError("wrong", {}) for q in questions if not is_correct(q, checked.answers.get(q.key))}
        checked = Checked(checked.answers, wrong)
    return checked, attention
