"""`kitchenmind evaluate predictor | agents`: measures the bundled weights, as a table or as JSON."""

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from training.command_errors import error_message, refuse_below

if TYPE_CHECKING:
    from models.networks.checkpoint import Checkpoint
    from overcooked.layout import Layout
    from training.collect import Partner, Target


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    kinds = parser.add_subparsers(dest="what", metavar="agents|predictor", required=True)
    agents = kinds.add_parser("agents", help="measure points with itself and with unseen partners")
    agents.add_argument("--layouts", nargs="*", metavar="LAYOUT", help="only these layouts")
    agents.add_argument("--episodes", type=int, default=40, help="episodes for each pair of agents (default: 40)")
    agents.add_argument(
        "--timesteps",
        type=int,
        default=400,
        help="length of an episode; the published points are for 400 (default: 400)",
    )
    agents.add_argument(
        "--partner",
        metavar="AGENT",
        help="use this partner instead of the unseen ones, in both seats, such as human_bc",
    )
    predictor = kinds.add_parser(
        "predictor", help="measure accuracy with unseen partners, next to ceiling and baselines"
    )
    _add_predictor_arguments(predictor)
    for kind in (agents, predictor):
        kind.add_argument("--json", action="store_true", help="print the figures as JSON")


def _add_predictor_arguments(predictor: argparse.ArgumentParser) -> None:
    predictor.add_argument("--all", action="store_true", help="every bundled predictor")
    predictor.add_argument("--layout", help="a bundled layout")
    predictor.add_argument("--agent", help="the predicted agent, such as sp or mine.onnx (default: all of the layout)")
    predictor.add_argument("--form", choices=("stream", "window"), help="only this form (default: both)")
    predictor.add_argument("--population", type=Path, help="folder of partner agents (default: the bundled ones)")
    predictor.add_argument(
        "--partners", type=Path, metavar="DIR", help="use the agents of this folder instead; at least three"
    )
    predictor.add_argument(
        "--predictor", type=Path, metavar="FOLDER", help="a predictor that `kitchenmind train predictor` wrote"
    )
    predictor.add_argument(
        "--partner", metavar="AGENT", help="use this partner instead of the test partners, such as human_bc"
    )
    predictor.add_argument(
        "--trajectories", type=int, default=5, help="number of trajectories for each partner and setting (default: 5)"
    )
    predictor.add_argument("--timesteps", type=int, default=800, help="length of a trajectory (default: 800)")
    predictor.add_argument("--intentions", action="store_true", help="also measure the predicted next interactions")


def run(arguments: argparse.Namespace) -> int:
    """Return 0 if done, 1 if nothing is bundled, 2 for wrong input (reported on standard error)."""
    try:
        entries = _agents(arguments) if arguments.what == "agents" else _predictors(arguments)
    except (ValueError, OSError) as error:
        print(f"kitchenmind evaluate {arguments.what}: {error_message(error)}", file=sys.stderr)
        return 2
    if arguments.json:
        print(json.dumps(entries))
    elif not entries:
        print(f"kitchenmind evaluate {arguments.what}: {_nothing(arguments)}", file=sys.stderr)
    else:
        (_agent_table if arguments.what == "agents" else _predictor_table)(entries)
    return 0 if entries else 1


def _nothing(arguments: argparse.Namespace) -> str:
    """Say why there is nothing to measure, and what to do."""
    if arguments.what == "agents":
        where = f" for {', '.join(arguments.layouts)}" if arguments.layouts else ""
        return f"no trained agent is bundled{where}. Name other layouts; `kitchenmind agent check` measures your own."
    return f"no predictor is bundled for {arguments.layout}. Name the folder of yours with --predictor."


def _agents(arguments: argparse.Namespace) -> list[dict[str, Any]]:
    from overcooked.layout import layout_names, load_layout
    from training.choose_agents import evaluate_bundled, evaluate_with

    refuse_below(1, episodes=arguments.episodes, timesteps=arguments.timesteps)
    layouts = [load_layout(name) for name in arguments.layouts or layout_names()]
    size = {"episodes": arguments.episodes, "timesteps": arguments.timesteps}
    if arguments.partner is None:
        return [entry for layout in layouts for entry in evaluate_bundled(layout, **size)]
    if not arguments.layouts:
        layouts = _with_partner(layouts, arguments.partner)
    return [entry for layout in layouts for entry in evaluate_with(layout, arguments.partner, **size)]


def _with_partner(layouts: list["Layout"], partner: str) -> list["Layout"]:
    """Return the layouts that a bundled partner can play on. Raises ValueError if there are none or it is not
    bundled."""
    from models.agents.blackbox import is_foreign
    from models.agents.catalogue import agent_names

    name = partner.partition("@")[0]
    if "/" in partner or is_foreign(partner):
        raise ValueError(f"{partner}: say for which layouts: --layouts NAME.")
    found = [layout for layout in layouts if name in agent_names(layout.name)]
    if not found:
        names = sorted({name for layout in layouts for name in agent_names(layout.name)})
        raise ValueError(f"no layout has an agent {partner!r}. Known: {', '.join(names)}.")
    return found


def _predictors(arguments: argparse.Namespace) -> list[dict[str, Any]]:
    import torch

    from overcooked.layout import layout_names, load_layout

    torch.set_num_threads(1)
    if not (arguments.all or arguments.layout):
        raise ValueError("say which: --layout NAME [--agent NAME], or --all")
    refuse_below(1, trajectories=arguments.trajectories)
    refuse_below(10, timesteps=arguments.timesteps)
    layouts = [load_layout(name) for name in (layout_names() if arguments.all else [arguments.layout])]
    return [entry for layout in layouts for entry in _of_layout(layout, arguments)]


def _of_layout(layout: "Layout", arguments: argparse.Namespace) -> list[dict[str, Any]]:
    """Measure the predictors of one kitchen."""
    from models.agents.catalogue import agent_names
    from models.networks.checkpoint import load_checkpoint
    from training.population import load_target, partners_of
    from training.publish_predictor import population_folder

    folder = arguments.population or population_folder(layout)
    population = folder if arguments.partners is None else partners_of(arguments.partners, folder, layout)
    asked = None if arguments.agent is None else load_target(arguments.agent, layout)
    entries = []
    for folder, agent, form in _predictor_folders(layout, arguments.predictor):
        if (asked and agent != asked.name and not arguments.predictor) or arguments.form not in (None, form):
            continue
        if asked is None and agent not in agent_names(layout.name):
            print(f"{folder.name}: --agent must say whose it is, e.g. --agent {agent}.onnx", file=sys.stderr)
            continue
        checkpoint, target = load_checkpoint(folder), asked or load_target(agent, layout)
        if checkpoint.config.get("agent_sha256", target.sha256) != target.sha256:
            if asked is None:
                raise ValueError(f"{folder}: predicts another agent than {target.name}. Say which: --agent.")
            print(f"warning: {folder} was trained to predict another agent than {target.name}.", file=sys.stderr)
        entries.append(_measured(checkpoint, layout, target, population, arguments))
    return entries


def _measured(
    checkpoint: "Checkpoint",
    layout: "Layout",
    target: "Target",
    population: "Path | list[Partner]",
    arguments: argparse.Namespace,
) -> dict[str, Any]:
    """Measure one predictor in games of `target`."""
    from models.agents.catalogue import agent_set
    from models.networks.predictor import predictor_network
    from training.collect import TRAIN, CollectionPlan
    from training.evaluate_predictor import evaluate
    from training.publish_intentions import measured_intentions
    from training.publish_predictor import MET, games_of, partners_in, unseen_partners

    network, trained_on = predictor_network(checkpoint)
    if trained_on.text != layout.text:
        raise ValueError(f"{checkpoint.folder}: is for {trained_on.name}, not {layout.name}. Give its own --layout.")
    plan = CollectionPlan(arguments.trajectories, arguments.timesteps)
    others = unseen_partners(layout, population, arguments.partner, checkpoint.config.get(MET, ()))
    result = evaluate(network, games_of(layout, target, others, network, plan))
    entry = result.entry(layout.name, target.name, network.config.form) | agent_set(target.name, layout.name)
    if arguments.intentions:
        known = partners_in(TRAIN, layout, population)
        entry["intentions"] = measured_intentions(network, layout, target, others, known, plan)
    return entry


def _predictor_folders(layout: "Layout", chosen: Path | None) -> list[tuple[Path, str, str]]:
    """Yield folder, agent and form of one predictor, or of all that are bundled for a kitchen."""
    from models.agents.catalogue import WEIGHTS

    if chosen is None:
        found = [config.parent for config in sorted((WEIGHTS / layout.name).glob("*_predictor_*/config.json"))]
        return [(folder, *folder.name.split("_predictor_", 1)) for folder in found]  # type: ignore[misc]
    from models.networks.checkpoint import load_checkpoint

    config = load_checkpoint(chosen).config
    return [(chosen, str(config.get("agent", "")), str(config.get("network", {}).get("form", "")))]


def _predictor_table(entries: list[dict[str, Any]]) -> None:
    print(f"{'layout':18} {'agent':10} {'form':7}  step1  step2  step3   mean  ceiling1  repeat  frequent  free   ece")
    for entry in entries:
        accuracy = "  ".join(f"{entry['accuracy'][key]:5.1f}" for key in ("step1", "step2", "step3", "mean"))
        base = entry["baselines"]
        print(
            f"{entry['layout']:18} {entry['agent']:10} {entry['form']:7}  {accuracy}  {entry['ceiling_step1']:8.1f}  "
            f"{base['repeat']:6.1f}  {base['frequent']:8.1f} {entry['not_stuck']['mean']:5.1f}  {entry['ece']:.3f}"
        )
    if "intentions" in entries[0]:
        _intention_table(entries)


def _intention_table(entries: list[dict[str, Any]]) -> None:
    print("\nnext interaction, right in % (kind / kind and station / nearest that makes sense / most frequent):")
    for entry in entries:
        before = [
            f"{int(timesteps) / 5:g} s before: "
            + " / ".join(str(values[key]) for key in ("kind", "kind_and_station", "nearest_sensible", "frequent"))
            for timesteps, values in entry["intentions"]["before"].items()
        ]
        name = f"{entry['layout']:18} {entry['agent']:10} {entry['form']:7}"
        print(f"{name}  {'; '.join(before)}; ece {entry['intentions']['ece']:.3f}")


def _agent_table(entries: list[dict[str, Any]]) -> None:
    if "partner" in entries[0]:
        _partner_table(entries)
        return
    print(f"{'layout':18} {'agent':10} with itself     with partners never met (points per 400 timesteps +- s.e.)")
    for entry in entries:
        own, others = entry["self_play"], entry.get("held_out")
        met = f"{others['mean']:5.1f} +- {others['se']:.1f}" if others else "    -"
        print(f"{entry['layout']:18} {entry['agent']:10} {own['mean']:5.1f} +- {own['se']:<5.1f}  {met}")


def _partner_table(entries: list[dict[str, Any]]) -> None:
    print(f"{'layout':22} {'agent':10} with itself     with {entries[0]['partner']} (points per 400 timesteps +- s.e.)")
    for entry in entries:
        own, met = entry["self_play"], entry["with_partner"]
        seats = ", ".join(f"{seat['mean']:.1f} as chef {number + 1}" for number, seat in enumerate(met["seats"]))
        print(
            f"{entry['layout']:22} {entry['agent']:10} {own['mean']:5.1f} +- {own['se']:<5.1f}  "
            f"{met['mean']:5.1f} +- {met['se']:.1f} ({seats})"
        )
