"""`kitchenmind train agent | predictor | intentions | compact | study | bundle`: parse options, show progress, report.
The training itself is elsewhere.
"""

import argparse
import importlib
import importlib.util
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from training.agent_config import AgentConfig, agent_config
from training.command_errors import error_message, refuse_below
from training.settings import ConfigError

if TYPE_CHECKING:
    from training.pipeline.study_tasks import Graph

_PREDICTOR = "training.commands.predictor"
_INTENTIONS = "training.commands.intentions"
_COMPACT = "training.commands.compact"
_BUNDLE = "training.commands.bundle"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add a subcommand for each kind of training."""
    kinds = parser.add_subparsers(dest="what", metavar="agent|predictor|intentions|compact|study|bundle", required=True)
    agent = kinds.add_parser("agent", help="train one agent by self-play or with partners (FCP)")
    agent.add_argument("--layout", required=True, help="a bundled layout or a .layout file")
    agent.add_argument("--seed", type=int, default=1, help="random seed (default: 1)")
    agent.add_argument("--config", help="a TOML file, or the name of one in training/configs")
    agent.add_argument(
        "--set", action="extend", nargs="+", default=[], metavar="KEY=VALUE", help="change one or more settings"
    )
    agent.add_argument(
        "--partners", nargs="*", type=Path, default=[], help="checkpoint folders of the partners to train with"
    )
    agent.add_argument("--out", type=Path, help="also write the finished agent's checkpoint here")
    _add_runs(agent)
    add_compute(agent)
    _add_study(kinds.add_parser("study", help="train everything that a study needs, from population to weights"))
    predictor = kinds.add_parser("predictor", help="train a predictor from collected games")
    add_compute(predictor)
    if importlib.util.find_spec(_PREDICTOR):
        importlib.import_module(_PREDICTOR).add_arguments(predictor)
    intentions = kinds.add_parser("intentions", help="add a decoder of intentions to a trained predictor")
    intentions.set_defaults(device="cpu", precision="float32")  # so small that the CPU in float32 is the fastest
    importlib.import_module(_INTENTIONS).add_arguments(intentions)
    compact = kinds.add_parser("compact", help="store a predictor in half the bytes, and measure it again")
    compact.set_defaults(device="cpu", precision="float32")
    importlib.import_module(_COMPACT).add_arguments(compact)
    bundle = kinds.add_parser("bundle", help="put the finished training of a study among the bundled weights")
    bundle.set_defaults(device="cpu", precision="float32")
    importlib.import_module(_BUNDLE).add_arguments(bundle)


def _add_study(study: argparse.ArgumentParser) -> None:
    """Add the options of `train study`."""
    study.add_argument(
        "--preset", default="cpu", help="cpu (two cores), published (the paper's recipe) or a .toml file"
    )
    study.add_argument("--layouts", nargs="*", metavar="LAYOUT", help="only these layouts")
    study.add_argument(
        "--only", nargs="*", metavar="TASK", help="only tasks whose name starts with this, and their inputs"
    )
    study.add_argument("--workers", type=int, default=1, help="number of tasks at once, each on one core")
    study.add_argument("--ray", metavar="ADDRESS", help="run the tasks on this Ray cluster (local: start one here)")
    study.add_argument(
        "--keep", type=Path, metavar="DIR", help="also copy the results of finished tasks here, and reuse what is here"
    )
    study.add_argument("--plan", action="store_true", help="show the tasks and exit")
    study.add_argument("--task", help=argparse.SUPPRESS)  # one task in this process: how workers are started
    _add_runs(study)
    add_compute(study)


def add_compute(parser: argparse.ArgumentParser) -> None:
    """Add the options for device and precision; the fastest are measured if they are not given."""
    # Not `choices`: torch, which knows the devices, is only imported when the command runs.
    parser.add_argument("--device", default="auto", help="auto (default), cpu, cuda or mps")
    parser.add_argument(
        "--precision", default="auto", help="auto (default: the faster one on this machine), float32 or bfloat16"
    )


def run(arguments: argparse.Namespace) -> int:
    """Return 0 if done, 1 if it failed, 2 for wrong input (reported on standard error)."""
    from training.compute import request

    verbs: dict[str, Callable[[argparse.Namespace], int]] = {
        "agent": _train_agent,
        "intentions": lambda given: int(importlib.import_module(_INTENTIONS).run(given)),
        "compact": lambda given: int(importlib.import_module(_COMPACT).run(given)),
        "bundle": lambda given: int(importlib.import_module(_BUNDLE).run(given)),
        "study": _train_study,
        "predictor": lambda given: int(importlib.import_module(_PREDICTOR).run(given)),
    }
    try:
        request(arguments.device, arguments.precision)
        return verbs[arguments.what](arguments)
    except (ValueError, OSError) as error:  # all our errors are ValueErrors with place and remedy
        print(f"kitchenmind train {arguments.what}: {error_message(error)}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("\nInterrupted. The same command continues from the last saved state.", file=sys.stderr)
        return 1


def _add_runs(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--runs", type=Path, default=Path("runs"), help="folder for runs (default: runs)")


def _train_agent(arguments: argparse.Namespace) -> int:
    from models.agents.own_checkpoints import name_in_study
    from models.networks.checkpoint import refuse_other_content
    from overcooked.layout import load_layout
    from training.train_agent import train_agent, write_agent

    config = agent_config(arguments.config, arguments.set)
    refuse_below(0, seed=arguments.seed)
    if arguments.out is not None:
        refuse_other_content(arguments.out)
    layout = load_layout(arguments.layout)
    kind = "fcp" if arguments.partners else "sp"
    path = arguments.runs / layout.name / f"{kind}_{arguments.seed}"
    _show(config)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("reward {task.fields[reward]:.0f}"),
    )
    with Progress(*columns) as bar:
        task = bar.add_task(f"{layout.name} {path.name}", total=config.total_timesteps, reward=0.0)

        def progress(timesteps: int, metrics: dict[str, float]) -> None:
            bar.update(task, completed=min(timesteps, config.total_timesteps), reward=metrics["mean_reward"])

        folder = train_agent(config, layout, arguments.seed, path, arguments.partners, progress)
    best = max(reward for _, reward, _ in folder.snapshots())
    print(f"{folder.path}: best mean reward {best:.1f} per episode, {folder.seconds():.0f} s")
    if arguments.out is not None:
        print(f"{arguments.out}: {write_agent(folder, 100, arguments.out, arguments.out.name)}")
        print(f"Use it in a study: `model: {name_in_study(arguments.out, layout.name)}`.")
    return 0


def _show(config: AgentConfig) -> None:
    for name, value in config:
        print(f"{name} = {value}")


def _train_study(arguments: argparse.Namespace) -> int:
    from overcooked.layout import load_layout
    from overcooked.other_names import bundled_name
    from training.pipeline.agent_tasks import STUDY_LAYOUTS, prediction_tasks, study_tasks
    from training.pipeline.presets import load_preset
    from training.pipeline.schedule import run_here, run_on_ray, run_task, show_plan
    from training.pipeline.study_tasks import Graph

    refuse_below(1, workers=arguments.workers)
    preset = load_preset(arguments.preset)
    layouts = [bundled_name(name) for name in arguments.layouts or STUDY_LAYOUTS]
    for layout in layouts:
        load_layout(layout)
    # All agents first: studies can use them while the predictors train.
    tasks = [task for made in (study_tasks, prediction_tasks) for layout in layouts for task in made(layout, preset)]
    graph = Graph(tasks, arguments.runs / "study")
    if arguments.only:
        graph = _limited(graph, arguments.only)
    if arguments.task:
        return run_task(graph, arguments.task, arguments.keep)
    if arguments.keep:
        for label in graph.take_over(arguments.keep):
            print(f"{label}: taken from {arguments.keep}")
    if arguments.plan:
        return show_plan(graph)
    if arguments.keep:
        for label in graph.keep_finished(arguments.keep):
            print(f"{label}: copied to {arguments.keep}")
    command = ["--preset", arguments.preset, "--layouts", *layouts, "--runs", str(arguments.runs)]
    command += ["--device", arguments.device, "--precision", arguments.precision]
    if arguments.keep:
        command += ["--keep", str(arguments.keep)]
    if arguments.ray:
        return run_on_ray(graph, command, arguments.ray, arguments.workers)
    return run_here(graph, command, arguments.workers)


def _limited(graph: "Graph", only: Sequence[str]) -> "Graph":
    """Return the tasks that `--only` asks for, and their inputs. Raises ValueError if there are none."""
    limited = graph.limited(only)
    if not limited.tasks:
        kinds = sorted({task.name.rstrip("0123456789").rstrip("_") for task in graph.tasks.values()})
        raise ValueError(f"--only {' '.join(only)}: no task begins with this. There are: {', '.join(kinds)}.")
    return limited


__all__ = ["ConfigError", "add_arguments", "run"]
