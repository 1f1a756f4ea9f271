"""Turn a prediction into a frame's marks, an action and its opacity per step, with the same number of bytes in every
condition.
"""

from collections.abc import Sequence
from typing import Final

from overcooked.constants import ACTIONS
from server.play.episode_spec import EpisodeSpec
from server.play.randomness import MARKS, uniform

NOTHING_SHOWN: Final = 6
OPACITIES: Final = (95, 80, 60)  # %, by step
_FAINTEST: Final = 25  # %, two digits whatever the confidence

Displayed = tuple[tuple[int, int], ...]  # a step: (action 0-6, opacity %)


def display(spec: EpisodeSpec, timestep: int, prediction: Sequence[Sequence[float]]) -> Displayed:
    """Return the marks on the state of `timestep`.

    `prediction` (steps, 6): probabilities, empty where the predictor gave none (then nothing is drawn). Random marks
    are uniform over the six actions and redrawn each timestep.
    """
    opacities = _opacities(spec, prediction)
    if not spec.shows_actions:
        actions = [NOTHING_SHOWN] * spec.steps_shown
    elif spec.shown == "random":
        actions = [int(uniform(spec.seed, timestep, MARKS + step) * ACTIONS) for step in range(spec.steps_shown)]
    elif prediction:
        actions = [row.index(max(row)) for row in prediction[: spec.steps_shown]]
    else:
        actions = [NOTHING_SHOWN] * spec.steps_shown
    return tuple(zip(actions, opacities, strict=True))


def is_as_required(is_due: bool, displayed: Displayed) -> bool:
    """Return whether a frame carries marks where some are due, and none where they are not: the condition shows none,
    or the participant did not ask for them."""
    for action, _ in displayed:
        if action != NOTHING_SHOWN:
            return is_due
    return not is_due


def hidden(displayed: Displayed) -> Displayed:
    """Return the display without its marks; the opacities stay, so that frames have the same bytes."""
    return tuple((NOTHING_SHOWN, opacity) for _, opacity in displayed)


def _opacities(spec: EpisodeSpec, prediction: Sequence[Sequence[float]]) -> Sequence[int]:
    """Return the opacities. With confidence a step fades with its largest probability, in all conditions, so that
    frames do not reveal the condition."""
    plain = OPACITIES[: spec.steps_shown]
    if not (spec.confidence_opacity and prediction):
        return plain
    return [max(_FAINTEST, round(most * max(row))) for most, row in zip(plain, prediction, strict=False)]
