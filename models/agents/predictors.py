"""Load the predictors that a study names; also those that are not networks: uniform, and degraded to a given
accuracy.
"""

import json
import zlib
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from models.agents.blackbox import is_foreign, load_foreign_predictor
from models.agents.carrier import CarrierPredictor
from models.agents.model_paths import without_variant
from models.agents.scripted import GuidePredictor
from models.inference.predictor_numpy import load_trained_predictor
from models.protocols import (
    INTENTION,
    INTENTIONS,
    STEPS,
    IntentionPredictor,
    Intentions,
    Observations,
    Predictions,
    Predictor,
)
from overcooked.constants import ACTIONS
from overcooked.layout import Layout

WEIGHTS = Path(__file__).parents[1] / "weights"
RANDOM = "random"
SCRIPTED: Final[dict[str, type[Predictor]]] = {"guide": GuidePredictor, "carrier": CarrierPredictor}  # of that agent
_GUESS_MARGIN: Final = 1e-3  # by which the guessed action of a uniform prediction is more likely
_INTENTION_DRAWS = 1  # so that errors of intentions do not come with those of actions


class UnknownPredictor(ValueError):
    """No predictor has that name on this layout; the message lists those that exist."""


def load_predictor(name: str, layout: Layout) -> Predictor:
    """Load the predictor called `name`: `random`, `guide` or `carrier` (of that scripted agent), a bundled one such as
    `sp_predictor_stream`, a folder that `kitchenmind train predictor` wrote, or one from outside (`module:Class`, an
    ONNX file); `sp_predictor_stream@60` is degraded until 60 % of its steps are right. Raises ValueError (its kinds) or
    OSError."""
    if is_foreign(name):
        return load_foreign_predictor(name, layout)
    base, _, wanted = name.rpartition("@")
    if not base or "/" in wanted:  # an @ in the path of a folder
        base, wanted = name, ""
    predictor, accuracy = _load(base, layout)
    return DegradedPredictor(predictor, accuracy, _share(name, wanted)) if wanted else predictor


def _load(name: str, layout: Layout) -> tuple[Predictor, float]:
    """Load a predictor, and return it with its accuracy."""
    if name == RANDOM:
        return UniformPredictor(), 1 / ACTIONS
    if name in SCRIPTED:
        return SCRIPTED[name](), 1.0
    folder = predictor_folder(name, layout)
    if not (folder / "config.json").is_file():
        known = ", ".join([*predictor_names(layout), RANDOM, *SCRIPTED])
        remedy = f"Known there: {known}; or give the folder that `kitchenmind train predictor` wrote."
        raise UnknownPredictor(f"{layout.name} has no predictor {name!r}. {remedy}")
    return load_trained_predictor(folder, layout)


def predictor_folder(name: str, layout: Layout) -> Path:
    """Return where a predictor's checkpoint is: a path as it is, a bundled one among the weights, else a folder."""
    bundled = WEIGHTS / layout.name / name
    return Path(name) if "/" in name or (not bundled.is_dir() and Path(name).is_dir()) else bundled


def has_intentions(name: str, layout: Layout) -> bool:
    """Return whether the predictor called `name` predicts intentions, without loading weights. A Python class counts if
    it may have them: only its output can tell."""
    if is_foreign(name):
        return not name.endswith(".onnx")
    base = without_variant(name)
    if base == RANDOM or base in SCRIPTED:
        return base in SCRIPTED
    config = predictor_folder(base, layout) / "config.json"
    return config.is_file() and "intentions" in json.loads(config.read_text(encoding="utf-8"))


def predictor_names(layout: Layout) -> list[str]:
    """Return the trained predictors bundled for a layout."""
    return sorted(path.parent.name for path in (WEIGHTS / layout.name).glob("*_predictor_*/config.json"))


def _share(name: str, text: str) -> float:
    try:
        value = float(text) / 100
    except ValueError:
        raise UnknownPredictor(f"{name}: after @ comes the wanted accuracy in percent, e.g. @60.") from None
    if not 1 / ACTIONS <= value <= 1:
        raise UnknownPredictor(
            f"{name}: this accuracy is not possible. Give a percentage from {100 / ACTIONS:.0f} to 100."
        )
    return value


class UniformPredictor:
    """Guess: one action of each step, drawn by the state and the actions before it, is barely more likely than the
    others. Without it, the first action would always count as the likeliest, and every mark would point north. (The
    random condition draws from the episode's seed.)"""

    memory = 1

    def begin(self, slots: NDArray[np.intp]) -> None:
        """Do nothing: this predictor keeps no state."""

    def predict(
        self, slots: NDArray[np.intp], observations: Observations, last_actions: NDArray[np.int8]
    ) -> Predictions:
        answer = np.full((len(slots), STEPS, ACTIONS), (1 - _GUESS_MARGIN) / ACTIONS, np.float32)
        for row, (state, actions) in enumerate(zip(observations, last_actions, strict=True)):
            guesses = np.random.default_rng(_state_number(state, actions)).integers(ACTIONS, size=STEPS)
            answer[row, np.arange(STEPS), guesses] += np.float32(_GUESS_MARGIN)
        return answer


class DegradedPredictor:
    """A predictor degraded on purpose to a given accuracy. At some rate a step's prediction is replaced by another
    action than the most likely one, which is right in about one in five of the cases in which the predictor errs. With
    accuracy a and rate r the result is a(1-r) + (1-a) r / 5; r follows from it. Which steps are replaced depends on the
    state and the actions before it, so that a repeated call gives the same result.
    """

    def __init__(self, predictor: Predictor, accuracy: float, wanted: float) -> None:
        """`accuracy` as measured on unseen partners, `wanted` <= accuracy; both 0-1. Raises UnknownPredictor."""
        if wanted > accuracy:
            raise UnknownPredictor(
                f"the predictor reaches {accuracy:.0%}; a degraded version cannot reach {wanted:.0%}. Give a lower one."
            )
        self._predictor = predictor
        self.memory = int(getattr(predictor, "memory", 1))
        by_luck = (1 - accuracy) / (ACTIONS - 1)
        self._rate = min(1.0, (accuracy - wanted) / (accuracy - by_luck))

    def begin(self, slots: NDArray[np.intp]) -> None:
        self._predictor.begin(slots)

    def predict(
        self, slots: NDArray[np.intp], observations: Observations, last_actions: NDArray[np.int8]
    ) -> Predictions:
        answer = self._predictor.predict(slots, observations, last_actions).copy()
        for row, (state, actions) in enumerate(zip(observations, last_actions, strict=True)):
            draws = np.random.default_rng(_state_number(state, actions))
            for step in range(STEPS):
                if draws.random() < self._rate:
                    _mislead(answer[row, step], int(draws.integers(1, ACTIONS)))
        return answer

    def intentions(
        self, slots: NDArray[np.intp], observations: Observations, last_actions: NDArray[np.int8]
    ) -> Intentions:
        """Return the predictor's intentions. At the rate at which steps are replaced, the two intentions change places:
        that is the most plausible error."""
        if not isinstance(self._predictor, IntentionPredictor):
            return np.zeros((len(slots), INTENTIONS), INTENTION)
        answer = self._predictor.intentions(slots, observations, last_actions).copy()
        for row, (state, actions) in enumerate(zip(observations, last_actions, strict=True)):
            draws = np.random.default_rng([_INTENTION_DRAWS, _state_number(state, actions)])
            if draws.random() < self._rate and answer["probability"][row].all():
                swapped = answer[row, ::-1].copy()
                swapped["probability"] = answer["probability"][row]
                answer[row] = swapped
        return answer


def _state_number(state: NDArray[np.int8], actions: NDArray[np.int8]) -> int:
    """Return a hash of a state and the actions before it."""
    return zlib.crc32(state.tobytes(), zlib.crc32(actions.tobytes()))


def _mislead(action_distribution: NDArray[np.float32], shift: int) -> None:
    """Make another action the most likely: the two probabilities change places."""
    right = int(action_distribution.argmax())
    wrong = (right + shift) % ACTIONS
    action_distribution[right], action_distribution[wrong] = action_distribution[wrong], action_distribution[right]
