"""How fast agents learn on one core: PPO timesteps per second with both networks, and the time to 200 points.

    taskset -c 0 python benchmarks/training.py [--json] [--seeds 3] [--precision float32]

Self-play on the smallest and the largest of the study's kitchens; the clock starts after the first iteration
(compilation) and counts the process's own seconds. The processor and what the run chose to compute with are printed
with the figures. For comparison, on one core with AVX-512: JaxMARL's IPPO (64-64 MLP) 20,800 timesteps/s, 76 points
after 1 million.
"""

import argparse
import importlib
import json
import statistics
import sys
import time
from pathlib import Path
from typing import Any

import torch

# This file has the name of the package that it measures: remove its folder from the module search path.
ROOT = Path(__file__).resolve().parent.parent
sys.path[:] = [str(ROOT), *(folder for folder in sys.path if Path(folder).resolve() != ROOT / "benchmarks")]
if __name__ == "training":
    del sys.modules[__name__]
    importlib.import_module(__name__)

from benchmarks.processor import described  # noqa: E402
from overcooked.layout import load_layout  # noqa: E402
from training.agent_config import AgentConfig, agent_config, network_config  # noqa: E402
from training.compute import request  # noqa: E402
from training.fast_networks import choose_compute  # noqa: E402
from training.ppo import PpoTrainer  # noqa: E402

LAYOUT = "coordination_ring"
RATED = ("coordination_ring", "matrix")
WANTED = 200.0
_MAX_S = 300.0


def main() -> None:
    """Print a table, or one JSON object."""
    parser = argparse.ArgumentParser(allow_abbrev=False, description=__doc__)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--seeds", type=int, default=3, help="runs of the time to 200 points")
    parser.add_argument("--seconds", type=float, default=8.0, help="of each rate")
    parser.add_argument("--precision", default="auto", help="auto, float32 or bfloat16")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    request("cpu", arguments.precision)
    figures = {
        "processor": described(),
        "rates": [_rate(name, config, layout, arguments.seconds) for name, config in _networks() for layout in RATED],
        "to_200_points": [
            {"network": name, **_time_to_wanted(config, seed)}
            for name, config in _networks()
            for seed in range(1, arguments.seeds + 1)
        ],
    }
    print(json.dumps(figures) if arguments.json else _table(figures))


def _networks() -> list[tuple[str, AgentConfig]]:
    return [("mlp", AgentConfig()), ("cnn", agent_config("cnn"))]


def _rate(name: str, config: AgentConfig, layout: str, seconds: float) -> dict[str, Any]:
    """Return timesteps per second of CPU: the median iteration, so a busy machine does not count."""
    grid = load_layout(layout)
    compute, measured = choose_compute(network_config(config), grid)
    trainer = PpoTrainer(config, grid, 0, compute=compute)
    trainer.iteration()
    times = []
    end = time.perf_counter() + seconds
    while time.perf_counter() < end or len(times) < 3:
        began, before = time.process_time(), trainer.timesteps
        trainer.iteration()
        times.append((time.process_time() - began) / (trainer.timesteps - before))
    rate = round(1 / statistics.median(times))
    return {
        "network": name, "layout": layout, "timesteps_per_s": rate, "compute": str(compute), "milliseconds": measured
    }  # fmt: skip


def _time_to_wanted(config: AgentConfig, seed: int) -> dict[str, Any]:
    """CPU seconds and timesteps until the mean training reward (sampled actions) is 200 points per episode."""
    config = config.changed(
        {"total_timesteps": 2_500_000, "shaping_timesteps": 1_500_000, "ent_coef_timesteps": 1_500_000}, "benchmark"
    )
    trainer = PpoTrainer(config, load_layout(LAYOUT), seed)
    trainer.iteration()
    began, mean = time.process_time(), 0.0
    while mean < WANTED and time.process_time() - began < _MAX_S and trainer.timesteps < config.total_timesteps:
        metrics = trainer.iteration()
        mean = 0.8 * mean + 0.2 * metrics.get("reward", mean)
    seconds = time.process_time() - began
    return {"seed": seed, "reached": mean >= WANTED, "cpu_s": round(seconds, 1), "timesteps": trainer.timesteps}


def _table(figures: dict[str, Any]) -> str:
    lines = [figures["processor"]]
    for rate in figures["rates"]:
        what = f"PPO, {rate['network']}, {rate['layout']}"
        lines.append(f"{what}: {rate['timesteps_per_s']:,} timesteps/s of CPU ({rate['compute']})")
    for run in figures["to_200_points"]:
        what = "200 points" if run["reached"] else "200 points not reached"
        cost = f"{run['cpu_s']} CPU seconds, {run['timesteps']:,} timesteps"
        lines.append(f"{run['network']}, {what} with seed {run['seed']}: {cost}")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
