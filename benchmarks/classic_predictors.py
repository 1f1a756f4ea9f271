"""Measure the predictors of the five classic kitchens while their agent cooks with the human proxy.

python benchmarks/classic_predictors.py            measures and prints the table
python benchmarks/classic_predictors.py --write    also writes classic_predictors.json and docs/explanation/results.md

What is in classic_predictors.json is not measured again while agent, predictor and proxy have the same weights: every
game has a fixed seed, so the figures would be the same. Without that file, everything is measured.

The table also has the accuracy with the test partners (from the predictors' cards) and, with the proxy, the accuracy of
an observer who knows the action probabilities of both agents, but not their random draws
(`benchmarks/accuracy_ceiling.py`).
"""

import json
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy asks
# `training.py` next to this file bears a package's name: Python must look for that one elsewhere.
ROOT = Path(__file__).resolve().parent.parent
sys.path[:] = [str(ROOT), *(folder for folder in sys.path if Path(folder).resolve() != ROOT / "benchmarks")]

from benchmarks.classic_kitchens import HUMAN, LAYOUTS  # noqa: E402
from benchmarks.support.kept_figures import KeptTable  # noqa: E402
from models.agents.catalogue import WEIGHTS, agent_sha256  # noqa: E402
from models.protocols import STEPS  # noqa: E402
from overcooked.layout import load_layout  # noqa: E402

FIGURES, DOCUMENT = Path(__file__).with_suffix(".json"), ROOT / "docs" / "explanation" / "results.md"
BEGIN, END = "<!-- table of benchmarks/classic_predictors.py -->", "<!-- end of the predictors' table -->"
KINDS = (("sp", "stream"), ("fcp", "stream"), ("sp", "window"), ("fcp", "window"))
TRAJECTORIES = 20  # with five, another seed moves a figure by two points
STATES = 6000


def main() -> None:
    KeptTable(FIGURES, DOCUMENT, BEGIN, END).measure_and_print(__doc__, measured, rendered)


def measured(quick: bool = False) -> dict[str, Any]:
    """Accuracy (%) of every bundled predictor with test partners and with the proxy, and which weights that was."""
    import torch

    torch.set_num_threads(1)
    earlier = {} if quick or not FIGURES.is_file() else json.loads(FIGURES.read_text(encoding="utf-8"))
    people, observers = still_right(earlier)
    entries = []
    for cell, folder in bundled_predictors().items():
        layout, agent, form = cell
        if (layout, agent) not in observers:
            observers[layout, agent] = _observer(layout, agent, quick)
        human = people[cell] if cell in people else _with_human(*_cell(folder), quick)
        config = json.loads((folder / "config.json").read_text(encoding="utf-8"))
        entry = {"layout": layout, "agent": agent, "form": form, "unseen": config["measured"]["accuracy"]["mean"]}
        entries.append({**entry, "human": human, "observer": observers[layout, agent]})
    return {"sha256": fingerprints(), "predictors": entries}


def still_right(figures: Mapping[str, Any]) -> tuple[dict[tuple[str, str, str], float], dict[tuple[str, str], float]]:
    """Return the accuracy with the proxy of each predictor, and the observer's for each agent, as far as all whose
    weights they depend on are bundled with the same ones."""
    now, people, observers = fingerprints(), {}, {}
    same = {name for name, digest in figures.get("sha256", {}).items() if digest == now.get(name)}
    for entry in figures.get("predictors", ()):
        layout, agent, form = entry["layout"], entry["agent"], entry["form"]
        if {f"{layout}/{agent}", f"{layout}/{HUMAN}"} <= same:
            observers[layout, agent] = entry["observer"]
            if f"{layout}/{agent}_predictor_{form}" in same:
                people[layout, agent, form] = entry["human"]
    return people, observers


def bundled_predictors() -> dict[tuple[str, str, str], Path]:
    """Return (layout, agent, form) -> folder of each bundled predictor of these kitchens."""
    folders = {cell: WEIGHTS / cell[0] / f"{cell[1]}_predictor_{cell[2]}" for cell in _cells()}
    return {cell: folder for cell, folder in folders.items() if folder.is_dir()}


def _cells() -> list[tuple[str, str, str]]:
    return [(layout, agent, form) for layout in LAYOUTS for agent, form in KINDS]


def _cell(folder: Path) -> tuple[str, str, Path]:
    return folder.parent.name, folder.name.partition("_predictor_")[0], folder


def fingerprints() -> dict[str, str]:
    """Return hashes of the weights of every measured predictor, of its agent and of the proxies it was measured
    with."""
    names = {f"{folder.parent.name}/{folder.name}": _weights_sha256(folder) for folder in bundled_predictors().values()}
    agents = sorted(
        {(layout, agent) for layout, agent, _ in bundled_predictors()} | {(name, HUMAN) for name in LAYOUTS}
    )
    return {**names, **{f"{layout}/{agent}": agent_sha256(agent, load_layout(layout)) for layout, agent in agents}}


def _weights_sha256(folder: Path) -> str:
    lines = (folder / "sha256").read_text(encoding="utf-8").splitlines()
    return next(line.split()[0] for line in lines if line.endswith("weights.safetensors"))


def _with_human(name: str, agent: str, folder: Path, quick: bool) -> float:
    from models.networks.checkpoint import load_checkpoint
    from models.networks.predictor import predictor_network
    from training.collect import CollectionPlan
    from training.evaluate_predictor import evaluate
    from training.population import load_target
    from training.publish_predictor import population_folder, unseen_games

    layout = load_layout(name)
    network, _ = predictor_network(load_checkpoint(folder))
    plan = CollectionPlan(1, 40) if quick else CollectionPlan(trajectories=TRAJECTORIES)
    games = unseen_games(layout, load_target(agent, layout), network, population_folder(layout), plan, HUMAN)
    mean: float = evaluate(network, games).entry(name, agent, network.config.form)["accuracy"]["mean"]
    return mean


def _observer(name: str, agent: str, quick: bool) -> float:
    from benchmarks.accuracy_ceiling import limits

    steps = limits(load_layout(name), agent, HUMAN, 60 if quick else STATES)
    return round(sum(steps) / STEPS, 2)


def rendered(figures: Mapping[str, Any]) -> str:
    """Return the table in docs/explanation/results.md, markers included."""
    found = {(entry["layout"], entry["agent"], entry["form"]): entry for entry in figures["predictors"]}
    rows = [["", *(name.replace("_", " ").title() for name in LAYOUTS)], ["---"] * (1 + len(LAYOUTS))]
    for agent, form in KINDS:
        entries = [found.get((layout, agent, form)) for layout in LAYOUTS]
        if any(entries):
            rows.extend(_rows(f"{agent.upper()} ({form})", entries))
    return "\n".join([BEGIN, *(f"| {' | '.join(row)} |" for row in rows), END])


def _rows(name: str, entries: Sequence[Mapping[str, Any] | None]) -> list[list[str]]:
    return [
        [f"{name}, test partners", *(_cell_text(entry, "{unseen:.1f}") for entry in entries)],
        [f"**{name}, with `{HUMAN}`**", *(_cell_text(entry, "**{human:.1f}**") for entry in entries)],
        ["an observer who knows both agents", *(_cell_text(entry, "{observer:.1f}") for entry in entries)],
        [f"lost to `{HUMAN}` / behind the observer", *(_differences(entry) for entry in entries)],
    ]


def _cell_text(entry: Mapping[str, Any] | None, form: str) -> str:
    return "–" if entry is None else form.format(**entry)


def _differences(entry: Mapping[str, Any] | None) -> str:
    if entry is None:
        return "–"
    return f"{entry['unseen'] - entry['human']:.1f} / {entry['observer'] - entry['human']:.1f}"


if __name__ == "__main__":
    main()
