"""What a study file may say, as frozen models. Knows words and numbers only: no game, no database, no web."""

from typing import Annotated, Any, Literal, TypeVar

from pydantic import BeforeValidator, Field

from server.study.locale import languages, locale
from server.study.questionnaire import AnyQuestion, Key, Questionnaire
from server.study.recruitment import Recruitment
from server.study.strict_model import StrictModel
from server.study.text import Text

Lesson = Literal["walk", "fetch", "fill", "wait", "plate", "deliver", "marks"]
LESSONS: tuple[Lesson, ...] = ("walk", "fetch", "fill", "wait", "plate", "deliver", "marks")
# Entries of `flow` that need no block of their own.
FIXED_PAGES = ("introduction", "quiz", "tutorial", "episodes", "thanks")


class Condition(StrictModel):
    """One arm of the study. Participants are never told which they are in."""

    name: Key
    predictor: Literal["none", "random", "tom", "degraded"]
    """What is drawn: nothing, uniformly random steps, the predictor's, or those of a predictor made worse."""
    accuracy: Annotated[float, Field(ge=0.17, le=1)] | None = None
    """With `degraded`: the wanted accuracy (mean of its steps), e.g. 0.6; the predictor errs the more to reach it."""
    weight: Annotated[int, Field(ge=1, le=1000)] = 1
    quota: Annotated[int, Field(ge=1)] | None = None
    """At most so many participants. Empty: no limit."""

    @property
    def shows_predictions(self) -> bool:
        return self.predictor != "none"


class PartnerSettings(StrictModel):
    """An AI partner, or another participant in its place."""

    name: Key
    """Names the agent in the study and, unless `model` says otherwise, its checkpoint."""
    human: bool = False
    """The partner is another participant of the same condition; see `waiting_room`."""
    model: str | None = None
    """What the catalogue calls it, or somebody's own agent: `module:Class`, an ONNX file, an address."""
    mode: Literal["card", "greedy", "sampled"] = "card"
    """How it acts: as its card says, always its likeliest action, or drawn from its probabilities."""
    predictor: str | None = None
    """Who foretells it. Empty: the predictor that was trained for it, in the study's form."""

    @property
    def catalogue_name(self) -> str:
        name = self.model or self.name
        return name if self.mode == "card" else f"{name}@{self.mode}"


class KitchenChoice(StrictModel):
    """A layout: a shipped one by its name, or an own grid."""

    name: Key
    title: Text
    grid: str | None = None
    """The rows as drawn: X counter, O onions, D dishes, P pot, S exit, a space for floor, 1 and 2 for the chefs."""


class Order(StrictModel):
    """In which order a participant meets layouts and agents."""

    rule: Literal["fixed", "shuffled", "latin_square", "paper"] = "fixed"
    """fixed: as listed. shuffled: all episodes mixed. latin_square: layouts by a balanced square, agents alternating.
    paper: layouts as listed, agents of the first layout at random, in every later one the reverse of the one before."""
    repeat: Annotated[int, Field(ge=1, le=20)] = 1
    """How often each layout and agent is played."""


class PredictorSettings(StrictModel):
    """What watches the partner."""

    form: Literal["window", "stream"] = "stream"
    """stream: keeps a running memory; bundled for the bundled agents. window: the paper's ten steps, to be trained."""
    steps_shown: Annotated[int, Field(ge=1, le=3)] = 3
    confidence_opacity: bool = False
    """Draw a step the paler, the less sure the predictor is."""


class Pause(StrictModel):
    """How long somebody may be away in an episode."""

    each_s: Annotated[float, Field(gt=0, le=3600)] = 30
    episode_s: Annotated[float, Field(gt=0, le=7200)] = 60


class Progress(StrictModel):
    """Points for unfinished soups when the time is up, kept apart from the score."""

    onion_in_pot: Annotated[float, Field(ge=0)] = 3
    soup_on_dish: Annotated[float, Field(ge=0)] = 17


def _whole(value: Any) -> Any:
    """A digit of the file as a number: values of a study file are texts, and a Literal of numbers parses none."""
    return int(value) if isinstance(value, str) and value in ("0", "1") else value


class GameSettings(StrictModel):
    """The settings of every episode."""

    tick_ms: Annotated[int, Field(ge=20, le=2000)] = 200
    horizon: Annotated[int, Field(ge=1, le=10_000)] = 400
    human_seat: Annotated[Literal[0, 1], BeforeValidator(_whole)] = 0
    deadline_ms: Annotated[int, Field(ge=5, le=2000)] = 120
    """How long the models may take in a tick; later, the partner waits."""
    pause: Pause = Pause()
    progress: Progress = Progress()


def _practice() -> KitchenChoice:
    return KitchenChoice(name="practice", title=Text({each: locale(each)("game.practice") for each in languages()}))


class WaitingRoomSettings(StrictModel):
    """Where somebody waits for the other person of a round of two."""

    limit_s: Annotated[float, Field(ge=1, le=3600)] = 180
    """Counted from the first opening of the page; then `fallback`."""
    fallback: Literal["agent", "leave"] = "agent"
    """agent: the round, and every later one, is played with `agent`. leave: the study ends with a code."""
    agent: PartnerSettings = PartnerSettings(name="planner", predictor="random")
    """Who stands in for a person who does not come or has left."""


class Tutorial(StrictModel):
    """The practice game: endless, passed with a delivery."""

    layout: KitchenChoice = Field(default_factory=_practice)
    """Empty: a small kitchen in which nobody is in the way."""
    agent: PartnerSettings = PartnerSettings(name="guide", predictor="guide")
    """Who walks beside the participant. The guide paces up and down, so its marks are easy to read."""
    lessons: tuple[Lesson, ...] = LESSONS
    skippable: bool = False
    """A button leads past the practice; that somebody pressed it is in the data."""


class EntryChecks(StrictModel):
    """What a device must be able to do before anybody is asked for consent."""

    width: int = 320
    height: int = 480
    """The smallest screen, in CSS pixels; the two may be swapped."""
    input: bool = True
    """A keyboard or a touch screen."""
    websocket: bool = True
    latency_ms: Annotated[int, Field(ge=20)] | None = 600
    """The slowest median round trip. Empty: not measured."""


class Quiz(Questionnaire):
    """The comprehension check: every question with a `correct` answer has to be answered correctly."""

    attempts: Annotated[int, Field(ge=1)] | None = None
    """After so many failures the participant is screened out. Empty: as often as they like."""


class AttentionChecks(StrictModel):
    """What follows from questions with `attention`, whose text asks for a certain answer."""

    screen_out_after: Annotated[int, Field(ge=1)] | None = None
    """Somebody who failed so many is screened out after the page. Empty: wrong answers are only flagged in the data."""


class Fact(StrictModel):
    """One line of the consent page's summary."""

    label: Text
    value: Text


class Section(StrictModel):
    """A heading with Markdown below it."""

    title: Text
    body: Text


class Consent(StrictModel):
    """The first page. Nothing is stored before somebody agrees."""

    title: Text
    lead: Text
    facts: Annotated[tuple[Fact, ...], Field(max_length=6)] = ()
    sections: Annotated[tuple[Section, ...], Field(min_length=1)]
    boxes: Annotated[tuple[Text, ...], Field(min_length=1)]
    """Each has to be ticked."""


class Breaks(StrictModel):
    """Pages between episodes on which nothing is to be done."""

    after: tuple[int, ...] = ()
    """Numbers of the episodes that a break follows."""


Named = TypeVar("Named", Condition, PartnerSettings, KitchenChoice)


class Study(StrictModel):
    """One study: everything that happens between the link and the completion code."""

    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_-]{0,39}$")]
    """Names the study in its address and its data."""
    title: Text
    summary: Text
    """A sentence for the page on which a study is chosen."""
    languages: Annotated[tuple[str, ...], Field(min_length=1)] = ("en",)
    seed: Annotated[int, Field(ge=0, lt=2**63)]
    """All randomness of the study follows from it."""
    duration_min: Annotated[int, Field(ge=1, le=600)]
    timeout_min: Annotated[int, Field(ge=1)] = 120
    """Somebody who was not seen for so long no longer holds a place in a condition."""
    hold_min: Annotated[int, Field(ge=1)] = 10
    """A place is held for so long after consent; from the first page sent or game begun on, `timeout_min` counts."""
    contact: Text | None = None
    recruitment: Recruitment = Recruitment()
    entry: EntryChecks = EntryChecks()
    consent: Consent
    conditions: Annotated[tuple[Condition, ...], Field(min_length=1)]
    agents: Annotated[tuple[PartnerSettings, ...], Field(min_length=1)]
    layouts: Annotated[tuple[KitchenChoice, ...], Field(min_length=1)]
    predictor: PredictorSettings = PredictorSettings()
    game: GameSettings = GameSettings()
    order: Order = Order()
    waiting_room: WaitingRoomSettings = WaitingRoomSettings()
    tutorial: Tutorial = Tutorial()
    quiz: Quiz | None = None
    questionnaires: dict[Key, Questionnaire] = Field(default_factory=dict)
    after_episode: str | None = None
    """The questionnaire that follows every episode."""
    attention: AttentionChecks = AttentionChecks()
    breaks: Breaks = Breaks()
    pages: dict[Key, Section] = Field(default_factory=dict)
    flow: Annotated[tuple[str, ...], Field(min_length=1)]
    """The way: introduction, quiz, tutorial, episodes, thanks, and the names of pages and questionnaires."""

    def condition(self, name: str) -> Condition:
        """Raises KeyError for a name that the study does not have."""
        return _named(self.conditions, name)

    def agent(self, name: str) -> PartnerSettings:
        return _named(self.agents, name)

    def layout(self, name: str) -> KitchenChoice:
        return _named(self.layouts, name)

    def questions(self, key: str) -> tuple[AnyQuestion, ...]:
        """The questions of a questionnaire, or of the quiz."""
        if key == "quiz" and self.quiz is not None:
            return self.quiz.questions
        return self.questionnaires[key].questions


def _named(parts: tuple[Named, ...], name: str) -> Named:
    for part in parts:
        if part.name == name:
            return part
    raise KeyError(name)
