"""The content of a study file, as frozen models."""

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, TypeVar

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from overcooked.other_names import bundled_name
from server.study.analysis_plan import PrimaryTest, SmallestEffect
from server.study.condition import Condition as Condition
from server.study.condition import Display
from server.study.condition import PredictorSettings as PredictorSettings
from server.study.consent import Consent, TextPage
from server.study.factors import Cells, Conditions, Factors
from server.study.locale import languages, locale
from server.study.pinned_checkpoints import Checkpoints
from server.study.questionnaire import AnyQuestion, Key, Questionnaire, QuestionPage
from server.study.recruitment import Recruitment
from server.study.strict_model import StrictModel
from server.study.text import Text

Lesson = Literal["walk", "fetch", "fill", "wait", "plate", "deliver", "marks"]
LESSONS: tuple[Lesson, ...] = ("walk", "fetch", "fill", "wait", "plate", "deliver", "marks")
FIXED_PAGES = ("introduction", "quiz", "tutorial", "episodes", "thanks")  # entries of `flow` without a block


class PartnerSettings(StrictModel):
    """An AI partner, or another participant in its place."""

    name: Key
    """The agent's name in the data. Without `model`, also the name of its checkpoint."""
    human: bool = False
    """The partner is another participant in the same condition. See `waiting_room`."""
    model: str | None = None
    """A bundled agent or one that you trained, by name; or a checkpoint folder, an ONNX file, `module:Class` or an
    http:// address."""
    mode: Literal["card", "greedy", "sampled"] = "card"
    """How it acts. card: as its card says. greedy: the most likely action. sampled: drawn from its probabilities."""
    predictor: str | None = None
    """Its predictor, by name or path. Empty: the one that was trained for it, in the form of `predictor.form`."""

    @property
    def catalogue_name(self) -> str:
        name = self.model or self.name
        return name if self.mode == "card" else f"{name}@{self.mode}"


class KitchenChoice(StrictModel):
    """A layout: a bundled one by its name, or your own grid."""

    name: Key
    """The layout's name in the data. Without `grid`, that of a bundled layout or of a kitchen from the dashboard."""
    title: Text
    """The name that participants see."""
    grid: str | None = None
    """Your own layout, row by row: X counter, O onions, D dishes, P pot, S serving, space floor, 1 and 2 the chefs."""

    @model_validator(mode="before")
    @classmethod
    def _bundled_name(cls, values: Any) -> Any:
        """Replace overcooked_ai's name of a layout (random0), so that it has one name in the data."""
        if isinstance(values, dict) and isinstance(values.get("name"), str) and values.get("grid") is None:
            return values | {"name": bundled_name(values["name"])}
        return values


class Order(StrictModel):
    """In which order a participant meets layouts and agents."""

    rule: Literal["fixed", "shuffled", "latin_square", "paper"] = "fixed"
    """fixed: as listed. shuffled: all episodes in random order. latin_square: layouts by a balanced Latin square,
    agents alternating. paper: layouts as listed; agents in random order in the first, reversed in each later one."""
    repeat: Annotated[int, Field(ge=1, le=20)] = 1
    """How often each pair of layout and agent is played."""


class Pause(StrictModel):
    """How long a participant may be away before the episode ends. Time in which the researcher or the database pauses
    the game does not count."""

    each_s: Annotated[float, Field(gt=0, le=3600)] = 30
    """The longest single absence, in seconds."""
    episode_s: Annotated[float, Field(gt=0, le=7200)] = 60
    """The longest total absence within one episode, in seconds. Time in which both people are away counts once."""


class Progress(StrictModel):
    """Points for unfinished soups at the end of an episode. They are stored apart from the score."""

    onion_in_pot: Annotated[float, Field(ge=0)] = 3
    """Points for each onion in a pot."""
    soup_on_dish: Annotated[float, Field(ge=0)] = 17
    """Points for each soup on a dish that was not delivered."""


def _whole(value: Any) -> Any:
    """Return a digit of the file as a number: values of a study file are texts, and a Literal of numbers parses
    none."""
    return int(value) if isinstance(value, str) and value in ("0", "1") else value


class GameSettings(StrictModel):
    """The settings of every episode."""

    tick_ms: Annotated[int, Field(ge=20, le=2000)] = 200
    """The length of a timestep, in milliseconds."""
    horizon: Annotated[int, Field(ge=1, le=10_000)] = 400
    """The number of timesteps in an episode."""
    human_seat: Annotated[Literal[0, 1], BeforeValidator(_whole)] = 0
    """The participant's seat: 0 starts on the layout's cell 1, 1 on its cell 2."""
    deadline_ms: Annotated[int, Field(ge=5, le=2000)] = 120
    """How long agent and predictor may take for a timestep. If the agent is late, it waits for one timestep."""
    view_radius: Annotated[int, Field(ge=1, le=20)] | None = None
    """Limited sight: a participant sees this many columns and rows around their chef. Empty: the whole kitchen."""
    pause: Pause = Pause()
    progress: Progress = Progress()


def _practice() -> KitchenChoice:
    return KitchenChoice(name="practice", title=Text({each: locale(each)("game.practice") for each in languages()}))


class WaitingRoomSettings(StrictModel):
    """Where a participant waits for the other person in a study for two."""

    limit_s: Annotated[float, Field(ge=1, le=3600)] = 180
    """The longest wait in seconds since the page first opened, without the study's pauses. Then `fallback` applies."""
    fallback: Literal["agent", "leave"] = "agent"
    """agent: play this round and all later ones with `agent`. leave: end the study with the code `unpaired`."""
    agent: PartnerSettings = PartnerSettings(name="planner", predictor="random")
    """The agent that replaces a person who does not arrive or who left."""


class Tutorial(StrictModel):
    """The practice game. It has no time limit and is passed with the last lesson."""

    layout: KitchenChoice = Field(default_factory=_practice)
    """The kitchen of the practice. Empty: a small one with enough room for both chefs."""
    agent: PartnerSettings = PartnerSettings(name="guide", predictor="guide")
    """The partner in the practice. The default, guide, walks up and down, so that its marks are easy to read."""
    lessons: tuple[Lesson, ...] = LESSONS
    """The lessons and their order. Empty: the practice ends with a delivery."""
    skippable: bool = False
    """Show a button that skips the practice. The data record its use."""


class EntryChecks(StrictModel):
    """What a device must have before its user is asked for consent."""

    width: int = 320
    """The smallest screen width, in CSS pixels. Width and height may be swapped."""
    height: int = 540
    """The smallest screen height, in CSS pixels. The game is laid out for 320 x 540 and more."""
    input: bool = True
    """Require a keyboard or a touch screen."""
    websocket: bool = True
    """Require a working websocket connection."""
    latency_ms: Annotated[int, Field(ge=20)] | None = 600
    """The largest median round trip, in milliseconds. Empty: not measured."""


IN_QUIZ: Final = "everybody takes the quiz, so `when` has no place in it"


class Quiz(QuestionPage):
    """The comprehension check: every question with `correct` must be answered correctly."""

    attempts: Annotated[int, Field(ge=1)] | None = None
    """Screen a participant out after this many failed attempts. Empty: no limit."""

    @model_validator(mode="before")
    @classmethod
    def _for_everybody(cls, values: Any) -> Any:
        if isinstance(values, Mapping) and "when" in values:
            context = {"key": "when", "reason": IN_QUIZ, "remedy": "Remove `when`."}
            raise PydanticCustomError("unknown_key", "{reason}", context)
        return values


class AttentionChecks(StrictModel):
    """What happens after failed attention checks (questions with `attention`)."""

    screen_out_after: Annotated[int, Field(ge=1)] | None = None
    """Screen a participant out after this many failed checks. Empty: failed checks are only recorded."""


class Breaks(StrictModel):
    """Pages between episodes on which participants can rest."""

    after: tuple[int, ...] = ()
    """A break follows each of these episodes, counted from 1."""


Named = TypeVar("Named", Condition, PartnerSettings, KitchenChoice)


class Study(StrictModel):
    """One study: everything that happens between the link and the completion code."""

    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_-]{0,39}$")]
    """The study's name in its address and in the data."""
    title: Text
    """The name that participants see."""
    summary: Text
    """One sentence for the page on which participants choose a study."""
    languages: Annotated[tuple[str, ...], Field(min_length=1)] = ("en",)
    """The codes of the languages of the study's texts, such as `en` and `zh`."""
    seed: Annotated[int, Field(ge=0, lt=2**63)]
    """The seed of everything random in the study."""
    duration_min: Annotated[int, Field(ge=1, le=600)]
    """How long the study takes, in minutes. Participants see it where they choose a study."""
    timeout_min: Annotated[int, Field(ge=1)] = 120
    """After so many minutes of absence, pauses of the study not counted, a place in a condition is free again."""
    hold_min: Annotated[int, Field(ge=1)] = 10
    """How many minutes a place is held after consent, until the first page is sent or the first game begins."""
    replace_excluded: bool = False
    """Whether a participant who completed the study and is excluded in the dashboard frees the place for another."""
    contact: Text | None = None
    """Where participants can ask questions. The consent page shows it."""
    recruitment: Recruitment = Recruitment()
    entry: EntryChecks = EntryChecks()
    consent: Consent
    factors: Factors = Field(default_factory=dict)
    """Factors with their levels instead of `conditions`: each combination of levels becomes a condition."""
    cells: Cells = Cells()
    conditions: Conditions = ()
    """The arms of the study. Required unless there are `factors`, which make them."""
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
    """The key of the questionnaire that follows every episode."""
    attention: AttentionChecks = AttentionChecks()
    breaks: Breaks = Breaks()
    primary: PrimaryTest | None = None
    smallest_effect: SmallestEffect | None = None
    debriefing: str | None = None
    """The key of the page in `pages` that tells participants about misleading marks. It follows the rounds."""
    pages: dict[Key, TextPage] = Field(default_factory=dict)
    checkpoints: Checkpoints = Field(default_factory=dict, examples=[{"nook/nook_agent": 64 * "0"}])
    """SHA-256 of agents and predictors that you trained, by KITCHEN/NAME. Leave it empty: it is written when a version
    of the study is made, which then keeps them. If you set it, only a checkpoint with this SHA-256 is used."""
    flow: Annotated[tuple[str, ...], Field(min_length=1)]
    """The steps in order: introduction, quiz, tutorial, episodes, thanks, and keys of `pages` and `questionnaires`."""

    def condition(self, name: str) -> Condition:
        """Return the condition with this name. Raises KeyError if the study does not have it."""
        return _named(self.conditions, name)

    @property
    def displays(self) -> tuple[Condition, ...]:
        """What participants can see in a round, each once: the conditions, or the combinations of levels in blocks."""
        seen = {one.name: one for condition in self.conditions for one in condition.displays}
        return self.conditions if self.blocks == 1 else tuple(seen.values())

    @property
    def blocks(self) -> int:
        """How many blocks of rounds each participant has: one, unless there are factors within people."""
        return len(self.conditions[0].displays)

    @property
    def branches(self) -> bool:
        """Return whether anything depends on an answer."""
        found = [page.when for page in self.pages.values()]
        for block in self.questionnaires.values():
            found += [block.when, *(entry.when for entry in block.questions)]
        return any(when is not None for when in found)

    def drawn(self, condition: Condition) -> Display:
        """Return what participants in a condition see of a prediction."""
        return condition.drawn(self.predictor)

    def shows_predictions(self, condition: Condition) -> bool:
        return self.drawn(condition) != "none"

    def agent(self, name: str) -> PartnerSettings:
        return _named(self.agents, name)

    def layout(self, name: str) -> KitchenChoice:
        return _named(self.layouts, name)

    def questions(self, key: str) -> tuple[AnyQuestion, ...]:
        """Return the questions of a questionnaire, or of the quiz."""
        if key == "quiz" and self.quiz is not None:
            return self.quiz.asks
        return self.questionnaires[key].asks


def _named(parts: tuple[Named, ...], name: str) -> Named:
    for part in parts:
        if part.name == name:
            return part
    raise KeyError(name)
