"""`kitchenmind train predictor`: parses, shows progress, writes the checkpoint. The loop is in
training.train_predictor."""

import argparse
from dataclasses import asdict
from pathlib import Path

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which agent, from which games, in which form."""
    parser.add_argument("--layout", required=True, help="a shipped layout or a .layout file")
    parser.add_argument("--agent", required=True, help="the agent to be predicted, as it was collected")
    parser.add_argument("--form", choices=("stream", "window"), default="stream", help="default: stream")
    parser.add_argument("--games", type=Path, help="folder of kitchenmind collect (default: runs/games/LAYOUT_AGENT)")
    parser.add_argument("--lender", type=Path, help="agent that lends its convolutions, with --set eyes=cnn")
    parser.add_argument("--begin-with", type=Path, metavar="FOLDER", help="a predictor whose weights are the first")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="change one setting")
    parser.add_argument("--runs", type=Path, default=Path("runs"), help="where runs are kept (default: runs)")
    parser.add_argument("--out", type=Path, help="write the finished predictor here (default: in the run's folder)")
    parser.add_argument("--ship", action="store_true", help="write it to models/weights, where studies find it")


def run(arguments: argparse.Namespace) -> int:
    """0 done, 1 time is over (the same command goes on). Raises ValueError or OSError for wrong input."""
    from models.checkpoint import load_checkpoint
    from models.network_config import PredictorConfig
    from overcooked.layout import load_layout
    from training.collect import TEST, read_manifest
    from training.dataset import load_episodes
    from training.population import load_target
    from training.predictor_config import TrainingConfig, changed, parsed_changes
    from training.runlog import RunFolder
    from training.ship_predictor import partners_met, predictor_folder, write_predictor
    from training.train_predictor import prepared, train_predictor

    defaults = (PredictorConfig(form=arguments.form), TrainingConfig())
    network, training = changed(defaults, parsed_changes(arguments.set), "--set")
    layout = load_layout(arguments.layout)
    target = load_target(arguments.agent, layout)
    games = arguments.games or arguments.runs / "games" / f"{layout.name}_{target.name}"
    collected = read_manifest(games)
    if collected["target"]["sha256"] != target.sha256:
        raise ValueError(f"{games}: was collected with another agent than {arguments.agent}. Collect its games first.")
    settings = {**asdict(network), **asdict(training)}
    for name, value in settings.items():
        print(f"{name} = {value}")
    name = f"{target.name}_predictor_{arguments.form}"
    # How long one call may take changes nothing about the run.
    begun = "" if arguments.begin_with is None else load_checkpoint(arguments.begin_with).sha256
    known = {
        "begun with": begun,
        "games": collected["shards"],
        "settings": {key: v for key, v in settings.items() if key != "minutes"},
    }
    folder = RunFolder(arguments.runs / layout.name / name, known)
    trainer = prepared(layout, network, training, games, arguments.lender, arguments.begin_with)
    with Progress(TextColumn(name), BarColumn(), TimeElapsedColumn(), TextColumn("{task.fields[accuracy]:.1%}")) as bar:
        task = bar.add_task(name, total=1.0, accuracy=trainer.best_accuracy)
        try:
            trained = train_predictor(
                trainer, folder, lambda share, line: bar.update(task, completed=share, accuracy=line["accuracy"])
            )
        except TimeoutError as over:
            print(over)
            return 1
    out = (
        predictor_folder(layout, target.name, arguments.form)
        if arguments.ship
        else arguments.out or folder.path / "predictor"
    )
    how = {
        "updates": trainer.update,
        "training games": len(trainer.train),
        "seed": training.seed,
        "begun with": begun or "nothing",
        **partners_met(collected),
        "settings": settings,
    }
    result = write_predictor(out, trained, layout, target, load_episodes(games, TEST, layout, trained.eyes), how)
    print(f"{out}: {result.accuracy.mean:.1%} on partners never seen (ceiling of step 1: {result.ceiling:.1%})")
    return 0
