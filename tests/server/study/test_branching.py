"""`when`: which answers a page or question may depend on (errors have place and remedy), and whether it holds."""

import pytest

from server.settings import ROOT
from server.study.branching import When
from server.study.loader import StudyError, parse_study
from server.study.schema import study_schema
from tests.support.study_text import BRANCHED


@pytest.mark.parametrize(
    ("given", "holds"),
    [("milk", True), ("tea", False), (["tea", "milk"], True), (["tea"], False), (3, True), (4, False), (None, False)],
)
def test_one_of_the_answers_is_enough(given: object, holds: bool) -> None:
    when = When(question="drink", one_of=("milk", "3"))
    assert when.holds({"about": {"drink": given}}) == holds
    assert not when.holds({"about": {"other": "milk"}}), "who was not asked has given none of the answers"
    assert when.holds(None), "a preview shows everything"


PICK, MOOD = "question: pick, one_of: [milk]", "question: mood, one_of: [6, 7]"
SUGAR, MORE = "questionnaires.more.questions.1.when", "questionnaires.more.when"
WRONG = [
    (
        PICK,
        "question: pik, one_of: [milk]",
        f"{SUGAR}.question: there is no question 'pik'. Known on earlier pages: mood,",
    ),
    (
        PICK,
        "question: partner, one_of: [1]",
        f"{SUGAR}.question: 'partner' is asked after every round. Name a question",
    ),
    (PICK, "question: pick, one_of: [mlk]", f"{SUGAR}.one_of.0: 'pick' has no answer 'mlk'. Known: tea, milk."),
    (MOOD, "question: mood, one_of: [8]", f"{MORE}.one_of.0: 'mood' has no answer '8'. Known: 1, 2,"),
    (MOOD, "question: sugar, one_of: [much]", f"{MORE}.question: 'sugar' is not asked before this page. Ask it on"),
    (
        MOOD,
        "question: words, one_of: [yes]",
        f"{MORE}.one_of: nothing can depend on 'words', which is a text question.",
    ),
    (MOOD, "question: mood, one_of: []", f"{MORE}.one_of: there are too few. Write at least 1."),
    ("flow: [everything, more,", "flow: [more, everything,", f"{MORE}.question: 'mood' is not asked before this page"),
    (
        "  attempts: 3\n",
        "  attempts: 3\n  when: {question: mood, one_of: [1]}\n",
        "quiz.when: everybody takes the quiz, so `when` has no place in it. Remove `when`.",
    ),
    (
        "      correct: three\n",
        "      correct: three\n      when: {question: mood, one_of: [1]}\n",
        "quiz.questions.0.when: everybody takes the quiz, so `when` has no place in it. Remove `when`.",
    ),
    (
        "after_episode: after\n",
        "after_episode: after\ndebriefing: goodbye\n",
        "pages.goodbye.when: everybody who was misled reads the debriefing. Remove `when`.",
    ),
]


@pytest.mark.parametrize(("old", "new", "words"), WRONG)
def test_an_answer_that_cannot_be_given_before_is_refused(old: str, new: str, words: str) -> None:
    assert old in BRANCHED
    with pytest.raises(StudyError) as caught:
        parse_study(BRANCHED.replace(old, new, 1), "small.yaml")
    assert any(f": {words}" in line for line in caught.value.lines), caught.value.lines


def test_a_question_asked_on_two_pages_is_ambiguous() -> None:
    text = BRANCHED.replace("key: sweet", "key: pick")
    with pytest.raises(StudyError) as caught:
        parse_study(text)
    assert "'pick' is asked in everything and in more. Give the questions keys of their own." in caught.value.lines[0]


def test_a_conditional_question_is_not_a_primary_measure() -> None:
    text = BRANCHED.replace(
        "- {key: partner, type: scale,", "- {key: partner, when: {question: pick, one_of: [tea]}, type: scale,"
    )
    with pytest.raises(StudyError) as caught:
        parse_study(text + "primary: {comparison: [with, without], measure: partner}\n")
    assert "'partner' is not measured after every episode in both conditions" in caught.value.lines[0]


def test_neither_the_schema_nor_the_reference_offers_a_quiz_for_some() -> None:
    assert "when" not in study_schema()["$defs"]["Quiz"]["properties"]
    page = (ROOT / "docs" / "reference" / "study_keys" / "questionnaires.md").read_text("utf-8")
    assert "`quiz.when`" not in page
    assert "## `questionnaires.NAME.when`" in page
