"""PPO: play, estimate advantages, learn, repeat. Both chefs are the ego agent (self-play), or frozen partners
(`partners`) hold some seats.

The environment is in `threaded_env`, the compiled copying and drawing of a rollout in `rollout_buffer`, the network's
fast path in `fast_path`, the loss in `ppo_loss`, and a compiled copy of it in `fused_ppo_loss`.

Schulman et al. 2017; shaping as in Carroll et al. 2019: each chef's own shaped reward, faded out.
"""

import json
import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numba import njit
from numpy.typing import NDArray
from torch import Tensor, nn

from models.networks.policy import Network, build_network
from overcooked.constants import PLAYERS, USEFUL_DISH_PICKUP
from overcooked.layout import Layout
from overcooked.score import DISH_REWARD
from overcooked.vector_env import Starts
from training.agent_config import AgentConfig, network_config
from training.compute import Compute
from training.fast_networks import choose_compute, fast_path
from training.fused_ppo_loss import FusedLoss
from training.imitation import imitate
from training.partners import PartnerPool
from training.ppo_loss import ppo_loss
from training.rollout_buffer import Entries, draw, draw_only, gather
from training.runlog import RunError, RunFolder
from training.threaded_env import threaded_env, threads_for

Progress = Callable[[int, dict[str, float]], None]  # timesteps done, newest metrics


class SeatRows:
    """Which agent has which seat. Rows count the seats of all games: row = 2 * game + seat."""

    def __init__(self, config: AgentConfig, partners: PartnerPool | None) -> None:
        self_play = config.self_play_games if partners else config.num_envs
        taken = partners.count * partners.games if partners else 0
        self.games = self_play + taken
        both = np.arange(PLAYERS * self_play)
        games = np.arange(self_play, self.games)  # each partner's games lie together and its seat alternates
        self.ego = np.concatenate([both, PLAYERS * games + (games % 2)])  # (rows of the ego agent,)
        self.partner = PLAYERS * games + 1 - (games % 2)  # (rows of the partners,)


class PpoTrainer:
    """One run: the ego agent, its games and the state that a resumed run needs."""

    def __init__(
        self,
        config: AgentConfig,
        layout: Layout,
        seed: int,
        partners: PartnerPool | None = None,
        compute: Compute | None = None,  # None: the fastest, measured
    ) -> None:
        self.config, self.layout, self.seed, self.partners = config, layout, seed, partners
        self.compute = compute or choose_compute(network_config(config), layout)[0]
        torch.manual_seed(seed)
        self.network: Network = build_network(network_config(config), layout).to(self.compute.device)
        self.fast = fast_path(self.network, layout, self.compute)
        self.optimizer = torch.optim.Adam(self.network.parameters(), config.learning_rate, eps=1e-5, fused=True)
        self.seats = SeatRows(config, partners)
        starts = Starts(desynchronised=True, random_share=config.random_starts)
        self.env = threaded_env(layout, self.seats.games, starts, seed, threads_for(self.compute.device))
        self.timesteps = 0
        if config.imitation_updates:
            imitate(self.fast, self.optimizer, layout, config, seed)
        games, rows, T = self.seats.games, len(self.seats.ego), config.num_steps
        self.observations = np.zeros((games, *self.env.observation_shape), np.int8)
        self.env.encode(self.observations)
        # The rollout of the ego agent: (timesteps, rows) and one more value.
        self.entries = Entries((T + 1, rows, len(self.fast.columns)), self.compute.device)
        self.actions = np.zeros((T, rows), np.int64)
        self.log_probabilities = np.zeros((T, rows), np.float32)
        self.values = np.zeros((T + 1, rows), np.float32)
        self.rewards = np.zeros((T, rows), np.float32)
        self.dones = np.zeros((T, games), np.bool_)

    def iteration(self) -> dict[str, float]:
        """Collect one rollout and learn from it; return the metrics."""
        config = self.config
        random = np.random.default_rng((self.seed, self.timesteps))
        share = self.timesteps / config.total_timesteps
        began = time.perf_counter()
        rate = config.learning_rate * (1 - (1 - config.final_learning_rate) * share)
        for group in self.optimizer.param_groups:
            group["lr"] = rate
        entropy_weight = _falling(config.ent_coef, config.final_ent_coef, self.timesteps, config.ent_coef_timesteps)
        shaping = _falling(1.0, 0.0, self.timesteps, config.shaping_timesteps)
        self._play(random, shaping)
        dones = self.dones[:, self.seats.ego // PLAYERS]  # (timesteps, rows)
        advantages = advantage_estimates(self.rewards, self.values, dones, config.gamma, config.gae_lambda)
        metrics = self._learn(random, advantages, entropy_weight)
        self.timesteps += config.num_steps * self.seats.games
        finished = self.env.take_finished()
        whole = finished.timesteps == self.env.horizon
        if config.random_starts and (whole & finished.standard).any():
            whole &= finished.standard
        if whole.any():
            metrics["reward"] = float(finished.sparse[whole].mean())
            metrics["shaped"] = float(finished.shaped[whole].sum(1).mean())
        metrics |= {"timesteps": self.timesteps, "learning_rate": rate, "shaping": shaping}
        metrics["seconds"] = time.perf_counter() - began
        return metrics

    @torch.inference_mode()
    def _play(self, random: np.random.Generator, shaping: float) -> None:
        """Fill the buffers with `num_steps` timesteps of every game."""
        config, seats, games = self.config, self.seats, self.seats.games
        frozen = self.fast.frozen()
        flat = self.observations.reshape(PLAYERS * games, -1)  # (rows, width * height * 26), a view
        joint = np.zeros(PLAYERS * games, np.int8)
        uniform = random.random((config.num_steps, PLAYERS * games))
        sparse, shaped = np.zeros((games, PLAYERS), np.float32), np.zeros((games, PLAYERS), np.float32)
        partner_columns = self.partners.columns if self.partners else None
        partner_entries = np.zeros(
            (len(seats.partner), 0 if partner_columns is None else len(partner_columns)), np.int8
        )
        for t in range(config.num_steps):
            gather(flat, seats.ego, self.fast.columns, self.entries.host[t])
            logits, values = frozen(self.entries.on_device(t))
            draw(logits.cpu().numpy(), uniform[t], seats.ego, joint, self.actions[t], self.log_probabilities[t])
            self.values[t] = values.cpu().numpy()
            if self.partners is not None:
                gather(flat, seats.partner, partner_columns, partner_entries)
                draw_only(self.partners.logits(partner_entries), uniform[t], seats.partner, joint)
            self.env.step(joint.reshape(games, PLAYERS), sparse, shaped, self.dones[t], self.observations)
            if config.dish_shaping != DISH_REWARD:
                shaped -= (DISH_REWARD - config.dish_shaping) * (self.env.events & USEFUL_DISH_PICKUP > 0)
            points = sparse.sum(1, keepdims=True) + shaping * shaped  # (games, players): the team's points, own shaping
            self.rewards[t] = config.reward_scale * points.reshape(-1)[seats.ego]
        gather(flat, seats.ego, self.fast.columns, self.entries.host[-1])
        self.values[-1] = frozen(self.entries.on_device(-1))[1].cpu().numpy()

    def _learn(
        self, random: np.random.Generator, advantages: NDArray[np.float32], entropy_weight: float
    ) -> dict[str, float]:
        """Make `update_epochs` passes over the rollout in shuffled minibatches."""
        config = self.config
        device = self.compute.device
        entries = self.entries.samples()  # (samples, columns)
        targets = torch.from_numpy(advantages + self.values[:-1]).flatten().to(device)
        advantage, actions, old = (
            torch.from_numpy(a).flatten().to(device) for a in (advantages, self.actions, self.log_probabilities)
        )
        loss_of = FusedLoss.apply if device == "cpu" else ppo_loss  # the same to the last rounding
        sums = torch.zeros(4, device=device)
        steps = 0
        for _ in range(config.update_epochs):
            order = torch.from_numpy(random.permutation(len(actions))).to(device)
            for chosen in torch.split(order, config.minibatch_size):
                if len(chosen) == 1:  # the last one: its advantage alone has no deviation to be normalised by
                    continue
                logits, values = self.fast(entries.index_select(0, chosen))
                loss, parts = loss_of(
                    logits,
                    values,
                    actions[chosen],
                    old[chosen],
                    advantage[chosen],
                    targets[chosen],
                    config,
                    entropy_weight,
                )
                self.optimizer.zero_grad()
                torch.autograd.backward(loss)
                nn.utils.clip_grad_norm_(self.network.parameters(), config.max_grad_norm, foreach=True)
                self.optimizer.step()
                sums += parts
                steps += 1
        names = ("policy_loss", "value_loss", "entropy", "clipped")
        return dict(zip(names, (sums / steps).tolist(), strict=True))

    def state(self) -> tuple[dict[str, Tensor], dict[str, Any]]:
        """Return what `restore` needs to continue exactly: network, optimizer, games."""
        tensors = {f"network.{name}": tensor for name, tensor in self.network.state_dict().items()}
        names = [name for name, _ in self.network.named_parameters()]
        for index, moments in self.optimizer.state_dict()["state"].items():
            tensors |= {f"optimizer.{names[index]}.{key}": value for key, value in moments.items()}
        for name, array in self.env.state().items():
            tensors[f"env.{name}"] = torch.from_numpy(_signed(array).copy())
        return tensors, {"timesteps": self.timesteps}

    def restore(self, tensors: dict[str, Tensor], numbers: dict[str, Any]) -> None:
        """Continue from `state`."""
        self.network.load_state_dict(_under(tensors, "network."))
        state = self.optimizer.state_dict()
        for index, (name, _) in enumerate(self.network.named_parameters()):
            state["state"][index] = _under(tensors, f"optimizer.{name}.")
        self.optimizer.load_state_dict(state)
        games = {name: array.copy() for name, array in self.env.state().items()}
        for name, array in games.items():
            _signed(array)[:] = tensors[f"env.{name}"].numpy()
        self.env.restore(games)
        self.env.encode(self.observations)
        self.timesteps = int(numbers["timesteps"])


def train(trainer: PpoTrainer, folder: RunFolder, progress: Progress | None = None, save_every_s: float = 60) -> None:
    """Train to the end of the config, continuing from the folder's state. Snapshots go to the folder. Raises RunError
    if training diverges."""
    config = trainer.config
    state = folder.load()
    if state is not None:
        trainer.restore(*state)
    (folder.path / "snapshots").mkdir(exist_ok=True)
    saved_at = time.monotonic()
    reward = _last_reward(folder)
    metrics: dict[str, float] = {}
    while trainer.timesteps < config.total_timesteps:
        kept_before = trainer.timesteps * config.snapshots // config.total_timesteps
        metrics = trainer.iteration()
        if not math.isfinite(metrics["policy_loss"] + metrics["value_loss"]):
            raise RunError(
                f"{folder.path}: training diverged at {trainer.timesteps:,} timesteps (the loss is not finite). Remove "
                "the folder and use a smaller learning_rate or reward_scale."
            )
        if "reward" in metrics:  # episodes end rarely: a running mean over about ten iterations
            reward = metrics["reward"] if reward is None else 0.8 * reward + 0.2 * metrics["reward"]
        metrics["mean_reward"] = reward or 0.0
        folder.log(metrics)
        if trainer.timesteps * config.snapshots // config.total_timesteps > kept_before:
            folder.snapshot(trainer.network.state_dict(), trainer.timesteps, metrics["mean_reward"])
        if time.monotonic() - saved_at > save_every_s:
            folder.save(*trainer.state())
            saved_at = time.monotonic()
        if progress is not None:
            progress(trainer.timesteps, metrics)
    folder.finish()


def run_settings(config: AgentConfig, layout: Layout, seed: int, partners: list[str]) -> dict[str, Any]:
    """Return the settings that identify a run; any change makes it another run."""
    settings = {
        "layout": layout.name,
        "grid": layout.text,
        "seed": seed,
        "partners": partners,
        "config": config.differences(),
    }
    return dict(json.loads(json.dumps(settings)))


@njit(cache=True)
def advantage_estimates(rewards, values, dones, gamma, gae_lambda):  # type: ignore[no-untyped-def]
    """Return advantages by generalised advantage estimation [Schulman et al. 2016]: (timesteps, rows) float32.

    `rewards`, `dones` (timesteps, rows); `values` (timesteps + 1, rows). `dones[t]`: the episode ended with timestep
    t, so nothing after it counts.
    """
    steps, rows = rewards.shape
    advantages = np.zeros((steps, rows), np.float32)
    running = np.zeros(rows, np.float32)
    for t in range(steps - 1, -1, -1):
        for row in range(rows):
            alive = np.float32(0.0) if dones[t, row] else np.float32(1.0)
            td_error = rewards[t, row] + gamma * values[t + 1, row] * alive - values[t, row]
            running[row] = td_error + gamma * gae_lambda * alive * running[row]
            advantages[t, row] = running[row]
    return advantages


def _falling(start: float, end: float, timesteps: int, over: int) -> float:
    share = min(1.0, timesteps / over) if over else 1.0
    return start + (end - start) * share


def _under(tensors: dict[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {name.removeprefix(prefix): tensor for name, tensor in tensors.items() if name.startswith(prefix)}


def _signed(array: NDArray[Any]) -> NDArray[Any]:
    return array.view(np.int64) if array.dtype == np.uint64 else array  # torch has little support for uint64


def _last_reward(folder: RunFolder) -> float | None:
    """Return the running mean, None if no episode has ended yet: a mean that began with 0 would be too low."""
    lines = folder.metrics()
    return lines[-1]["mean_reward"] if any("reward" in line for line in lines) else None
