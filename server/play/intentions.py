"""Turn a predictor's intentions into a frame's content, with the same number of bytes in every condition."""

from collections.abc import Sequence
from typing import Final

from models.protocols import INTENTION_HORIZON
from models.protocols import Intention as Intention
from overcooked.interactions import InteractionKind, possible_interactions
from overcooked.layout import Layout
from server.play.episode_spec import EpisodeSpec
from server.play.randomness import INTENTION, uniform

HORIZON: Final = INTENTION_HORIZON
NO_INTENTION_SHOWN: Final = 8  # in the place of a kind
OPACITY: Final = 95  # %
_FAINTEST: Final = 25  # %, two digits whatever the confidence
_RANDOM_FOR: Final = 10  # timesteps: a random intention stays as long as it takes to read it
_MAX_DIGITS: Final = len("1010")  # of the digits of x and y: those of a kitchen's largest column and row

ShownIntention = tuple[int, int, int, int]  # kind 0-7, or 8: nothing is drawn; x, y: -1 for none; opacity %


def display(
    spec: EpisodeSpec, layout: Layout, timestep: int, intentions: Sequence[Intention], misleading: bool = False
) -> ShownIntention:
    """Return the intention that the participant sees on the state of `timestep`.

    `intentions`: the likeliest first; empty where the predictor gave none (then nothing is drawn). A random one is
    uniform over what the kitchen allows. `misleading`: the wrong one of `wrong_intention`, if there is one.
    """
    opacity = _opacity(spec, intentions)
    if not spec.shows_intention:
        return NO_INTENTION_SHOWN, -1, -1, opacity
    if spec.shown == "random":
        possible = possible_interactions(layout)
        kind, x, y = possible[int(uniform(spec.seed, timestep // _RANDOM_FOR, INTENTION) * len(possible))]
        return int(kind), x, y, opacity
    if not intentions:
        return NO_INTENTION_SHOWN, -1, -1, opacity
    shown = (wrong_intention(intentions) if misleading else None) or intentions[0]
    return int(shown.kind), shown.x, shown.y, opacity


def wrong_intention(intentions: Sequence[Intention]) -> Intention | None:
    """Return the most plausible wrong intention: the runner-up, if it is another use of a station. None if the second
    most likely is "no interaction", which would not mislead."""
    first, *others = intentions or (None,)
    for other in others:
        if first is not None and (other.kind, other.x, other.y) != (first.kind, first.x, first.y):
            return other if other.kind != InteractionKind.NONE else None
    return None


def hidden(shown: ShownIntention) -> ShownIntention:
    """Return the display without its intention; the opacity stays."""
    return NO_INTENTION_SHOWN, -1, -1, shown[3]


def is_as_required(is_due: bool, shown: ShownIntention) -> bool:
    """Return whether a frame carries an intention where one is due, and none where it is not."""
    return (shown[0] != NO_INTENTION_SHOWN) == is_due


def padding(shown: ShownIntention) -> str:
    """Return what makes all frames equally long: places have one or two digits."""
    return "-" * (_MAX_DIGITS - len(f"{shown[1]}{shown[2]}"))


def _opacity(spec: EpisodeSpec, intentions: Sequence[Intention]) -> int:
    if not (spec.confidence_opacity and intentions):
        return OPACITY
    return max(_FAINTEST, round(OPACITY * intentions[0].probability))
