"""Speed of the kitchen on one core, and the time until a process plays its first step.

    python benchmarks/engine.py [--layout NAME] [--quick] [--json]

Run it on a quiet machine; it pins itself to one core. "step": rules only. "play": rules, scores, episode sums,
auto-reset and both encodings. "first_step_s": from process start to the end of the first step and encoding, warm cache.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np

from overcooked.layout import Layout, load_layout
from overcooked.state import Kitchens
from overcooked.vector_env import VectorEnv

GAMES = (1, 64, 1024, 4096)
STEPS_A_MEASUREMENT, QUICK_STEPS = 400_000, 20_000
REPEATS = 5
GOALS = {"step": 6e6, "play": 2e6, "first_step_s": 1.0}

FIRST_STEP = """
import sys, numpy as np
from overcooked.layout import load_layout
from overcooked.state import Kitchens
kitchen = Kitchens.start(load_layout(sys.argv[1]))
kitchen.step(np.zeros((1, 2), np.int8), np.zeros((1, 2), np.int32))
kitchen.encode()
"""


def steps_a_second(step: Callable[[int], None], games: int, steps: int) -> float:
    """Return the best of several measurements, because other work on the machine can only slow it down."""
    step(0)
    rounds = max(2, steps // games)
    best = float("inf")
    for _ in range(REPEATS):
        started = time.perf_counter()
        for k in range(rounds):
            step(k)
        best = min(best, time.perf_counter() - started)
    return rounds * games / best


def measure(layout: Layout, games: int, steps: int) -> dict[str, float]:
    actions = np.random.default_rng(0).integers(0, 6, (64, games, 2), dtype=np.int8)
    kitchens, events = Kitchens.start(layout, games), np.zeros((games, 2), np.int32)
    env = VectorEnv(layout, games)
    sparse, shaped, dones = np.zeros((games, 2), np.int32), np.zeros((games, 2), np.int32), np.zeros(games, bool)
    observations = np.zeros((games, *env.observation_shape), np.int8)
    return {
        "games": games,
        "step": steps_a_second(lambda k: kitchens.step(actions[k % 64], events), games, steps),
        "play": steps_a_second(lambda k: env.step(actions[k % 64], sparse, shaped, dones, observations), games, steps),
    }


def first_step_s(layout: str, runs: int) -> float:
    """Return the wall time of a fresh process; the first of the runs fills the cache, the best of the others counts."""
    times = []
    for _ in range(1 + runs):
        started = time.perf_counter()
        subprocess.run([sys.executable, "-c", FIRST_STEP, layout], check=True)
        times.append(time.perf_counter() - started)
    return min(times[1:])


def main() -> None:
    parser = argparse.ArgumentParser(allow_abbrev=False, description=__doc__.split("\n")[0])
    parser.add_argument("--layout", default="coordination_ring")
    parser.add_argument("--quick", action="store_true", help="fewer steps: rough figures")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    steps = QUICK_STEPS if arguments.quick else STEPS_A_MEASUREMENT
    rows = [measure(load_layout(arguments.layout), games, steps) for games in GAMES]
    first = first_step_s(arguments.layout, runs=1 if arguments.quick else 3)
    if arguments.json:
        print(json.dumps({"layout": arguments.layout, "steps_per_s": rows, "first_step_s": first, "goals": GOALS}))
        return
    print(f"{arguments.layout}, one core, million steps/s")
    print(f"{'games':>6} {'step':>7} {'step + encodings + auto-reset':>30}")
    for row in rows:
        print(f"{row['games']:>6} {row['step'] / 1e6:>7.2f} {row['play'] / 1e6:>30.2f}")
    print(f"first step {first:.2f} s after process start")
    print(f"to reach: {GOALS['step'] / 1e6:g}, {GOALS['play'] / 1e6:g} and {GOALS['first_step_s']:g} s")


if __name__ == "__main__":
    main()
