"""Predictors without a network: uniform, the guide's, and a degraded one."""

import numpy as np
import pytest

from models.agents.predictors import (
    DegradedPredictor,
    UniformPredictor,
    UnknownPredictor,
    has_intentions,
    load_predictor,
)
from models.protocols import INTENTION
from overcooked.layout import load_layout

RING = load_layout("coordination_ring")
SLOTS = np.arange(4)


class Knowing:
    """Right in a known share of its steps: it reads the truth from the first cell of the observation."""

    memory = 1

    def __init__(self, accuracy):
        self.draws, self.accuracy = np.random.default_rng(0), accuracy

    def begin(self, slots):
        pass

    def predict(self, slots, observations, last_actions):
        answer = np.full((len(slots), 3, 6), 0.02, np.float32)
        for row, planes in enumerate(observations):
            for step in range(3):
                truth = int(planes[0, step, 0])
                right = self.draws.random() < self.accuracy
                answer[row, step, truth if right else (truth + self.draws.integers(1, 6)) % 6] = 0.9
        return answer


class PlanningPredictor(Knowing):
    """Also predicts an intention: an onion, or otherwise a dish."""

    def intentions(self, slots, observations, last_actions):
        return np.tile(np.array([(1, 0, 2, 5, 0.7), (2, 3, 4, 9, 0.2)], INTENTION), (len(slots), 1))


def measured(predictor, rounds=1500):
    draws, right = np.random.default_rng(1), 0
    for _ in range(rounds):
        observations = draws.integers(0, 6, (4, 5, 5, 26)).astype(np.int8)
        actions = draws.integers(0, 6, (4, 2)).astype(np.int8)
        answer = predictor.predict(SLOTS, observations, actions)
        right += (answer.argmax(-1) == observations[:, 0, :3, 0]).sum()
    return right / (rounds * 12)


@pytest.mark.parametrize(("accuracy", "wanted"), [(0.85, 0.6), (0.85, 0.3), (1.0, 0.5), (0.8, 0.8)])
def test_a_degraded_predictor_is_right_as_often_as_wanted(accuracy, wanted):
    assert measured(DegradedPredictor(Knowing(accuracy), accuracy, wanted)) == pytest.approx(wanted, abs=0.02)


def test_a_degraded_predictor_predicts_the_same_for_the_same_state():
    observations = np.random.default_rng(2).integers(0, 6, (4, 5, 5, 26)).astype(np.int8)
    actions = np.zeros((4, 2), np.int8)
    answers = [DegradedPredictor(Knowing(1.0), 1.0, 0.5).predict(SLOTS, observations, actions) for _ in range(2)]
    assert np.array_equal(*answers)
    assert np.allclose(answers[0].sum(-1), 1)


def test_a_degraded_accuracy_above_the_predictors_own_is_refused():
    with pytest.raises(UnknownPredictor, match="reaches 70%; a degraded version cannot reach 90%"):
        DegradedPredictor(Knowing(0.7), 0.7, 0.9)


def test_a_uniform_prediction_is_nearly_equal_and_each_action_is_its_likeliest_equally_often():
    observations = np.random.default_rng(4).integers(0, 6, (3000, 2, 2, 26)).astype(np.int8)
    actions = np.zeros((3000, 2), np.int8)
    answers = [UniformPredictor().predict(np.arange(3000), observations, actions) for _ in range(2)]
    assert np.array_equal(*answers)
    assert answers[0] == pytest.approx(1 / 6, abs=0.001)
    assert np.allclose(answers[0].sum(-1), 1)
    for step in range(3):  # what is drawn, and what counts as the prediction
        assert np.bincount(answers[0][:, step].argmax(-1)) / 3000 == pytest.approx(1 / 6, abs=0.03)


def test_names_lead_to_predictors_or_to_an_error_that_lists_them():
    assert isinstance(load_predictor("random", RING), UniformPredictor)
    assert isinstance(load_predictor("guide@60", RING), DegradedPredictor)
    with pytest.raises(UnknownPredictor, match=r"no predictor 'nobody'. Known there: .*random, guide"):
        load_predictor("nobody", RING)
    with pytest.raises(UnknownPredictor, match="in percent"):
        load_predictor("guide@much", RING)
    with pytest.raises(UnknownPredictor, match="percentage from 17 to 100"):
        load_predictor("guide@5", RING)


def test_a_degraded_predictor_puts_the_runner_up_first_as_often_as_it_replaces_steps():
    predictor = DegradedPredictor(PlanningPredictor(1.0), 1.0, 0.6)
    observations = np.random.default_rng(3).integers(0, 6, (2000, 2, 2, 26)).astype(np.int8)
    said = predictor.intentions(np.arange(2000), observations, np.zeros((2000, 2), np.int8))
    assert (said["kind"][:, 0] == 2).mean() == pytest.approx(0.4, abs=0.04)
    assert {one.tobytes() for one in said} == {
        np.array([(1, 0, 2, 5, 0.7), (2, 3, 4, 9, 0.2)], INTENTION).tobytes(),
        np.array([(2, 3, 4, 9, 0.7), (1, 0, 2, 5, 0.2)], INTENTION).tobytes(),
    }


def test_the_list_of_predictors_shows_which_have_intentions():
    assert has_intentions("guide", RING)
    assert has_intentions("guide@60", RING)
    assert not has_intentions("random", RING)
    assert not has_intentions("my_predictor.onnx", RING)
