"""The accuracy of an observer who knows the action probabilities of both agents, but not their random draws.

    python benchmarks/accuracy_ceiling.py [--layout coordination_ring] [--partner human_bc] [--states 6000] [--json]

--partner test: with the test partners of the predictors, each deciding and sampling.

All possible courses of the next timesteps are enumerated with their probabilities: the probability of the most likely
action is the best possible accuracy. A predictor without the agents' policies stays below.
"""

import argparse
import json
import os
from collections.abc import Sequence
from dataclasses import replace

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy asks

import numpy as np
from numpy.typing import NDArray

from models.acting import GREEDY, SAMPLED, distribution
from models.agents.catalogue import LoadedAgent
from models.protocols import STEPS, Mode, Observations, Policy, Probabilities
from overcooked.constants import ACTIONS, HORIZON, PLAYERS
from overcooked.layout import Layout, load_layout
from overcooked.state import Kitchens
from training.collect import TEST, CollectionPlan, Partner, Target, games_with
from training.population import load_target
from training.publish_predictor import partners_in, population_folder, unseen_partners

LIKELY = 0.003  # courses less likely than this, of one timestep, are dropped
Ints = NDArray[np.integer]


def distribution_ahead(
    kitchens: Kitchens, agents: tuple[LoadedAgent, LoadedAgent], seat: Ints, stuck: Ints, timesteps: int
) -> Probabilities:
    """Return the first agent's action distribution in `timesteps`, (games, 6); it is in `seat` (games,), `stuck`
    (games, 2)."""
    games, seen = np.arange(kitchens.games), kitchens.encode()
    seats = np.stack([seat, 1 - seat])
    own = _distribution(agents[0].policy, agents[0].mode, seen[games, seats[0]], stuck[:, 0])
    if timesteps == 0:
        return own
    other = _distribution(agents[1].policy, agents[1].mode, seen[games, seats[1]], stuck[:, 1])
    joint = own[:, :, None] * other[:, None, :]
    game, *actions = np.nonzero(joint > LIKELY)
    share = joint[game, actions[0], actions[1]]
    before = kitchens.players[game]
    after = Kitchens(kitchens.layout, before.copy(), kitchens.contents[game].copy(), kitchens.timestep[game].copy())
    by_seat = np.zeros((len(game), PLAYERS), np.int8)
    rows = np.arange(len(game))
    for k in range(PLAYERS):
        by_seat[rows, seats[k, game]] = actions[k]
    after.step(by_seat, np.zeros((len(game), PLAYERS), np.int32))
    still = (after.players == before).all(-1)[rows[:, None], seats[:, game].T]  # (courses, 2), the agent's own first
    ahead = distribution_ahead(after, agents, seat[game], np.where(still, stuck[game] + 1, 0), timesteps - 1)
    action_distribution = np.zeros((kitchens.games, ACTIONS))
    np.add.at(action_distribution, game, share[:, None] * ahead)
    return np.asarray(action_distribution, np.float32)


def _distribution(policy: Policy, mode: Mode, seen: Observations, stuck: Ints) -> Probabilities:
    return distribution(policy.probabilities(np.ascontiguousarray(seen)), stuck, mode)


def limits(layout: Layout, agent: str, partner: str, states: int) -> list[float]:
    """Return the best accuracy (%) of each of the three steps, over `states` timesteps of the agent's games with
    `partner`: an agent, or `test` for all test partners, which have an equal share of the timesteps."""
    target, partners = load_target(agent, layout), partners_called(partner, layout)
    share = max(1, states // len(partners))
    found = [_limits_with(layout, target, one, share) for one in partners]
    return [round(100 * float(np.concatenate(step).mean()), 1) for step in zip(*found, strict=True)]


def partners_called(name: str, layout: Layout) -> list[Partner]:
    """Return an agent in the mode of studies, or for `test` every test partner in both modes of the collected games."""
    population = population_folder(layout)
    if name != TEST:
        return unseen_partners(layout, population, name)
    return [replace(one, mode=mode) for one in partners_in(TEST, layout, population) for mode in (GREEDY, SAMPLED)]


def _limits_with(layout: Layout, target: Target, partner: Partner, states: int) -> Sequence[NDArray[np.float32]]:
    """Return the probability of the most likely action in each of the chosen timesteps, for each step ahead."""
    if partner.mode is None:
        raise ValueError(f"{partner.name}: acts in two modes. Give it one.")
    games = games_with(layout, target, partner, CollectionPlan(trajectories=2))
    agents = LoadedAgent(target.policy, target.mode), LoadedAgent(partner.policy, partner.mode)
    seat = np.repeat(games["seat"][:, None], games["timestep"].shape[1], 1).astype(np.int64)
    early = np.flatnonzero(games["timestep"] < HORIZON - STEPS)
    chosen = np.random.default_rng(0).choice(early, min(states, len(early)), replace=False)
    at = {name: games[name].reshape(-1, *games[name].shape[2:])[chosen] for name in ("players", "contents", "stuck")}
    clock = games["timestep"].ravel()[chosen].astype(np.int32)
    best = []
    for step in range(STEPS):
        kitchens = Kitchens(layout, at["players"].copy(), at["contents"].copy(), clock.copy())
        stuck = at["stuck"].astype(np.int64)
        best.append(distribution_ahead(kitchens, agents, seat.ravel()[chosen], stuck, step).max(1))
    return best


def main() -> None:
    parser = argparse.ArgumentParser(
        allow_abbrev=False, description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--layout", default="coordination_ring")
    parser.add_argument("--partner", default="human_bc")
    parser.add_argument("--states", type=int, default=6000)
    parser.add_argument("--json", action="store_true", help="a list of {agent, partner, steps, mean}")
    arguments = parser.parse_args()
    rows = []
    for agent in ("sp", "fcp"):
        steps = limits(load_layout(arguments.layout), agent, arguments.partner, arguments.states)
        mean = round(sum(steps) / STEPS, 1)
        rows.append({"agent": agent, "partner": arguments.partner, "steps": steps, "mean": mean})
    if arguments.json:
        print(json.dumps(rows))
        return
    for row in rows:
        print(f"{row['agent']:4} with {row['partner']}: steps 1 to 3 at best {row['steps']}, mean {row['mean']}")


if __name__ == "__main__":
    main()
