"""How deterministic an agent should be: points in self-play and with unseen partners, certainty and time stuck, by
mode.

    python benchmarks/agent_modes.py [--layout coordination_ring] [--agent sp] [--quick]

The partner is in the same mode as the agent. The figures behind `training.train_agent.PEOPLE`.
"""

import argparse

import numpy as np
import torch

from models.agents.catalogue import WEIGHTS, load_agent
from models.networks.policy import NetworkPolicy, load_network
from models.protocols import Mode
from overcooked.layout import load_layout
from training.evaluate_agents import EvaluatedAgent, PlayedGames, play, with_itself

MODES = (
    Mode(1.0, 8, 0.0),
    Mode(0.3, 8, 0.5),
    Mode(0.0, 8, 0.0),
    Mode(0.0, 3, 0.5),
    Mode(0.0, 4, 0.5),
    Mode(0.0, 6, 0.5),
    Mode(0.0, 8, 0.5),
    Mode(0.0, 12, 0.5),
)


def main() -> None:
    """Print a table, a row a mode."""
    parser = argparse.ArgumentParser(allow_abbrev=False, description=__doc__)
    parser.add_argument("--layout", default="coordination_ring")
    parser.add_argument("--agent", default="sp")
    parser.add_argument("--quick", action="store_true", help="two modes, few games: rough figures")
    arguments = parser.parse_args()
    own_games, games = (2, 4) if arguments.quick else (20, 8)
    torch.set_num_threads(1)
    layout = load_layout(arguments.layout)
    policy = load_agent(arguments.agent, layout).policy
    folders = sorted((WEIGHTS / layout.name / "population").glob("*_100"))
    unseen = [NetworkPolicy(load_network(folder)) for folder in folders]
    print("mode (temperature, after, mix)     self     unseen  certainty   stuck  longest jam")
    for mode in MODES[:2] if arguments.quick else MODES:
        me = EvaluatedAgent(policy, mode)
        own = with_itself(layout, me, own_games)
        others = [play(layout, (me, EvaluatedAgent(partner, mode)), games, 0) for partner in unseen]
        others += [play(layout, (EvaluatedAgent(partner, mode), me), games, 1) for partner in unseen]
        name = f"{mode.temperature:g}, {mode.stuck_after}, {mode.stuck_mix:g}"
        print(f"{name:32}{own.scores.mean():7.1f}{_points(others):11.1f}{_certainty(others):11.3f}", end="")
        print(f"{np.mean([games.stuck for games in others]):8.1%}{max(games.longest_jam for games in others):13d}")


def _points(games: list[PlayedGames]) -> float:
    return float(np.mean([some.scores.mean() for some in games]))


def _certainty(games: list[PlayedGames]) -> float:
    """Return the certainty of the agent in the first seat, from the first half of the games, in which it sat there."""
    return float(np.mean([some.certainty for some in games[: len(games) // 2]]))


if __name__ == "__main__":
    main()
