"""The decoder of intentions in numpy: the two most likely interactions of each game, and when they happen."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from models.inference.layers_numpy import Floats, NamedWeights
from models.protocols import INTENTION, INTENTIONS, Intentions
from overcooked.interactions import possible_interactions
from overcooked.layout import Layout

_HALF: Final = 0.5


class NumpyIntentions:
    """`models.networks.intentions` in numpy; a test compares the results of the two."""

    def __init__(self, weights: NamedWeights, layout: Layout) -> None:
        """Raises KeyError or ValueError where the weights are not those of a decoder for this kitchen."""
        self._norm = weights.norm("intentions.norm")
        self._first, self._classes = weights.linear("intentions.first"), weights.linear("intentions.classes")
        self._when_first, self._when = weights.linear("intentions.when_first"), weights.linear("intentions.when")
        self._when_class = weights.array("intentions.when_class.weight")
        self._temperature = weights.array("intentions.temperature")
        self._possible = np.zeros(len(possible_interactions(layout)), INTENTION)
        for place, interaction in enumerate(possible_interactions(layout)):
            self._possible[place] = (*interaction, 0, 0)
        if len(self._possible) != len(self._when_class):
            raise ValueError(f"the kitchen has {len(self._possible)} interactions, not {len(self._when_class)}")

    def __call__(self, tokens: Floats) -> Intentions:
        """Tokens of all layers (games, layers * hidden) to (games, INTENTIONS)."""
        inside = self._first(self._norm(tokens))
        np.maximum(inside, 0, out=inside)
        probabilities = _softmax(self._classes(inside) / self._temperature[0])
        best = np.argsort(-probabilities, axis=-1, kind="stable")[:, :INTENTIONS]
        answer = self._possible[best]
        answer["probability"] = np.take_along_axis(probabilities, best, -1)
        answer["steps"] = np.where(best > 0, self._median_steps(inside, best), 0)
        return answer

    def _median_steps(self, inside: Floats, classes: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return in how many timesteps each class (games, INTENTIONS) is done: the median, which has the smallest mean
        absolute error."""
        both = self._when_first(inside)[:, None] + self._when_class[classes]
        np.maximum(both, 0, out=both)
        when = _softmax(self._when(both.reshape(-1, both.shape[-1])) / self._temperature[1])
        steps: NDArray[np.intp] = 1 + (when.cumsum(-1) < _HALF).sum(-1)
        return np.minimum(steps, when.shape[-1]).reshape(classes.shape)


def _softmax(logits: Floats) -> Floats:
    powers = np.exp(logits - logits.max(-1, keepdims=True))
    return np.asarray(powers / powers.sum(-1, keepdims=True), np.float32)
