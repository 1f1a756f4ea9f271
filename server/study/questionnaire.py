"""The questions of a study file, and which answers are correct."""

from functools import cached_property
from typing import Annotated, Literal

from pydantic import Field, model_validator

from server.study.branching import EarlierAnswers, When
from server.study.published_scales import ScaleName, published_scale, scale_questions
from server.study.strict_model import StrictModel
from server.study.text import Text

Key = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,39}$")]
Value = int | float | str | list[str]


class Option(StrictModel):
    """One of several things to choose."""

    value: Key
    """The value that is stored."""
    text: Text
    """What participants read."""


class SurveyQuestion(StrictModel):
    """The keys that all questions share."""

    key: Key
    """The name of the answer in the data."""
    text: Text
    """What participants read."""
    hint: Text | None = None
    """A line below the question."""
    required: bool = True
    """Whether the question must be answered."""
    conditions: Literal["all", "with_predictor"] | tuple[str, ...] = "all"
    """The participants who are asked: `all`, `with_predictor` (those who see predictions), or a list of conditions."""
    when: When | None = None
    """Ask only after a certain answer on an earlier page. Empty: always."""


class ScaleQuestion(SurveyQuestion):
    """A number on a scale, from 1 to `points`. Nothing is preselected; the keys 1 to 9 answer it if it has up to 9."""

    type: Literal["scale"]
    points: Annotated[int, Field(ge=2, le=21)] = 7
    """The number of points on the scale."""
    first: Annotated[int, Field(ge=0, le=1000, examples=[0])] = 1
    """The number of the first point."""
    step: Annotated[int, Field(ge=1, le=1000, examples=[5])] = 1
    """The difference between one point and the next."""
    low: Text
    """The label at the first point."""
    high: Text
    """The label at the last point."""
    labels: tuple[Text, ...] = Field(default=(), examples=[["never", "sometimes", "often"]])
    """The words below the points, one text for each. Empty: only the two ends have labels."""
    attention: int | None = None
    """Makes the question an attention check: the number that its text asks for. A wrong answer is only recorded."""

    @property
    def values(self) -> tuple[int, ...]:
        """The numbers that can be chosen."""
        return tuple(self.first + self.step * place for place in range(self.points))

    @model_validator(mode="after")
    def _fits_together(self) -> "ScaleQuestion":
        if self.attention is not None and self.attention not in self.values:
            raise ValueError(f"attention: {self.attention} is not on the scale. Use {_ends(self)}")
        if self.labels and len(self.labels) != self.points:
            raise ValueError(f"labels: there are {len(self.labels)} for {self.points} points. Write one for each")
        return self


def _ends(scale: ScaleQuestion) -> str:
    return f"{scale.values[0]} to {scale.values[-1]}" + (f" in steps of {scale.step}" if scale.step > 1 else "")


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


AnyQuestion = ScaleQuestion | ChoiceQuestion | MultipleQuestion | TextQuestion | NumberQuestion | RankingQuestion


class PublishedScale(StrictModel):
    """The items of a published scale, with their response scale, in the original order."""

    type: Literal["published"]
    scale: ScaleName
    """The scale."""
    subscales: tuple[str, ...] = Field(default=(), examples=[["trust"]])
    """The subscales to ask. Empty: all of them."""
    required: bool = Field(default=True, examples=[False])
    """Whether each item must be answered."""
    conditions: Literal["all", "with_predictor"] | tuple[str, ...] = Field(default="all", examples=["with_predictor"])
    """The participants who are asked: `all`, `with_predictor` (those who see predictions), or a list of conditions."""
    when: When | None = None
    """Ask only after a certain answer on an earlier page. Empty: always."""

    @model_validator(mode="after")
    def _known_subscales(self) -> "PublishedScale":
        known = list(published_scale(self.scale)["subscales"])
        for name in self.subscales:
            if name not in known:
                raise ValueError(f"subscales: {self.scale} has no {name!r}. Use some of {', '.join(known)}")
        return self

    @cached_property
    def items(self) -> tuple[ScaleQuestion, ...]:
        """The questions that participants get."""
        shared = {"required": self.required, "conditions": self.conditions, "when": self.when}
        return tuple(
            ScaleQuestion.model_validate(item | shared) for item in scale_questions(self.scale, self.subscales)
        )


QuestionEntry = Annotated[
    ScaleQuestion
    | ChoiceQuestion
    | MultipleQuestion
    | TextQuestion
    | NumberQuestion
    | RankingQuestion
    | PublishedScale,
    Field(discriminator="type"),
]


class QuestionPage(StrictModel):
    """What the pages of a questionnaire and of the quiz have in common."""

    title: Text
    """The heading of the page."""
    lead: Text | None = None
    """A paragraph below the heading."""
    questions: Annotated[tuple[QuestionEntry, ...], Field(min_length=1)]
    """The questions, in order."""

    @cached_property
    def asks(self) -> tuple[AnyQuestion, ...]:
        """The questions with the items of published scales in their places."""
        return tuple(question for entry in self.questions for question in questions_of(entry))


class Questionnaire(QuestionPage):
    """A page of questions."""

    when: When | None = None
    """Show the page only after a certain answer on an earlier page. Empty: always."""


def questions_of(entry: "QuestionEntry") -> tuple[AnyQuestion, ...]:
    """Return what an entry of a questionnaire asks: itself, or the items of a published scale."""
    return entry.items if isinstance(entry, PublishedScale) else (entry,)


def asked(questions: tuple[AnyQuestion, ...], condition: str, shows_predictions: bool) -> tuple[AnyQuestion, ...]:
    """Return the questions that a participant gets in `condition`, or in a block of rounds with these levels."""

    def is_asked(question: SurveyQuestion) -> bool:
        if question.conditions == "with_predictor":
            return shows_predictions
        return question.conditions == "all" or condition in question.conditions

    return tuple(question for question in questions if is_asked(question))


def asked_after(questions: tuple[AnyQuestion, ...], earlier: EarlierAnswers | None) -> tuple[AnyQuestion, ...]:
    """Return those of the questions that are asked after these answers. None: in a preview, all."""
    return tuple(question for question in questions if question.when is None or question.when.holds(earlier))


def is_correct(question: AnyQuestion, answer: Value | None) -> bool:
    """Return whether a quiz question was answered correctly; a question without a correct answer always is."""
    return not isinstance(question, ChoiceQuestion) or question.correct is None or answer == question.correct


def is_attentive(question: AnyQuestion, answer: Value | None) -> bool | None:
    """Return whether an attention check was passed; None if the question is not an attention check."""
    if isinstance(question, ScaleQuestion | ChoiceQuestion) and question.attention is not None:
        return answer == question.attention
    return None
