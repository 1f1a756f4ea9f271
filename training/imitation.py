"""Imitate the scripted planner before self-play, for kitchens in which random exploration finds the first soup too
late.
"""

import numpy as np
import torch
from torch import nn

from models.acting import Stuck, distribution, draw
from models.agents.planner import MODE, PlannerPolicy
from overcooked.constants import ACTIONS, PLAYERS
from overcooked.layout import Layout
from overcooked.vector_env import VectorEnv
from training.agent_config import AgentConfig
from training.fast_networks import FastPath

_GAMES, _TIMESTEPS = 48, 400
_SAMPLES = 1280  # in a gradient step


def imitate(fast: FastPath, optimizer: torch.optim.Optimizer, layout: Layout, config: AgentConfig, seed: int) -> None:
    """Minimise the cross-entropy to the actions of two planners, in games with some random actions for more varied
    states."""
    device = fast.compute.device
    entries, actions = (tensor.to(device) for tensor in _lessons(fast, layout, config.imitation_noise, seed))
    random = np.random.default_rng(seed)
    for _ in range(config.imitation_updates):
        chosen = torch.from_numpy(random.integers(len(actions), size=_SAMPLES)).to(device)
        logits, values = fast(entries[chosen])
        loss = nn.functional.cross_entropy(logits, actions[chosen], label_smoothing=0.1) + 0 * values.sum()
        optimizer.zero_grad()
        torch.autograd.backward(loss)
        optimizer.step()
    optimizer.state.clear()


def _lessons(fast: FastPath, layout: Layout, noise: float, seed: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Return the planners' observations and actions: entries (samples, columns) int8, actions (samples,)."""
    random = np.random.default_rng((seed, 1))
    env, planner = VectorEnv(layout, _GAMES, seed=seed), PlannerPolicy()
    seen = np.zeros((_GAMES, *env.observation_shape), np.int8)
    env.encode(seen)
    stuck = Stuck(env.kitchens.players.reshape(-1, 4))
    sparse, shaped = np.zeros((_GAMES, PLAYERS), np.int32), np.zeros((_GAMES, PLAYERS), np.int32)
    dones, entries, actions = np.zeros(_GAMES, np.bool_), [], []
    for _ in range(_TIMESTEPS):
        action_distributions = planner.probabilities(seen.reshape(-1, *seen.shape[2:]))  # (games * players, 6)
        entries.append(seen.reshape(PLAYERS * _GAMES, -1)[:, fast.columns])
        actions.append(action_distributions.argmax(axis=1))
        done = draw(distribution(action_distributions, stuck.counts, MODE), random.random(len(action_distributions)))
        disturbed = random.random(len(done)) < noise
        done[disturbed] = random.integers(ACTIONS, size=int(disturbed.sum()))
        env.step(done.reshape(_GAMES, PLAYERS), sparse, shaped, dones, seen)
        stuck.update(env.kitchens.players.reshape(-1, 4))
    return torch.from_numpy(np.concatenate(entries)), torch.from_numpy(np.concatenate(actions))
