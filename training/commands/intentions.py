"""`kitchenmind train intentions`: add a decoder of intentions to a trained predictor."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

if TYPE_CHECKING:
    from training.predictor_config import IntentionSettings


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    parser.add_argument("--layout", required=True, help="a bundled layout or a .layout file")
    parser.add_argument("--agent", required=True, help="the predicted agent, as it was given to `kitchenmind collect`")
    parser.add_argument(
        "--form", choices=("stream", "window"), default="stream", help="form of the bundled predictor (default: stream)"
    )
    parser.add_argument(
        "--predictor", type=Path, metavar="FOLDER", help="a predictor's folder (default: the bundled predictor)"
    )
    parser.add_argument(
        "--games", type=Path, help="folder that `kitchenmind collect` wrote (default: runs/games/LAYOUT_AGENT)"
    )
    parser.add_argument(
        "--set", action="extend", nargs="+", default=[], metavar="KEY=VALUE", help="change one or more settings"
    )
    parser.add_argument("--runs", type=Path, default=Path("runs"), help=argparse.SUPPRESS)
    parser.add_argument("--out", type=Path, help="write the predictor here (default: in its own folder)")


def run(arguments: argparse.Namespace) -> int:
    """Return 0. Raises ValueError or OSError for wrong input."""
    import torch

    from overcooked.layout import load_layout
    from training.population import load_target
    from training.predictor_config import IntentionSettings
    from training.publish_predictor import predictor_folder
    from training.settings import parsed_changes

    torch.set_num_threads(1)
    settings = IntentionSettings().changed(parsed_changes(arguments.set), "--set")
    layout = load_layout(arguments.layout)
    agent = load_target(arguments.agent, layout).name
    predictor = arguments.predictor or predictor_folder(layout, agent, arguments.form)
    games = arguments.games or arguments.runs / "games" / f"{layout.name}_{agent}"
    add_with_progress(predictor, games, settings, arguments.out or predictor)
    return 0


def add_with_progress(predictor: Path, games: Path, settings: "IntentionSettings", out: Path) -> None:
    """Add the decoder, show progress, and print what it reaches."""
    from training.publish_intentions import add_intentions

    with Progress(TextColumn(f"intentions of {predictor.name}"), BarColumn(), TimeElapsedColumn()) as bar:
        task = bar.add_task("intentions", total=1.0)
        measured = add_intentions(predictor, games, settings, out, lambda share: bar.update(task, completed=share))
    print(f"{out}: {_measured_in_words(measured)} (unseen partners)")


def _measured_in_words(measured: Mapping[str, Any]) -> str:
    """Return the shares of right intentions; an agent that uses no station has none."""
    shares = [
        f"{values['kind_and_station']} % {int(timesteps) / 5:g} s before"
        for timesteps, values in measured["before"].items()
        if values["states"]
    ]
    if not shares:
        return "the agent used no station in the test games, so there is no intention to measure"
    return f"next interaction and station right in {', '.join(shares)}"
