"""One condition of a study: what its participants see."""

from typing import Annotated, Literal

from pydantic import Field

from server.study.questionnaire import Key
from server.study.strict_model import StrictModel

Show = Literal["always", "on_key", "toggle"]


class Misleading(StrictModel):
    """In which rounds of a misleading condition the marks are wrong. In the others they are the predictor's."""

    from_round: Annotated[int, Field(ge=1, le=100)] = 1
    """The first round whose marks may be wrong, counted from 1."""
    share: float = Field(default=1, gt=0, le=1, examples=[0.5])
    """The share of these rounds whose marks are wrong: each is drawn with this probability, by the study's seed."""


class Condition(StrictModel):
    """One arm of the study. Participants are never told which they are in."""

    name: Key
    """The condition's name in the data. Participants never see it."""
    predictor: Literal["none", "random", "tom", "degraded", "misleading"]
    """What is drawn. none: nothing. random: random steps. tom: the predictor's steps. degraded: those with errors.
    misleading: the most plausible wrong future; needs a `debriefing`."""
    accuracy: Annotated[float, Field(ge=0.17, le=1)] | None = None
    """Only with `degraded`: the accuracy to reach (mean over the steps). Errors are added until it is reached."""
    misleading: Misleading = Misleading()
    show: Show | None = None
    """When the marks are drawn in this condition: always, on_key or toggle. Empty: as in `predictor.show`."""
    view_radius: Annotated[int, Field(ge=0, le=20)] | None = None
    """Limited sight in this condition. 0: the whole kitchen. Empty: as in `game.view_radius`."""
    weight: Annotated[int, Field(ge=1, le=1000)] = 1
    """A condition with weight 2 gets twice as many participants as one with weight 1."""
    quota: Annotated[int, Field(ge=1)] | None = None
    """The largest number of participants. Empty: no limit."""

    @property
    def shows_predictions(self) -> bool:
        return self.predictor != "none"
