"""What a predictor says about intentions is checked before it is used."""

import numpy as np
import pytest

from models.inference.checked_output import WrongOutput, checked_intentions
from models.protocols import INTENTION

SLOTS, STATES, ACTIONS = np.arange(1), np.zeros((1, 5, 4, 26), np.int8), np.zeros((1, 2), np.int8)
NONE = (0, -1, -1, 0, 0.2)


class Saying:
    def __init__(self, answer):
        self.answer = answer

    def begin(self, slots):
        pass

    def predict(self, slots, observations, last_actions):
        raise NotImplementedError

    def intentions(self, slots, observations, last_actions):
        return self.answer


def checked(*intentions):
    return checked_intentions(Saying(np.array([list(intentions)], INTENTION)), SLOTS, STATES, ACTIONS)


def test_interactions_within_the_kitchen_and_none_pass():
    assert checked((4, 4, 3, 20, 0.8), NONE).tolist() == [
        [(4, 4, 3, 20, np.float32(0.8)), (0, -1, -1, 0, np.float32(0.2))]
    ]


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        ((1, 4, 3, 5, np.nan), "not between 0 and 1"),
        ((1, 4, 3, 5, 1.5), "not between 0 and 1"),
        ((8, 4, 3, 5, 0.5), "unknown kind"),
        ((1, 5, 3, 5, 0.5), "beyond the kitchen"),
        ((1, 4, 3, 0, 0.5), "not in 1-20"),
        ((1, 4, 3, 21, 0.5), "not in 1-20"),
    ],
)
def test_impossible_intentions_are_refused(wrong, reason):
    with pytest.raises(WrongOutput, match=reason):
        checked(wrong, NONE)


def test_intentions_of_another_shape_are_refused():
    with pytest.raises(WrongOutput, match=r"shape \(1, 1\)"):
        checked(NONE)
