"""The distribution from which agents draw their actions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.acting import SAMPLED, Stuck, distribution, draw
from models.protocols import Mode
from overcooked.constants import ACTIONS, STAY

GIVEN = np.array([[0.1, 0.2, 0.3, 0.15, 0.05, 0.2]], np.float32)


def test_temperature_zero_takes_the_likeliest_action() -> None:
    action_distribution = distribution(GIVEN, np.zeros(1, int), Mode(temperature=0.0))
    assert action_distribution.tolist() == [[0, 0, 1, 0, 0, 0]]


def test_temperature_one_leaves_the_probabilities_alone() -> None:
    np.testing.assert_allclose(distribution(GIVEN, np.array([99]), SAMPLED), GIVEN, atol=1e-6)


def test_a_low_temperature_sharpens() -> None:
    action_distribution = distribution(GIVEN, np.zeros(1, int), Mode(temperature=0.5))
    np.testing.assert_allclose(action_distribution, GIVEN**2 / (GIVEN**2).sum(), atol=1e-6)


def test_a_stuck_agent_shares_probability_among_the_four_moves_only() -> None:
    mode = Mode(temperature=0.0, stuck_after=3, stuck_mix=0.5)
    action_distribution = distribution(np.repeat(GIVEN, 2, axis=0), np.array([2, 3]), mode)
    assert action_distribution[0].tolist() == [0, 0, 1, 0, 0, 0]
    assert action_distribution[1].tolist() == [0.125, 0.125, 0.625, 0.125, 0, 0]


@given(
    st.lists(st.floats(0, 1), min_size=6, max_size=6).filter(lambda row: sum(row) > 0.01),
    st.floats(0, 1, exclude_max=True),
)
def test_draw_never_gives_an_action_without_probability(row: list[float], uniform: float) -> None:
    action_distribution = np.array([row], np.float32) / np.float32(sum(row))
    action = int(draw(action_distribution, np.array([uniform]))[0])
    assert 0 <= action < ACTIONS
    assert action_distribution[0, action] > 0


def test_draw_follows_the_distribution() -> None:
    uniform = (np.arange(20_000) + 0.5) / 20_000
    actions = draw(np.repeat(GIVEN, len(uniform), axis=0), uniform)
    np.testing.assert_allclose(np.bincount(actions, minlength=ACTIONS) / len(uniform), GIVEN[0], atol=1e-3)


def test_stuck_counts_timesteps_without_a_change_of_own_cell_facing_or_hand() -> None:
    own = np.array([[1, 1, 0, 0], [2, 2, 0, 0]], np.int8)
    stuck = Stuck(own)
    stuck.update(own)
    stuck.update(own)
    assert stuck.counts.tolist() == [2, 2]
    own[0, 2] = 3
    stuck.update(own)
    assert stuck.counts.tolist() == [0, 3]
    stuck.begin(np.array([1]), own)
    assert stuck.counts.tolist() == [0, 0]


@pytest.mark.parametrize("mode", [Mode(0.0, 1, 0.5), Mode(0.3, 2, 1.0), SAMPLED])
def test_every_distribution_sums_to_one(mode: Mode) -> None:
    random = np.random.default_rng(0)
    given = random.dirichlet(np.ones(ACTIONS), 50).astype(np.float32)
    action_distribution = distribution(given, random.integers(0, 5, 50), mode)
    np.testing.assert_allclose(action_distribution.sum(axis=1), 1, atol=1e-5)
    assert (action_distribution >= 0).all()
    assert action_distribution.dtype == np.float32
    assert STAY == 4  # the moves are the actions before it
