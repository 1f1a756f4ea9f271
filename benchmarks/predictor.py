"""Predictions a second on one core, both forms, for 1, 8, 64 and 256 games: python benchmarks/predictor.py [--json].

Seconds of CPU, so that a busy machine does not count.
"""

import argparse
import json
import os
import time

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy asks

import numpy as np
import torch

from models.inference.predictor_numpy import numpy_predictor
from models.networks.config import PredictorConfig
from models.networks.predictor import PredictorNetwork
from overcooked.layout import load_layout
from overcooked.state import Kitchens

GAMES = (1, 8, 64, 256)


def predictions_per_second(form: str, layout_name: str, games: int, seconds: float) -> float:
    """Return the median over rounds of ten timesteps, each with new states, as a worker is asked."""
    layout = load_layout(layout_name)
    torch.manual_seed(0)
    config = PredictorConfig(form=form)
    tensors = {name: tensor.numpy() for name, tensor in PredictorNetwork(layout, config).state_dict().items()}
    predictor = numpy_predictor(config, tensors, layout)
    slots = np.arange(games)
    observations = Kitchens.start(layout, games).encode()[:, 0].copy()
    actions = np.random.default_rng(0).integers(0, 6, (games, 2)).astype(np.int8)
    predictor.begin(slots)
    rounds: list[float] = []
    finish = time.perf_counter() + seconds
    while time.perf_counter() < finish or len(rounds) < 5:
        began = time.process_time()
        for _ in range(10):
            predictor.predict(slots, observations, actions)
        rounds.append((time.process_time() - began) / 10)
    return float(games / np.median(rounds))


def main() -> None:
    parser = argparse.ArgumentParser(allow_abbrev=False, description=__doc__)
    parser.add_argument("--json", action="store_true", help="a list of {form, layout, games, per_second}")
    parser.add_argument("--layout", default="coordination_ring")
    parser.add_argument("--seconds", type=float, default=2.0, help="measured for each figure")
    arguments = parser.parse_args()
    rows = [
        {
            "form": form,
            "layout": arguments.layout,
            "games": games,
            "per_second": round(predictions_per_second(form, arguments.layout, games, arguments.seconds)),
        }
        for form in ("window", "stream")
        for games in GAMES
    ]
    if arguments.json:
        print(json.dumps(rows))
        return
    for row in rows:
        print(f"{row['form']:8} {row['games']:4} games  {row['per_second']:7,} predictions/s")


if __name__ == "__main__":
    main()
