"""`kitchenmind collect`: the games of one agent with its partners, from which a predictor learns."""

import argparse
import sys
from pathlib import Path

from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from training.command_errors import error_message, refuse_below


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    parser.add_argument("--layout", required=True, help="a bundled layout or a .layout file")
    parser.add_argument(
        "--agent", required=True, help="bundled agent, checkpoint folder, ONNX file, module:Class or URL"
    )
    parser.add_argument("--population", type=Path, help="folder of partner agents (default: the bundled ones)")
    parser.add_argument(
        "--partners", type=Path, metavar="DIR", help="use the agents of this folder instead; at least three"
    )
    parser.add_argument("--out", type=Path, help="folder for the games (default: runs/games/LAYOUT_AGENT)")
    parser.add_argument("--runs", type=Path, default=Path("runs"), help=argparse.SUPPRESS)
    parser.add_argument(
        "--trajectories", type=int, default=5, help="number of trajectories for each partner and setting (default: 5)"
    )
    parser.add_argument("--timesteps", type=int, default=800, help="length of a trajectory (default: 800)")
    parser.add_argument("--seed", type=int, default=0, help="random seed (default: 0)")
    parser.add_argument("--device", default="auto", help="auto (default), cpu, cuda or mps")
    parser.add_argument(
        "--extra",
        type=Path,
        nargs="*",
        default=[],
        metavar="FOLDER",
        help="more partner agents, used for training only",
    )
    parser.add_argument(
        "--no-extras", action="store_true", help="only the paper's partners, without noisy and scripted ones"
    )


def run(arguments: argparse.Namespace) -> int:
    """Return 0 if done, 2 for wrong input (reported on standard error)."""
    try:
        return _collect(arguments)
    except (ValueError, OSError) as error:
        print(f"kitchenmind collect: {error_message(error)}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("\nInterrupted. The same command continues with the next partner.", file=sys.stderr)
        return 1


def _collect(arguments: argparse.Namespace) -> int:
    import torch

    from overcooked.layout import load_layout
    from training.collect import CollectionPlan, collect
    from training.compute import request
    from training.population import load_extras, load_target, partners_of, with_itself_and_extras
    from training.publish_predictor import population_folder

    refuse_below(1, trajectories=arguments.trajectories)
    refuse_below(10, timesteps=arguments.timesteps)
    refuse_below(0, seed=arguments.seed)
    torch.set_num_threads(1)
    request(arguments.device)
    layout = load_layout(arguments.layout)
    target = load_target(arguments.agent, layout)
    population = partners_of(arguments.partners, arguments.population or population_folder(layout), layout)
    partners = with_itself_and_extras(target, population, layout, extras=not arguments.no_extras)
    for folder in arguments.extra:  # one by one: two of the same name are to be noticed
        partners += load_extras({folder.name: folder}, layout)
    plan = CollectionPlan(arguments.trajectories, arguments.timesteps, arguments.seed)
    out = arguments.out or arguments.runs / "games" / f"{layout.name}_{target.name}"
    with Progress(TextColumn(f"{target.name} on {layout.name}"), BarColumn(), TimeRemainingColumn()) as bar:
        task = bar.add_task("games", total=1.0)
        collect(out, layout, target, partners, plan, lambda share: bar.update(task, completed=share))
    timesteps = len(partners) * 4 * plan.trajectories * plan.timesteps
    print(f"{out}: {len(partners)} partners, {timesteps:,} timesteps")
    return 0
