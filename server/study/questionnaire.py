"""Questions, and whether answers to them are right. Pure: the same check serves the page, the bots and the import."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field, model_validator

from server.study.numbers import read_number
from server.study.strict_model import StrictModel
from server.study.text import Text

Key = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,39}$")]
Value = int | float | str | list[str]
Answers = dict[str, Value]
CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f]")  # no keyboard writes them; PostgreSQL refuses some


class Option(StrictModel):
    """One of several things to choose."""

    value: Key
    """The value that is stored."""
    text: Text
    """What participants read."""


class SurveyQuestion(StrictModel):
    """What all questions share."""

    key: Key
    """The name of the answer in the data."""
    text: Text
    """What participants read."""
    hint: Text | None = None
    """A line below the question."""
    required: bool = True
    """Whether the question must be answered."""
    conditions: Literal["all", "with_predictor"] | tuple[str, ...] = "all"
    """Who is asked: `all`, `with_predictor` (participants who see predictions), or a list of conditions."""


class ScaleQuestion(SurveyQuestion):
    """A number from 1 to `points`. Nothing is preselected; the keys 1 to 9 answer it."""

    type: Literal["scale"]
    points: Annotated[int, Field(ge=2, le=9)] = 7
    """The number of points on the scale."""
    low: Text
    """The label at 1."""
    high: Text
    """The label at the other end."""
    attention: int | None = None
    """Makes the question an attention check: the number that its text asks for. A wrong answer is only recorded."""

    @model_validator(mode="after")
    def _attention_is_on_the_scale(self) -> "ScaleQuestion":
        if self.attention is not None and not 1 <= self.attention <= self.points:
            raise ValueError(f"attention: {self.attention} is not on the scale. Use 1 to {self.points}")
        return self


class ChoiceQuestion(SurveyQuestion):
    """One of the options."""

    type: Literal["choice"]
    options: Annotated[tuple[Option, ...], Field(min_length=2)]
    """The options to choose from."""
    correct: str | None = None
    """In the quiz: the value of the correct option."""
    explanation: Text | None = None
    """In the quiz: shown after a wrong answer."""
    attention: str | None = Field(default=None, examples=["tea"])
    """Makes the question an attention check: the value that its text asks for."""

    @model_validator(mode="after")
    def _right_answers_are_options(self) -> "ChoiceQuestion":
        values = [option.value for option in self.options]
        for name, value in (("correct", self.correct), ("attention", self.attention)):
            if value is not None and value not in values:
                raise ValueError(f"{name}: {value!r} is none of the options. Use one of {', '.join(values)}")
        return self


class MultipleQuestion(SurveyQuestion):
    """Any number of the options."""

    type: Literal["multiple"]
    options: Annotated[tuple[Option, ...], Field(min_length=2)]
    """The options to choose from."""
    at_least: Annotated[int, Field(ge=0)] = 1
    """The smallest number of options to choose."""
    at_most: int | None = None
    """The largest number of options to choose. Empty: all of them."""


class TextQuestion(SurveyQuestion):
    """Free text."""

    type: Literal["text"]
    max_length: Annotated[int, Field(ge=1, le=5000)] = 500
    """The largest number of characters."""
    lines: Annotated[int, Field(ge=1, le=20)] = 3
    """The height of the input field, in lines."""


class NumberQuestion(SurveyQuestion):
    """A number in a range."""

    type: Literal["number"]
    minimum: float
    """The smallest number that is accepted."""
    maximum: float
    """The largest number that is accepted."""
    whole: bool = Field(default=True, examples=[False])
    """Accept whole numbers only."""


class RankingQuestion(SurveyQuestion):
    """The options in order: each gets a place of its own."""

    type: Literal["ranking"]
    options: Annotated[tuple[Option, ...], Field(min_length=2, max_length=9)]
    """The options to put in order."""


AnyQuestion = Annotated[
    ScaleQuestion | ChoiceQuestion | MultipleQuestion | TextQuestion | NumberQuestion | RankingQuestion,
    Field(discriminator="type"),
]


class Questionnaire(StrictModel):
    """A page of questions."""

    title: Text
    """The heading of the page."""
    lead: Text | None = None
    """A paragraph below the heading."""
    questions: Annotated[tuple[AnyQuestion, ...], Field(min_length=1)]
    """The questions, in order."""


@dataclass(frozen=True)
class AnswerError:
    """Why an answer is refused: a key of the locale's `faults`, with its numbers."""

    reason: str
    numbers: Mapping[str, int | float | str]


@dataclass(frozen=True)
class Checked:
    """What a form's answers are worth. `answers` holds the good ones, `faults` the rest by question key."""

    answers: Answers
    faults: dict[str, AnswerError]


def asked(questions: tuple[AnyQuestion, ...], condition: str, shows_predictions: bool) -> tuple[AnyQuestion, ...]:
    """The questions that a participant in `condition` gets."""

    def is_asked(question: SurveyQuestion) -> bool:
        if question.conditions == "with_predictor":
            return shows_predictions
        return question.conditions == "all" or condition in question.conditions

    return tuple(question for question in questions if is_asked(question))


def check_answers(questions: tuple[AnyQuestion, ...], form: Mapping[str, list[str]]) -> Checked:
    """Answers of a submitted form (all values by field name) against the questions that were asked."""
    answers: Answers = {}
    faults: dict[str, AnswerError] = {}
    for question in questions:
        values = [value for value in form.get(question.key, []) if not _is_blank(value)]
        if not isinstance(question, TextQuestion):  # the blanks around people's words are theirs
            values = [value.strip(" \t\n") for value in values]
        result = _check_ranking(question, form) if isinstance(question, RankingQuestion) else _check(question, values)
        if isinstance(result, AnswerError):
            faults[question.key] = result
        elif result is not None:
            answers[question.key] = result
    return Checked(answers, faults)


def is_correct(question: AnyQuestion, answer: Value | None) -> bool:
    """Whether a quiz question was answered correctly; a question without a correct answer always is."""
    return not isinstance(question, ChoiceQuestion) or question.correct is None or answer == question.correct


def is_attentive(question: AnyQuestion, answer: Value | None) -> bool | None:
    """Whether an attention check was passed; None where the question is none."""
    if isinstance(question, ScaleQuestion | ChoiceQuestion) and question.attention is not None:
        return answer == question.attention
    return None


def _is_blank(text: str) -> bool:
    """Whether there is nothing but white space, as a browser counts it."""
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
            good = value.isascii() and value.isdigit() and len(value) == 1 and 1 <= int(value) <= question.points
            return int(value) if good else AnswerError("missing_scale", _range(question))
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
            return {"low": 1, "high": question.points}
        case NumberQuestion():
            return {"low": f"{question.minimum:g}", "high": f"{question.maximum:g}"}
        case _:
            return {}


def _check_text(question: TextQuestion, text: str) -> str | AnswerError:
    """Return people's words as they wrote them; control characters are refused, never removed."""
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
    """A ranking comes as one field an option, `key.option` = place from 1."""
    places = {
        option.value: "".join(form.get(f"{question.key}.{option.value}", [""])[:1]) for option in question.options
    }
    if not question.required and not any(places.values()):
        return None
    if sorted(places.values()) != [str(place) for place in range(1, len(places) + 1)]:
        return AnswerError("missing_ranking", {"high": len(places)})
    return sorted(places, key=lambda value: int(places[value]))
