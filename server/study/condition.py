"""One condition of a study: what its participants see."""

from typing import Annotated, Literal

from pydantic import Field

from server.study.questionnaire import Key
from server.study.strict_model import StrictModel

Display = Literal["actions", "intention", "both", "none"]
Show = Literal["always", "on_key", "toggle"]
Form = Literal["window", "stream"]
StepsShown = Annotated[int, Field(ge=1, le=3)]
Predictor = Literal["none", "random", "tom", "degraded", "misleading"]


class PredictorSettings(StrictModel):
    """The predictor that watches the partner, and how its predictions are drawn."""

    form: Form = "stream"
    """stream: remembers earlier timesteps; bundled. window: looks at ten timesteps, as in the paper; bundled for four
    classic kitchens, for others train it first."""
    display: Display = "actions"
    """What of a prediction is drawn. actions: marks for the next steps. intention: an icon at the station that the
    partner uses next, and a bubble. both: both of them. none: nothing; it is still recorded."""
    steps_shown: StepsShown = 3
    """How many predicted steps are drawn."""
    confidence_opacity: bool = False
    """Draw a step fainter when the predictor is less certain."""
    show: Show = "always"
    """When the marks are drawn. always: in every timestep. on_key: while the participant holds the marks key or button.
    toggle: from one press of it to the next. A condition can have its own `show`."""


class Misleading(StrictModel):
    """The rounds of a misleading condition in which the marks are wrong. In the others they are the predictor's."""

    from_round: Annotated[int, Field(ge=1, le=100)] = 1
    """The first round whose marks may be wrong, counted from 1."""
    share: float = Field(default=1, gt=0, le=1, examples=[0.5])
    """The share of these rounds whose marks are wrong: each is drawn with this probability, by the study's seed."""


class NamedPart(StrictModel):
    """A part of the study with a name in the data."""

    name: Key
    """The condition's name in the data. Participants never see it."""


class ConditionSettings(StrictModel):
    """What a level of a factor changes. Settings that no level has are as in the rest of the study."""

    predictor: Predictor | None = Field(default=None, examples=["random"])
    """What is drawn, as in `conditions.predictor`. Where no factor has it, it is tom."""
    accuracy: Annotated[float, Field(ge=0.17, le=1)] | None = Field(default=None, examples=[0.6])
    """Only with `degraded`: the accuracy to reach (mean over the steps). Errors are added until it is reached."""
    misleading: Misleading = Misleading()
    show: Show | None = Field(default=None, examples=["on_key"])
    """When the marks are drawn in this condition: always, on_key or toggle. Empty: as in `predictor.show`."""
    display: Display | None = Field(default=None, examples=["intention"])
    """What of a prediction is drawn in this condition: actions, intention, both or none. Empty: as in
    `predictor.display`."""
    form: Form | None = Field(default=None, examples=["stream"])
    """The form of the predictor in this condition, window or stream. Empty: as in `predictor.form`."""
    steps_shown: StepsShown | None = None
    """How many predicted steps are drawn in this condition. Empty: as in `predictor.steps_shown`."""
    confidence_opacity: bool | None = Field(default=None, examples=[True])
    """Draw a step fainter when the predictor is less certain. Empty: as in `predictor.confidence_opacity`."""
    view_radius: Annotated[int, Field(ge=0, le=20)] | None = Field(default=None, examples=[2])
    """Limited sight in this condition. 0: the whole kitchen. Empty: as in `game.view_radius`."""


class Condition(ConditionSettings, NamedPart):
    """One arm of the study. Participants are never told which they are in."""

    predictor: Predictor
    """What is drawn. none: nothing. random: random steps. tom: the predictor's steps. degraded: those with errors.
    misleading: the most plausible wrong future; needs a `debriefing`."""
    weight: Annotated[int, Field(ge=1, le=1000)] = 1
    """A condition with weight 2 gets twice as many participants as one with weight 1."""
    quota: Annotated[int, Field(ge=1)] | None = None
    """The largest number of participants, of all versions of the study together. Empty: no limit."""

    @property
    def displays(self) -> tuple["Condition", ...]:
        """What is seen in each block of rounds; without blocks, the condition itself."""
        return (self,)

    def at(self, block: int) -> "Condition":
        """Return what is seen in a block of rounds, from 1. 0: outside of the rounds, or without blocks."""
        return self.displays[block - 1] if block else self

    def drawn(self, settings: PredictorSettings) -> Display:
        """Return what participants see of a prediction, over all blocks; `settings`: those of the study."""
        every = {one.display or settings.display for one in self.displays if one.predictor != "none"} - {"none"}
        return "both" if len(every) > 1 else next(iter(every), "none")

    @property
    def misleads(self) -> bool:
        """Whether marks mislead at any time."""
        return any(one.predictor == "misleading" for one in self.displays)


class BlockOrder(Condition):
    """An arm that `cells.within` makes: its participants see one combination of levels in each block of rounds. Its own
    settings are those of the first block with marks, for the pages and the practice before the rounds."""

    blocks: tuple[Condition, ...] = ()

    @property
    def displays(self) -> tuple[Condition, ...]:
        return self.blocks
