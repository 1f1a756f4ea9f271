"""`kitchenmind train compact`: store a trained predictor in half the bytes."""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    parser.add_argument("--predictor", type=Path, metavar="FOLDER", required=True, help="a predictor's folder")
    parser.add_argument(
        "--agent",
        help="the predicted agent, as it was given to `kitchenmind collect` (default: the name in the folder)",
    )
    parser.add_argument("--population", type=Path, help="folder of partner agents (default: the bundled ones)")
    parser.add_argument(
        "--partners", type=Path, metavar="DIR", help="use the agents of this folder instead; at least three"
    )
    parser.add_argument(
        "--trajectories", type=int, default=5, help="number of trajectories for each partner and setting (default: 5)"
    )
    parser.add_argument("--timesteps", type=int, default=800, help="length of a trajectory (default: 800)")
    parser.add_argument("--out", type=Path, help="write it here (default: in its own folder)")


def run(arguments: argparse.Namespace) -> int:
    """Return 0. Raises ValueError or OSError for wrong input."""
    import torch

    from training.collect import CollectionPlan
    from training.compact_predictor import compact

    torch.set_num_threads(1)
    out = arguments.out or arguments.predictor
    plan = CollectionPlan(arguments.trajectories, arguments.timesteps)
    done = compact(arguments.predictor, out, plan, arguments.agent, arguments.population, arguments.partners)
    print(
        f"{out}: {done.bytes_before:,} to {done.bytes_after:,} bytes; right with unseen partners in {done.before:.2%} "
        f"before, {done.after:.2%} now"
    )
    return 0
