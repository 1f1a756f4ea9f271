"""Numbers as people type them."""

import pytest

from server.study.answer_checks import AnswerError, check_answers
from server.study.questionnaire import NumberQuestion
from server.study.read_number import read_number
from tests.support.written_numbers import WRITTEN


@pytest.mark.parametrize("text", WRITTEN)
def test_number_is_read_as_it_was_meant_or_refused(text: str) -> None:
    assert read_number(text) == WRITTEN[text]


@pytest.mark.parametrize(
    ("text", "whole", "expected"),
    [
        ("1,200", False, "ambiguous_number"),
        ("1.200", True, "ambiguous_number"),
        ("1 200", True, "grouped_number"),
        ("２５", True, 25),
        ("25.0", True, 25),
        ("25,5", True, "whole"),
        ("25,5", False, 25.5),
        ("1500000", False, "missing_number"),
    ],
)
def test_answer_is_stored_as_the_number_or_comes_back(text: str, whole: bool, expected: float | str) -> None:
    question = NumberQuestion.model_validate(
        {"key": "n", "type": "number", "text": "N", "minimum": 0, "maximum": 1e6, "whole": whole}
    )
    checked = check_answers((question,), {"n": [text]})
    found = checked.faults["n"].reason if checked.faults else checked.answers["n"]
    assert found == expected
    assert type(found) is type(expected)


def test_message_about_an_ambiguous_number_repeats_it() -> None:
    question = NumberQuestion.model_validate({"key": "n", "type": "number", "text": "N", "minimum": 0, "maximum": 5000})
    fault = check_answers((question,), {"n": ["1,200"]}).faults["n"]
    assert fault == AnswerError("ambiguous_number", {"low": "0", "high": "5000", "given": "1,200"})
