"""Training speed on a GPU, in under ten minutes: agents, predictors, and the time for the published recipe.

    python benchmarks/gpu.py [--json] [--device cuda] [--games 2048] [--seconds 40]

PPO with the paper's CNN on Matrix with at least 1,024 games at once; updates per second of both predictor forms on
made-up games; and how much of the published recipe (five kitchens, 17 agents of 10 million timesteps each, ten
predictors in two forms) one hour would do. On a machine without a GPU the same runs on the CPU, with fewer games.
"""

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch

ROOT = Path(__file__).resolve().parent.parent
sys.path[:] = [str(ROOT), *(folder for folder in sys.path if Path(folder).resolve() != ROOT / "benchmarks")]

from benchmarks.processor import described  # noqa: E402
from models.networks.config import PredictorConfig  # noqa: E402
from models.networks.predictor import PredictorNetwork  # noqa: E402
from overcooked.layout import Layout, load_layout  # noqa: E402
from training.agent_config import agent_config, network_config  # noqa: E402
from training.compute import request  # noqa: E402
from training.dataset import Episodes  # noqa: E402
from training.fast_networks import choose_compute  # noqa: E402
from training.ppo import PpoTrainer  # noqa: E402
from training.predictor_config import TrainingConfig  # noqa: E402
from training.train_predictor import PredictorTrainer as PredictorTrainer  # noqa: E402

LAYOUT = "matrix"
_KITCHENS, _AGENTS, _TIMESTEPS = 5, 17, 10_000_000  # of the published recipe
_UPDATES = 100 * 496_000 * 3 / 5 / 512  # of a window predictor: 100 epochs of the training split, 512 windows each
_EPISODES, _EPISODE = 60, 400  # of the made-up games


def main() -> None:
    """Print a table, or one JSON object."""
    parser = argparse.ArgumentParser(allow_abbrev=False, description=__doc__)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--device", default="auto", help="auto, cpu, cuda or mps")
    parser.add_argument("--games", type=int, default=0, help="at once (default: 2048 on a GPU, 64 on a CPU)")
    parser.add_argument("--seconds", type=float, default=40.0, help="of each measurement")
    arguments = parser.parse_args()
    device = request(arguments.device).chosen_device()
    if device == "cpu":
        torch.set_num_threads(1)
    games = arguments.games or (64 if device == "cpu" else 2048)
    layout = load_layout(LAYOUT)
    figures: dict[str, Any] = {"machine": described(), "device": device}
    figures["agents"] = _agent_rate(layout, games, arguments.seconds)
    figures["predictors"] = [_predictor_rate(layout, form, arguments.seconds) for form in ("window", "stream")]
    figures["hour"] = _share_of_recipe(figures)
    print(json.dumps(figures) if arguments.json else _table(figures))


def _agent_rate(layout: Layout, games: int, seconds: float) -> dict[str, Any]:
    """Return timesteps per second of PPO with the paper's CNN, the minibatch grown with the number of games."""
    config = agent_config("cnn")
    size = config.minibatch_size * max(1, games // config.num_envs)
    config = config.model_copy(update={"num_envs": games, "minibatch_size": size})
    compute, measured = choose_compute(network_config(config), layout)
    trainer = PpoTrainer(config, layout, 0, compute=compute)
    trainer.iteration()
    began, before = time.perf_counter(), trainer.timesteps
    while time.perf_counter() - began < seconds:
        trainer.iteration()
    rate = (trainer.timesteps - before) / (time.perf_counter() - began)
    return {
        "network": "cnn", "layout": layout.name, "games": games, "timesteps_per_s": round(rate),
        "compute": str(compute), "milliseconds": measured,
    }  # fmt: skip


def _predictor_rate(layout: Layout, form: str, seconds: float) -> dict[str, Any]:
    """Return updates per second of a predictor's training."""
    network = PredictorNetwork(layout, PredictorConfig(form=form, eyes="cnn"))
    trainer = PredictorTrainer(
        network, TrainingConfig(), _made_up(network.encoder.size), _made_up(network.encoder.size)
    )
    trainer.step()
    began, before = time.perf_counter(), trainer.update
    while time.perf_counter() - began < seconds:
        trainer.step()
    rate = (trainer.update - before) / (time.perf_counter() - began)
    return {"form": form, "updates_per_s": round(rate, 2), "compute": str(trainer.compute)}


def _made_up(size: int) -> Episodes:
    """Return games of random features and actions: the cost of an update does not depend on the data."""
    random = np.random.default_rng(0)
    return Episodes(
        torch.from_numpy(random.random((_EPISODES, _EPISODE, size), np.float32)).half(),
        random.integers(6, size=(_EPISODES, _EPISODE, 2)).astype(np.int8),
        random.integers(6, size=(_EPISODES, _EPISODE)).astype(np.int8),
        np.ones((_EPISODES, _EPISODE), np.float32),
        np.zeros((_EPISODES, _EPISODE, 2), np.int16),
    )


def _share_of_recipe(figures: dict[str, Any]) -> dict[str, float]:
    """Return the hours of the whole published recipe with the CNN everywhere and 100 epochs, and what one hour does of
    it."""
    agents = _KITCHENS * _AGENTS * _TIMESTEPS / figures["agents"]["timesteps_per_s"] / 3600
    window = next(row for row in figures["predictors"] if row["form"] == "window")
    predictors = 2 * _KITCHENS * _UPDATES / window["updates_per_s"] / 3600
    whole = agents + predictors
    return {
        "hours_agents": round(agents, 1), "hours_predictors": round(predictors, 1), "share": round(min(1, 1 / whole), 4)
    }  # fmt: skip


def _table(figures: dict[str, Any]) -> str:
    agents, hour = figures["agents"], figures["hour"]
    lines = [
        f"{figures['machine']}; device {figures['device']}",
        f"PPO, cnn, {agents['layout']}, {agents['games']:,} games: {agents['timesteps_per_s']:,} timesteps/s"
        f" ({agents['compute']})",
        *(
            f"predictor, {row['form']}: {row['updates_per_s']} updates/s ({row['compute']})"
            for row in figures["predictors"]
        ),
        f"published recipe, CNN everywhere, 100 epochs: {hour['hours_agents']} h of agents,"
        f" {hour['hours_predictors']} h of predictors; an hour does {hour['share']:.1%}",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
