"""Measuring agents."""

import numpy as np
import pytest

from models.agents.catalogue import load_agent
from models.protocols import Mode, Observations, Probabilities
from overcooked.constants import INTERACT, STAY
from overcooked.layout import load_layout, parse_layout
from training.evaluate_agents import EvaluatedAgent, measured, measured_with, play, with_itself, with_partners

RINGS = load_layout("double_rings")


class Presser:
    """Always interacts."""

    def probabilities(self, observations: Observations) -> Probabilities:
        action_distribution = np.full((len(observations), 6), 0.02, np.float32)
        action_distribution[:, INTERACT] = 0.9
        return action_distribution


def test_the_same_seed_gives_the_same_games_and_another_seed_others() -> None:
    noisy = EvaluatedAgent(load_agent("planner", RINGS).policy, Mode(temperature=0.0, stuck_after=2, stuck_mix=0.9))
    first, again, other = (play(RINGS, (noisy, noisy), 2, seed, horizon=100) for seed in (0, 0, 1))
    assert (first.scores.tolist(), first.certainty) == (again.scores.tolist(), again.certainty)
    assert first.certainty != other.certainty


def test_certainty_and_jams_show_an_agent_that_never_moves() -> None:
    rigid = with_itself(RINGS, EvaluatedAgent(Presser(), Mode(0.0, 3, 0.0)), episodes=2)
    assert (rigid.scores == 0).all()
    assert rigid.certainty == pytest.approx(1.0)
    assert rigid.longest_jam >= 398
    loose = with_itself(RINGS, EvaluatedAgent(Presser(), Mode(0.0, 3, 0.8)), episodes=2)
    assert loose.longest_jam < 100
    assert loose.certainty < 1.0


def test_points_with_partners_come_by_partner_seat_and_mode() -> None:
    planner = EvaluatedAgent(*load_agent("planner", RINGS))
    stay = load_agent("stay", RINGS).policy
    points = with_partners(RINGS, planner, [stay, planner.policy], episodes=1, timesteps=200)
    assert points.shape == (2, 2, 2)
    assert points[1].mean() > points[0].mean()


def test_an_entry_has_what_the_command_prints() -> None:
    entry = measured(
        RINGS, "planner", EvaluatedAgent(*load_agent("planner", RINGS)), [Presser()], episodes=2, timesteps=200
    )
    assert entry["layout"] == "double_rings"
    assert entry["agent"] == "planner"
    assert entry["episodes"] == 2
    assert set(entry["self_play"]) == set(entry["held_out"]) == {"mean", "se"}
    assert entry["self_play"]["mean"] > entry["held_out"]["mean"]


class Standing:
    """Never moves."""

    def probabilities(self, observations: Observations) -> Probabilities:
        return np.eye(6, dtype=np.float32)[[STAY] * len(observations)]


def test_an_agent_meets_the_partner_in_both_seats_and_the_partner_acts_as_its_card_says() -> None:
    """In this kitchen, only chef 1 can reach anything."""
    layout = parse_layout("XXXPX\nX1  O\nXDXSX\nX2  X\nXXXXX", "one")
    planner, standing = EvaluatedAgent(*load_agent("planner", layout)), EvaluatedAgent(Standing(), Mode(0.0, 400, 0.0))
    entry = measured_with(layout, "planner", planner, "standing", standing, (2, 400))
    first, second = entry["with_partner"]["seats"]
    assert first["mean"] > 0 == second["mean"]
    assert entry["with_partner"]["mean"] == pytest.approx(first["mean"] / 2, abs=0.1)
    assert (entry["agent"], entry["partner"], entry["episodes"]) == ("planner", "standing", 2)
