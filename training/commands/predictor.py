"""`kitchenmind train predictor`: parse options, show progress, write the checkpoint. The training loop is in
training.train_predictor.
"""

import argparse
import signal
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

if TYPE_CHECKING:
    from models.networks.checkpoint import Checkpoint
    from models.networks.config import PredictorConfig
    from models.networks.predictor import PredictorNetwork
    from overcooked.layout import Layout
    from training.collect import Target
    from training.predictor_config import TrainingConfig
    from training.publish_predictor import HowTrained
    from training.runlog import RunFolder
    from training.train_predictor import PredictorTrainer

OUT_OF_TIME, INTERRUPTED = "stopped because its time was up", "interrupted"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    parser.add_argument("--layout", required=True, help="a bundled layout or a .layout file")
    parser.add_argument("--agent", required=True, help="the agent to predict, as it was given to `kitchenmind collect`")
    _add_network_arguments(parser)
    parser.add_argument(
        "--set", action="extend", nargs="+", default=[], metavar="KEY=VALUE", help="change one or more settings"
    )
    parser.add_argument("--no-intentions", action="store_true", help="do not train a decoder of intentions")
    parser.add_argument("--runs", type=Path, default=Path("runs"), help="folder for runs (default: runs)")
    parser.add_argument("--out", type=Path, help="write the predictor here (default: in the run's folder)")
    parser.add_argument(
        "--ship",  # the former name
        "--publish",
        action="store_true",
        dest="publish",
        help="write it to models/weights, where studies find it by name",
    )


def _add_network_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that choose the network, its games and its first weights."""
    parser.add_argument(
        "--form", choices=("stream", "window"), default="stream", help="form of the predictor (default: stream)"
    )
    parser.add_argument(
        "--games", type=Path, help="folder that `kitchenmind collect` wrote (default: runs/games/LAYOUT_AGENT)"
    )
    parser.add_argument(
        "--lender",  # the former name
        "--encoder-from",
        type=Path,
        metavar="FOLDER",
        dest="encoder_from",
        help="agent whose convolutional encoder is used, with --set encoder=cnn",
    )
    parser.add_argument(
        "--begin-with", type=Path, metavar="FOLDER", help="predictor whose weights training starts from"
    )
    parser.add_argument(
        "--preset",
        choices=("full", "tiny"),
        default="full",
        help="tiny: a small network, trained in minutes (default: full)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Return 0 if a predictor was written (also if its time was up first: the same command continues), 1 if it was
    interrupted. Raises ValueError or OSError for wrong input."""
    from models.agents.own_checkpoints import name_in_study
    from models.networks.checkpoint import load_checkpoint
    from overcooked.layout import load_layout
    from training.collect import TEST, games_of_agent
    from training.commands.intentions import add_with_progress
    from training.dataset import load_episodes
    from training.population import load_target
    from training.predictor_config import intention_settings
    from training.publish_predictor import write_predictor
    from training.runlog import RunFolder
    from training.train_predictor import prepared

    network, training = _chosen_settings(arguments)
    layout = load_layout(arguments.layout)
    target = load_target(arguments.agent, layout)
    place = _place(arguments, layout, target)
    games = arguments.games or arguments.runs / "games" / f"{layout.name}_{target.name}"
    collected = games_of_agent(games, layout, target)
    settings = {**asdict(network), **training.stored()}
    print("\n".join(f"{name} = {value}" for name, value in settings.items()))
    name = f"{target.name}_predictor_{arguments.form}"
    before = None if arguments.begin_with is None else load_checkpoint(arguments.begin_with)
    begun = "" if before is None else before.sha256
    known = {"begun with": begun, "games": collected["shards"], "settings": _without_limit(settings)}
    folder = RunFolder(arguments.runs / layout.name / name, known)
    trainer = prepared(layout, network, training, games, arguments.encoder_from, arguments.begin_with)
    trained, stopped = _trained(name, trainer, folder)
    out = place or folder.path / "predictor"
    how = _how(trainer, stopped, before, collected, settings)
    result = write_predictor(out, trained, layout, target, load_episodes(games, TEST, layout, trained.encoder), how)
    print(f"{out}: {result.accuracy.mean:.1%} on partners never seen (ceiling of step 1: {result.ceiling:.1%})")
    if not arguments.no_intentions and not stopped:
        add_with_progress(out, games, intention_settings(arguments.preset), out)
    name = out.name if arguments.publish else name_in_study(out, layout.name)
    _say_what_to_do(arguments, name, stopped, f"{trainer.update} of {training.updates} updates")
    return 1 if stopped == INTERRUPTED else 0


def _place(arguments: argparse.Namespace, layout: "Layout", target: "Target") -> Path | None:
    """Return where to write the predictor; None: in the run's folder. Raises ValueError if it would replace something
    else there."""
    from models.networks.checkpoint import refuse_other_content
    from training.publish_predictor import predictor_folder, refuse_other_agents_place

    if arguments.publish:
        refuse_other_agents_place(layout, target)
        return predictor_folder(layout, target.name, arguments.form)
    out: Path | None = arguments.out
    if out is not None:
        refuse_other_content(out)
    return out


def _without_limit(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings that make a run the run it is; it may be continued with more time."""
    return {key: value for key, value in settings.items() if key != "minutes"}


def _chosen_settings(arguments: argparse.Namespace) -> "tuple[PredictorConfig, TrainingConfig]":
    """Return the settings of the network and of its training after --preset and --set."""
    from models.networks.config import PredictorConfig
    from training.predictor_config import PRESETS, TrainingConfig, changed
    from training.settings import parsed_changes

    defaults = (PredictorConfig(form=arguments.form), TrainingConfig())
    preset = changed(defaults, PRESETS[arguments.preset], "--preset")
    return changed(preset, parsed_changes(arguments.set), "--set")


def _how(
    trainer: "PredictorTrainer",
    stopped: str,
    before: "Checkpoint | None",
    collected: Mapping[str, Any],
    settings: Mapping[str, Any],
) -> "HowTrained":
    """Return the card's text about the training, which began with the predictor `before`."""
    from training.publish_predictor import HowTrained, hashes_met, partners_met

    rows = {
        "updates": f"{trainer.update} of {trainer.config.updates}, {stopped}" if stopped else trainer.update,
        "training games": len(trainer.train),
        "seed": trainer.config.seed,
        "begun with": "nothing" if before is None else before.sha256,
        **partners_met(collected),
        "settings": settings,
    }
    return HowTrained(rows, hashes_met(collected, None if before is None else before.config))


def _say_what_to_do(arguments: argparse.Namespace, name: str, stopped: str, done: str) -> None:
    """Print how a study names the predictor, and how to continue if training was stopped."""
    print(f"Use it in a study: `predictor: {name}`.")
    if stopped:
        print(f"Training was {stopped} after {done}; the same command continues.")
        if not arguments.no_intentions:
            print("The predictor gives no intentions until training is finished.")


def _trained(name: str, trainer: "PredictorTrainer", folder: "RunFolder") -> "tuple[PredictorNetwork, str]":
    """Train the network; return it, and what stopped the training early ("": nothing)."""
    from training.train_predictor import train_predictor, usable

    columns = (TextColumn(name), BarColumn(), TimeElapsedColumn(), TextColumn("{task.fields[accuracy]:.1%}"))
    with Progress(*columns) as bar:
        task = bar.add_task(name, total=1.0, accuracy=trainer.best_accuracy)

        def progress(share: float, line: Mapping[str, float]) -> None:
            bar.update(task, completed=share, accuracy=line["accuracy"])
            if "pace_s" in line:
                bar.console.print(_estimate(trainer, line["pace_s"]))

        try:
            with _terminated_like_ctrl_c():
                return train_predictor(trainer, folder, progress), ""
        except TimeoutError as over:
            bar.console.print(str(over))
            return usable(trainer), OUT_OF_TIME
        except KeyboardInterrupt:
            if not trainer.update:
                raise
            bar.console.print("Interrupted. Measuring and writing the predictor so far (Ctrl+C again to skip).")
            return usable(trainer), INTERRUPTED


@contextmanager
def _terminated_like_ctrl_c() -> Iterator[None]:
    """Treat SIGTERM (`kill`, a cluster's time limit, `docker stop`) like Ctrl+C inside the block."""
    if threading.current_thread() is not threading.main_thread():  # signal handlers can only be set in the main thread
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _estimate(trainer: "PredictorTrainer", pace_s: float) -> str:
    config = trainer.config
    minutes = pace_s * (config.updates - trainer.update) / 60
    limit = f"; it stops after {config.minutes:g} (--set minutes=...)" if minutes > config.minutes else ""
    whole = max(1, round(minutes))
    time = f"{whole} minute{'s' if whole > 1 else ''}"
    return f"about {time} for {config.updates} updates, fewer if it stops improving{limit}"
