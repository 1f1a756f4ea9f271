"""What a study file declares about its analysis before there are data."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from server.study.questionnaire import Key
from server.study.strict_model import StrictModel


class PrimaryTest(StrictModel):
    """The one test that answers the study's question, declared before data collection. Other tests are secondary."""

    measure: Key = "reward"
    """What is compared: reward, or the key of a scale question that follows every episode."""
    comparison: Annotated[tuple[Key, ...], Field(min_length=2, max_length=2)] = ()
    """The two conditions to compare. The difference is the first minus the second. Empty: there is an `effect`."""
    effect: tuple[Key, ...] = Field(default=(), examples=[["prediction", "opacity"]])
    """Instead of `comparison`, in a study with `factors`: one factor for its main effect, or several for their
    interaction."""
    test: Literal["welch", "student", "mann_whitney", "anova"] = "welch"
    """The test over people, each with the mean of their episodes. welch: t-test without equal variances. student:
    t-test with equal variances. mann_whitney: of ranks. anova: the test of an `effect`, which needs no other."""
    direction: Literal["two_sided", "greater", "less"] = "two_sided"
    """two_sided: a difference either way. greater or less: the first condition, or the later level of a factor with two
    levels, is expected to have more or less."""
    alpha: Annotated[float, Field(gt=0, lt=0.5)] = 0.05
    """The significance level: the largest acceptable probability of a false alarm."""
    layouts: tuple[Key, ...] = ()
    """Use only the episodes on these layouts. Empty: all."""
    agents: tuple[Key, ...] = ()
    """Use only the episodes with these agents. Empty: all."""
    looks: Annotated[tuple[Annotated[int, Field(ge=4)], ...], Field(max_length=10)] = ()
    """Interim looks: how many people of both conditions together have been analysed at each, the last one included.
    Empty: the test is computed once, at the end."""
    spending: Literal["obrien_fleming", "pocock"] = "obrien_fleming"
    """How alpha is spent over the looks (Lan and DeMets). obrien_fleming: little at first. pocock: more evenly."""

    @model_validator(mode="before")
    @classmethod
    def _test_of_an_effect(cls, values: Any) -> Any:
        """Add the test of an effect of factors: there is only one, so the file need not name it."""
        return {"test": "anova", **values} if isinstance(values, dict) and values.get("effect") else values


class SmallestEffect(StrictModel):
    """The smallest differences that matter. The report calls conditions equivalent only within these bounds."""

    reward: Annotated[float, Field(gt=0, le=10_000)] | None = None
    """The smallest difference in reward that matters, in points of an episode. Empty: no equivalence of reward."""
    answers: Annotated[float, Field(gt=0, le=8)] | None = None
    """The smallest difference in answers that matters, in points of the scale. Empty: no equivalence of answers."""
    layouts: tuple[Key, ...] = ()
    """Layouts on which predictions should make no difference. Empty: clear_division, if the study has it."""
