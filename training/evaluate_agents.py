"""Measure agents' points: in self-play and with unseen partners, in the mode that studies use."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.acting import Stuck, distribution, draw
from models.protocols import Mode, Policy
from overcooked.constants import HORIZON, PLAYERS
from overcooked.layout import Layout
from overcooked.vector_env import VectorEnv


@dataclass(frozen=True)
class EvaluatedAgent:
    """An agent in an evaluation: its policy, and how actions are drawn from it."""

    policy: Policy
    mode: Mode


@dataclass(frozen=True)
class PlayedGames:
    """The results of some games; the second and third figure are about the chef of the first player given."""

    scores: NDArray[np.float64]  # (games,): points per 400 timesteps
    certainty: float  # mean of the largest probability of its action: the ceiling of a step-1 predictor
    stuck: float  # share of timesteps in which it was stuck
    longest_jam: int  # most timesteps in a row in which nothing about either chef changed


def play(
    layout: Layout, players: Sequence[EvaluatedAgent], games: int, seed: int, horizon: int = HORIZON
) -> PlayedGames:
    """Play `games` episodes of one pair from the standard start; `players` are in the order of the seats."""
    random = np.random.default_rng(seed)
    env = VectorEnv(layout, games, horizon=horizon + 1)  # never reset within: the last state stays
    observations = np.zeros((games, *env.observation_shape), np.int8)
    env.kitchens.encode(observations, horizon)
    stuck = [Stuck(env.kitchens.players[:, seat]) for seat in range(PLAYERS)]
    actions, dones = np.zeros((games, PLAYERS), np.int8), np.zeros(games, np.bool_)
    sparse, shaped = np.zeros((games, PLAYERS), np.int32), np.zeros((games, PLAYERS), np.int32)
    scores, certainty, stuck_share, longest = np.zeros(games), 0.0, 0.0, 0
    for _ in range(horizon):
        for seat, player in enumerate(players):
            seen = np.ascontiguousarray(observations[:, seat])
            action_distribution = distribution(player.policy.probabilities(seen), stuck[seat].counts, player.mode)
            actions[:, seat] = draw(action_distribution, random.random(games))
            if seat == 0:
                certainty += float(action_distribution.max(1).mean())
                stuck_share += float((stuck[0].counts >= player.mode.stuck_after).mean())
        env.step(actions, sparse, shaped, dones)
        env.kitchens.encode(observations, horizon)
        scores += sparse.sum(1)
        for seat in range(PLAYERS):
            stuck[seat].update(env.kitchens.players[:, seat])
        longest = max(longest, int(np.minimum(stuck[0].counts, stuck[1].counts).max()))
    return PlayedGames(scores * HORIZON / horizon, certainty / horizon, stuck_share / horizon, longest)


def with_itself(
    layout: Layout, player: EvaluatedAgent, episodes: int = 40, seed: int = 0, timesteps: int = HORIZON
) -> PlayedGames:
    """Measure self-play."""
    return play(layout, (player, player), episodes, seed, timesteps)


def with_partners(
    layout: Layout,
    player: EvaluatedAgent,
    partners: Iterable[Policy],
    episodes: int = 8,
    seed: int = 0,
    timesteps: int = HORIZON,
) -> NDArray[np.float64]:
    """Return mean points with each partner, (partners, 2 seats, 2 modes): the partner in our own mode, then
    sampling."""
    modes = (player.mode, replace(player.mode, temperature=1.0))

    def points(partner: EvaluatedAgent, seat: int) -> float:
        pair = (player, partner) if seat == 0 else (partner, player)
        return float(play(layout, pair, episodes, seed, timesteps).scores.mean())

    return np.array(
        [
            [[points(EvaluatedAgent(partner, mode), seat) for mode in modes] for seat in range(PLAYERS)]
            for partner in partners
        ]
    )


def measured(
    layout: Layout,
    name: str,
    player: EvaluatedAgent,
    partners: Sequence[Policy],
    episodes: int = 40,
    timesteps: int = HORIZON,
) -> dict[str, Any]:
    """Return one entry of `kitchenmind evaluate agents --json`: self-play over episodes, held-out over partners (with
    each of them at most 8 episodes a seat and mode)."""
    own = with_itself(layout, player, episodes, timesteps=timesteps).scores
    entry: dict[str, Any] = {"layout": layout.name, "agent": name, "self_play": _mean_se(own)}
    if partners:
        others = with_partners(layout, player, partners, min(8, episodes), timesteps=timesteps)
        entry["held_out"] = _mean_se(others.mean(axis=(1, 2)))
    return {**entry, "episodes": episodes}


def measured_with(
    layout: Layout, name: str, player: EvaluatedAgent, partner: str, other: EvaluatedAgent, games: tuple[int, int]
) -> dict[str, Any]:
    """Return one entry of `kitchenmind evaluate agents --partner ... --json`: self-play, and points with one partner,
    who acts as its card says, in both seats (first the entry in which the agent is chef 1). `games`: episodes a seat,
    and timesteps of each."""
    episodes, timesteps = games
    own = with_itself(layout, player, episodes, timesteps=timesteps).scores
    seats = [
        play(layout, pair, episodes, seed, timesteps).scores
        for seed, pair in enumerate(((player, other), (other, player)))
    ]
    errors = [values.std(ddof=1) / len(values) ** 0.5 if len(values) > 1 else 0.0 for values in seats]
    both = {
        "mean": round(float(np.mean(seats)), 1),
        "se": round(math.hypot(*errors) / PLAYERS, 1),
    }
    return {
        "layout": layout.name,
        "agent": name,
        "self_play": _mean_se(own),
        "partner": partner,
        "with_partner": {**both, "seats": [_mean_se(values) for values in seats]},
        "episodes": episodes,
    }


def _mean_se(values: NDArray[np.float64]) -> dict[str, float]:
    spread = values.std(ddof=1) / len(values) ** 0.5 if len(values) > 1 else 0.0
    return {"mean": round(float(values.mean()), 1), "se": round(float(spread), 1)}
