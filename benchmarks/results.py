"""Measure the agents and predictors that studies use: points with partners, accuracy of the predictions.

    python benchmarks/results.py            measures agents and predictors, prints the tables
    python benchmarks/results.py --write    also writes results.json, docs/explanation/results.md and README.md

The accuracy on test partners is read from the predictors' cards; `kitchenmind evaluate predictor --all` measures it
again.
"""

import json
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy asks
# `training.py` next to this file has the name of a package: remove this folder from the module search path.
ROOT = Path(__file__).resolve().parent.parent
sys.path[:] = [str(ROOT), *(folder for folder in sys.path if Path(folder).resolve() != ROOT / "benchmarks")]

from benchmarks.support import kept_figures, results_tables  # noqa: E402
from benchmarks.support.results_tables import AGENTS, FORMS, HUMAN, LAYOUTS, PLANNER, SETS  # noqa: E402
from models.agents.catalogue import WEIGHTS, agent_sha256  # noqa: E402
from overcooked.layout import Layout, load_layout  # noqa: E402

FIGURES = Path(__file__).with_suffix(".json")
README, DOCUMENT = ROOT / "README.md", ROOT / "docs" / "explanation" / "results.md"
STATES = 6000  # of each observer
BEGIN, END = "<!-- tables of benchmarks/results.py -->", "<!-- end of the tables -->"


def main() -> None:
    arguments = kept_figures.parsed(__doc__)
    figures = measured(arguments.quick)
    entries = bundled_entries()
    print(rendered(entries, figures))
    if arguments.write:
        kept_figures.keep(figures, FIGURES)
        kept_figures.put(summary(entries, figures), README, BEGIN, END)
        kept_figures.put(rendered(entries, figures), DOCUMENT, BEGIN, END)


def measured(quick: bool = False) -> dict[str, Any]:
    """Measure what the cards do not have: points of agents with the same unseen partners, predictors with a
    behaviour-cloned human, and the agents' hashes."""
    import torch

    from models.agents.catalogue import load_agent
    from models.networks.checkpoint import load_checkpoint
    from models.networks.predictor import predictor_network
    from training.choose_agents import evaluate_bundled
    from training.collect import CollectionPlan
    from training.evaluate_agents import EvaluatedAgent
    from training.evaluate_agents import measured as measured_agent
    from training.evaluate_predictor import evaluate
    from training.population import load_target
    from training.publish_predictor import population_folder, unseen_games

    torch.set_num_threads(1)
    layouts = [load_layout(name) for name in LAYOUTS]
    size = {"episodes": 1, "timesteps": 20} if quick else {}
    planners = [
        measured_agent(layout, PLANNER, EvaluatedAgent(*load_agent(PLANNER, layout)), (), **size) for layout in layouts
    ]
    ring, with_human = load_layout("coordination_ring"), []
    plan = (
        CollectionPlan(1, 40) if quick else CollectionPlan(trajectories=20)
    )  # one partner only: with five, another seed moves the figure by two points
    for folder in sorted((WEIGHTS / ring.name).glob("*_predictor_*")):
        agent, _, form = folder.name.partition("_predictor_")
        network, _ = predictor_network(load_checkpoint(folder))
        games = unseen_games(ring, load_target(agent, ring), network, population_folder(ring), plan, HUMAN)
        with_human.append(evaluate(network, games).entry(ring.name, agent, form))
    return {
        "sha256": bundled_agents(),
        "agents": [*(entry for layout in layouts for entry in evaluate_bundled(layout, AGENTS, **size)), *planners],
        "with_human_bc": with_human,
        "observers": [observer(layout, agent, quick) for layout in layouts for agent in AGENTS],
    }


def observer(layout: Layout, agent: str, quick: bool = False) -> dict[str, Any]:
    """Measure the accuracy (%) of an observer who knows both agents' action probabilities, with the test partners."""
    from benchmarks.accuracy_ceiling import limits
    from training.collect import TEST

    return {"layout": layout.name, "agent": agent, "steps": limits(layout, agent, TEST, 60 if quick else STATES)}


def bundled_agents() -> dict[str, str]:
    """Return layout/agent -> sha256, of all agents whose figures are stored."""
    layouts = [load_layout(name) for name in LAYOUTS]
    names = {f"{layout.name}/{agent}": agent_sha256(agent, layout) for layout in layouts for agent in AGENTS}
    return {**names, f"coordination_ring/{HUMAN}": agent_sha256(HUMAN, load_layout("coordination_ring"))}


def bundled_entries() -> list[dict[str, Any]]:
    """Return the figures on the cards of the bundled predictors, as `kitchenmind evaluate predictor --intentions
    --json` would."""
    paths = sorted(WEIGHTS.glob("*/*_predictor_*/config.json"))
    configs = [json.loads(path.read_text(encoding="utf-8")) for path in paths]
    return [{**config["measured"], "intentions": config.get("measured_intentions")} for config in configs]


def summary(entries: Sequence[Mapping[str, Any]], figures: Mapping[str, Any]) -> str:
    """Return the table in README.md, markers included."""
    return "\n".join([BEGIN, *results_tables.summary(entries, figures["agents"]), END])


def rendered(entries: Sequence[Mapping[str, Any]], figures: Mapping[str, Any]) -> str:
    """Return the tables in docs/explanation/results.md, markers included."""
    sections = [
        _accuracy(entries, figures),
        _points(figures),
        _with_human(entries, figures),
        _next_interactions(entries),
    ]
    lines = [line for section in sections for line in section]
    return "\n".join([BEGIN, results_tables.WARNING, "", *lines, END])


def _accuracy(entries: Sequence[Mapping[str, Any]], figures: Mapping[str, Any]) -> list[str]:
    """Return the accuracy of the predictors of both sets of agents."""
    observers = figures["observers"]
    return [
        "Accuracy of the predictors of the published agents (%, mean of three steps; `window` is the paper's form).",
        "The observer knows the action probabilities of both agents, but not their random draws: no predictor can",
        "do better on average (`benchmarks/accuracy_ceiling.py`).",
        "",
        *results_tables.accuracy(entries, observers, SETS["published"], FORMS),
        "",
        "Accuracy of the predictors of the strong agents, with the same test partners:",
        "",
        *results_tables.accuracy(entries, observers, SETS["strong"], ("stream",)),
        "",
    ]


def _points(figures: Mapping[str, Any]) -> list[str]:
    return [
        "Points of the agents in 400 timesteps (± standard error; held-out: partners that none of the four was",
        "trained with, the same for all):",
        "",
        *results_tables.points(figures["agents"]),
        "",
    ]


def _with_human(entries: Sequence[Mapping[str, Any]], figures: Mapping[str, Any]) -> list[str]:
    return [
        f"Accuracy on Coordination Ring with a behaviour-cloned human (`{HUMAN}`), next to the accuracy with the test",
        "partners and the paper's with humans (%):",
        "",
        *results_tables.with_human(entries, figures["with_human_bc"]),
        "",
    ]


def _next_interactions(entries: Sequence[Mapping[str, Any]]) -> list[str]:
    lines = [
        "The agent's next interaction ([intentions](intentions.md)): how often its kind and station are predicted",
        "correctly 1, 2 and 4 s before it is done, and in parentheses the kind alone (%). Test partners as above.",
        "",
    ]
    for name, form in (("published", "window"), ("strong", "stream")):
        table = results_tables.next_interactions(entries, SETS[name], form)
        lines += [f"The {name} agents, form `{form}`:", "", *table, ""]
    return lines


if __name__ == "__main__":
    main()
