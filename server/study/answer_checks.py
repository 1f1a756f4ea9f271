"""Check submitted answers against the questions. Pure: the page, the bots and the import use the same check."""

import re
from collections.abc import Mapping
from dataclasses import dataclass

from server.study.questionnaire import (
    AnyQuestion,
    ChoiceQuestion,
    MultipleQuestion,
    NumberQuestion,
    RankingQuestion,
    ScaleQuestion,
    TextQuestion,
    Value,
)
from server.study.read_number import read_number

Answers = dict[str, Value]
CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f]")  # they cannot be typed, and PostgreSQL refuses some


@dataclass(frozen=True)
class AnswerError:
    """The reason why an answer is refused: a key of the locale's `faults`, with its numbers."""

    reason: str
    numbers: Mapping[str, int | float | str]


@dataclass(frozen=True)
class Checked:
    """The result of checking a form: `answers` has the valid ones, `faults` the others by question key."""

    answers: Answers
    faults: dict[str, AnswerError]


def check_answers(questions: tuple[AnyQuestion, ...], form: Mapping[str, list[str]]) -> Checked:
    """Check the answers of a submitted form (all values by field name) against its questions."""
    answers: Answers = {}
    faults: dict[str, AnswerError] = {}
    for question in questions:
        values = [value for value in form.get(question.key, []) if not _is_blank(value)]
        if not isinstance(question, TextQuestion):  # blanks around a text are part of the answer
            values = [value.strip(" \t\n") for value in values]
        result = _check_ranking(question, form) if isinstance(question, RankingQuestion) else _check(question, values)
        if isinstance(result, AnswerError):
            faults[question.key] = result
        elif result is not None:
            answers[question.key] = result
    return Checked(answers, faults)


def _is_blank(text: str) -> bool:
    """Return whether there is only white space, as a browser counts it."""
    return not text.replace("\ufeff", "").strip()


def _check(question: AnyQuestion, values: list[str]) -> Value | AnswerError | None:
    if isinstance(question, MultipleQuestion):
        return _check_multiple(question, values)
    if not values:
        return AnswerError(f"missing_{question.type}", _range(question)) if question.required else None
    if len(values) > 1:
        return AnswerError("several", {})
    value = values[0]
    match question:
        case ScaleQuestion():
            return int(value) if value in map(str, question.values) else AnswerError("missing_scale", _range(question))
        case ChoiceQuestion():
            return (
                value if value in {option.value for option in question.options} else AnswerError("missing_choice", {})
            )
        case TextQuestion():
            return _check_text(question, value)
        case NumberQuestion():
            return _check_number(question, value)
        case _:
            raise AssertionError(question.type)


def _range(question: AnyQuestion) -> dict[str, int | float | str]:
    match question:
        case ScaleQuestion():
            return {"low": question.values[0], "high": question.values[-1]}
        case NumberQuestion():
            return {"low": f"{question.minimum:g}", "high": f"{question.maximum:g}"}
        case _:
            return {}


def _check_text(question: TextQuestion, text: str) -> str | AnswerError:
    """Return the text as written; control characters are refused, not removed."""
    control = CONTROL.search(text)
    if control:
        return AnswerError("control", {"before": text[max(0, control.start() - 20) : control.start()]})
    if len(text) > question.max_length:
        return AnswerError("long", {"most": question.max_length, "length": len(text)})
    return text


def _check_number(question: NumberQuestion, text: str) -> int | float | AnswerError:
    number = read_number(text)
    if isinstance(number, str):
        return AnswerError(number, _range(question) | {"given": text})
    if not question.minimum <= number <= question.maximum:
        return AnswerError("missing_number", _range(question))
    if question.whole and not number.is_integer():
        return AnswerError("whole", _range(question))
    return int(number) if question.whole else number


def _check_multiple(question: MultipleQuestion, values: list[str]) -> list[str] | AnswerError | None:
    chosen = [option.value for option in question.options if option.value in values]
    if len(chosen) != len(set(values)):
        return AnswerError("missing_choice", {})
    if not chosen and not question.required:
        return None
    most = question.at_most or len(question.options)
    least = max(question.at_least, 1) if question.required else question.at_least
    return chosen if least <= len(chosen) <= most else AnswerError("missing_multiple", {"low": least, "high": most})


def _check_ranking(question: RankingQuestion, form: Mapping[str, list[str]]) -> list[str] | AnswerError | None:
    """Read a ranking: one field for each option, `key.option` = place from 1."""
    places = {
        option.value: "".join(form.get(f"{question.key}.{option.value}", [""])[:1]) for option in question.options
    }
    if not question.required and not any(places.values()):
        return None
    if sorted(places.values()) != [str(place) for place in range(1, len(places) + 1)]:
        return AnswerError("missing_ranking", {"high": len(places)})
    return sorted(places, key=lambda value: int(places[value]))
