"""`kitchenmind train bundle`: put the finished training of a study among the bundled weights."""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    parser.add_argument(
        "--kept", type=Path, required=True, metavar="DIR", help="the folder that `train study --keep` wrote"
    )
    parser.add_argument("--preset", default="published", help="its preset or .toml file (default: published)")
    parser.add_argument("--layouts", nargs="+", required=True, metavar="LAYOUT", help="these layouts")
    parser.add_argument(
        "--trajectories", type=int, default=5, help="number of trajectories for each partner and setting (default: 5)"
    )
    parser.add_argument("--timesteps", type=int, default=800, help="length of a trajectory (default: 800)")


def run(arguments: argparse.Namespace) -> int:
    """Return 0. Raises ValueError or OSError for wrong input."""
    import torch

    from overcooked.layout import load_layout
    from training.bundle import bundle
    from training.collect import CollectionPlan
    from training.pipeline.presets import load_preset

    torch.set_num_threads(1)
    plan, preset = CollectionPlan(arguments.trajectories, arguments.timesteps), load_preset(arguments.preset)
    for name in arguments.layouts:
        bundle(arguments.kept, load_layout(name), preset, plan, lambda line: print(line, flush=True))
    return 0
