"""Answers: which are accepted, which are refused and why."""

import pytest

from server.study.answer_checks import AnswerError, check_answers
from server.study.loader import parse_study
from server.study.questionnaire import TextQuestion, asked, is_attentive, is_correct
from tests.support.study_text import SMALL_STUDY

STUDY = parse_study(SMALL_STUDY).study
QUESTIONS = STUDY.questions("everything")
GOOD = {
    "mood": ["4"], "check": ["2"], "pick": ["tea"], "many": ["a", "c"], "years": ["30"],
    "rank.x": ["3"], "rank.y": ["1"], "rank.z": ["2"],
}  # fmt: skip


def test_good_answers_are_taken_as_what_they_mean() -> None:
    checked = check_answers(QUESTIONS, GOOD | {"words": [" hello "]})
    assert checked.faults == {}
    assert checked.answers == {
        "mood": 4, "check": 2, "pick": "tea", "many": ["a", "c"], "words": " hello ", "years": 30,
        "rank": ["y", "z", "x"],
    }  # fmt: skip


WORDS = (
    "　二つの　スペース",
    "a\u00a0b\u202fc",
    "\U0001fae9 \U0001f468\u200d\U0001f373 \u2764\ufe0f",
    "line one\nline two\tend",
    "\u200fעברית\u200e",
    "\ue000 \u0378 \U000e0041",
    "  indented\n\tand more  \n\n",
)


@pytest.mark.parametrize("words", WORDS)
def test_words_are_kept_as_they_were_written(words: str) -> None:
    question = TextQuestion.model_validate({"key": "words", "type": "text", "text": "Words"})
    assert check_answers((question,), {"words": [words]}).answers == {"words": words}


@pytest.mark.parametrize("control", ["\x00", "\x07", "\x0b", "\x1f", "\x7f", "\x92"])
def test_control_character_is_refused_and_not_removed(control: str) -> None:
    question = TextQuestion.model_validate({"key": "words", "type": "text", "text": "Words", "required": False})
    checked = check_answers((question,), {"words": [f"before{control}after"]})
    assert checked.faults == {"words": AnswerError("control", {"before": "before"})}


@pytest.mark.parametrize("blank", [" ", "\u3000", "\u00a0\n", "\ufeff"])
def test_blank_text_is_not_an_answer(blank: str) -> None:
    question = TextQuestion.model_validate({"key": "words", "type": "text", "text": "Words"})
    assert check_answers((question,), {"words": [blank]}).faults["words"].reason == "missing_text"


def test_optional_question_may_stay_open() -> None:
    assert "words" not in check_answers(QUESTIONS, GOOD).answers


@pytest.mark.parametrize(
    ("change", "key", "reason"),
    [
        ({"mood": []}, "mood", "missing_scale"),
        ({"mood": ["0"]}, "mood", "missing_scale"),
        ({"mood": ["8"]}, "mood", "missing_scale"),
        ({"mood": ["-1"]}, "mood", "missing_scale"),
        ({"mood": ["3.5"]}, "mood", "missing_scale"),
        ({"mood": ["４"]}, "mood", "missing_scale"),
        ({"mood": ["4", "5"]}, "mood", "several"),
        ({"pick": ["coffee"]}, "pick", "missing_choice"),
        ({"many": []}, "many", "missing_multiple"),
        ({"many": ["a", "b", "c"]}, "many", "missing_multiple"),
        ({"many": ["a", "q"]}, "many", "missing_choice"),
        ({"words": ["x" * 21]}, "words", "long"),
        ({"years": ["17"]}, "years", "missing_number"),
        ({"years": ["nan"]}, "years", "missing_number"),
        ({"years": ["inf"]}, "years", "missing_number"),
        ({"years": ["9" * 40]}, "years", "missing_number"),
        ({"years": ["old"]}, "years", "missing_number"),
        ({"years": ["30.5"]}, "years", "whole"),
        ({"rank.x": ["1"]}, "rank", "missing_ranking"),
        ({"rank.z": [""]}, "rank", "missing_ranking"),
    ],
)
def test_wrong_answer_is_refused_with_its_reason_and_the_others_are_kept(
    change: dict[str, list[str]], key: str, reason: str
) -> None:
    checked = check_answers(QUESTIONS, GOOD | change)
    assert {name: fault.reason for name, fault in checked.faults.items()} == {key: reason}
    assert key not in checked.answers
    assert len(checked.answers) >= 5


def test_question_about_the_predictor_is_asked_where_one_is_shown() -> None:
    after = STUDY.questions("after")
    assert [question.key for question in asked(after, "without", False)] == ["partner"]
    assert [question.key for question in asked(after, "with", True)] == ["partner", "marks"]


def test_question_for_named_conditions_is_asked_in_these_only() -> None:
    text = SMALL_STUDY.replace("conditions: with_predictor", "conditions: [without]")
    after = parse_study(text).study.questions("after")
    assert [question.key for question in asked(after, "without", False)] == ["partner", "marks"]
    assert [question.key for question in asked(after, "with", True)] == ["partner"]


def test_attention_check_is_passed_failed_or_none() -> None:
    mood, check = QUESTIONS[0], QUESTIONS[1]
    assert is_attentive(check, 2) is True
    assert is_attentive(check, 5) is False
    assert is_attentive(mood, 5) is None


def test_quiz_question_is_correct_with_its_answer_only() -> None:
    question = STUDY.questions("quiz")[0]
    assert is_correct(question, "three")
    assert not is_correct(question, "two")
    assert not is_correct(question, None)
