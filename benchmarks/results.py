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

from benchmarks.support import kept_figures, published_recipe  # noqa: E402
from models.agents.catalogue import WEIGHTS, agent_sha256  # noqa: E402
from overcooked.layout import load_layout  # noqa: E402

FIGURES = Path(__file__).with_suffix(".json")
README, DOCUMENT = ROOT / "README.md", ROOT / "docs" / "explanation" / "results.md"
BEGIN, END = "<!-- tables of benchmarks/results.py -->", "<!-- end of the tables -->"
LAYOUTS = ("coordination_ring", "double_rings", "double_counters", "matrix", "clear_division")
AGENTS = ("sp", "fcp")
HUMAN, PLANNER = "human_bc", "planner"
PUBLISHED = {  # the paper's accuracy (%), mean of the three steps, in the order of LAYOUTS
    ("sp", "offline"): (79.42, 70.91, 73.70, 76.08, 73.44),
    ("fcp", "offline"): (89.54, 87.61, 85.40, 76.83, 91.44),
    ("sp", "with humans"): (82.29, 61.77, 65.84, 60.37, 77.88),
    ("fcp", "with humans"): (86.60, 78.34, 76.51, 76.97, 83.13),
}
WARNING = """\
The figures are not directly comparable with the paper's. Only Coordination Ring is the published grid; the other four
are redrawn from its pictures. All agents were trained here, on fewer timesteps, and act almost deterministically, which
makes them easier to predict (see the ceiling). Accuracy is measured with partner agents that were used neither for
training nor for early stopping."""


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
    from training.choose import evaluate_bundled
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
    }


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
    by_cell = _by_cell(entries)
    rows = []
    for agent in AGENTS:
        cells = [by_cell[layout, agent, "stream"] for layout in LAYOUTS]
        ours = [f"{entry['accuracy']['mean']:.1f} ({entry['ceiling_step1']:.0f})" for entry in cells]
        rows.append([f"{agent.upper()}: accuracy in % (ceiling of step 1)", *ours])
        rows.append(["the paper's", *(f"{value:.1f}" for value in PUBLISHED[agent, "offline"])])
    points = [row for row in _points(figures["agents"]) if "held-out" in row[0]]
    return "\n".join([BEGIN, *_table(_head(), [*rows, *([f"{name}: points", *cells] for name, *cells in points)]), END])


def _by_cell(entries: Sequence[Mapping[str, Any]]) -> dict[tuple[str, str, str], Mapping[str, Any]]:
    return {(entry["layout"], entry["agent"], entry["form"]): entry for entry in entries}


def _head() -> list[str]:
    return ["", *(name.replace("_", " ").title() for name in LAYOUTS)]


def rendered(entries: Sequence[Mapping[str, Any]], figures: Mapping[str, Any]) -> str:
    """Return the tables in docs/explanation/results.md, markers included."""
    by_cell = _by_cell(entries)
    head = _head()
    rows = [row for agent in AGENTS for row in _rows(agent, by_cell)]
    return "\n".join(
        [
            BEGIN,
            WARNING,
            "",
            "Accuracy of the predictors (%, mean of the three steps):",
            "",
            *_table(head, rows),
            "",
            "Points of the agents in 400 timesteps (± standard error; held-out: partners that neither agent was "
            "trained with, the same for both):",
            "",
            *_table(head, _points(figures["agents"])),
            "",
            *_with_human(by_cell, figures["with_human_bc"]),
            *_next_interactions(by_cell),
            *_published_recipe(),
            END,
        ]
    )


def _rows(agent: str, by_cell: Mapping[tuple[str, str, str], Mapping[str, Any]]) -> list[list[str]]:
    """Return the rows of one agent: the paper's, ours, and what ours is compared with."""
    cells = [by_cell[layout, agent, "stream"] for layout in LAYOUTS]
    name = agent.upper()
    steps = [[f"{entry['accuracy'][f'step{k}']:.1f}" for k in (1, 2, 3)] for entry in cells]
    return [
        [f"{name}, the paper", *(f"{value:.2f}" for value in PUBLISHED[agent, "offline"])],
        [f"**{name}, ours**", *(f"**{entry['accuracy']['mean']:.2f}**" for entry in cells)],
        ["steps 1 / 2 / 3", *(" / ".join(step) for step in steps)],
        ["ceiling of step 1", *(f"{entry['ceiling_step1']:.1f}" for entry in cells)],
        [
            "baselines: last action again / most frequent",
            *(f"{entry['baselines']['repeat']:.1f} / {entry['baselines']['frequent']:.1f}" for entry in cells),
        ],
        ["without stuck timesteps", *(f"{entry['not_stuck']['mean']:.1f}" for entry in cells)],
        ["calibration error", *(f"{entry['ece']:.3f}" for entry in cells)],
    ]


def _points(agents: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    found = {(entry["layout"], entry["agent"]): entry for entry in agents}
    kinds = [
        *((agent, key) for agent in AGENTS for key in ("self_play", "held_out")),
        (PLANNER, "self_play"),
    ]
    words = {"self_play": "with itself", "held_out": "held-out partners"}
    return [
        [
            f"{agent.upper() if agent in AGENTS else 'two planners (scripted)'}, {words[key]}",
            *(f"{found[layout, agent][key]['mean']:.0f} ± {found[layout, agent][key]['se']:.0f}" for layout in LAYOUTS),
        ]
        for agent, key in kinds
    ]


def _with_human(
    by_cell: Mapping[tuple[str, str, str], Mapping[str, Any]], entries: Sequence[Mapping[str, Any]]
) -> list[str]:
    """Return the table of accuracy with a behaviour-cloned human."""
    lines = [
        f"Accuracy on Coordination Ring with a behaviour-cloned human (`{HUMAN}`), next to the accuracy with the test",
        "partners and the paper's with humans (%):",
        "",
    ]
    rows = []
    for entry in entries:
        offline = by_cell[entry["layout"], entry["agent"], entry["form"]]["accuracy"]["mean"]
        published = (f"{PUBLISHED[entry['agent'], kind][0]:.2f}" for kind in ("offline", "with humans"))
        rows.append(
            [
                f"{entry['agent'].upper()} ({entry['form']})",
                f"{offline:.2f}",
                f"{entry['accuracy']['mean']:.2f}",
                f"{entry['ceiling_step1']:.1f}",
                " → ".join(published),
            ]
        )
    head = ["", "offline", "with human_bc", "its ceiling of step 1", "the paper, offline → with humans"]
    return [*lines, *_table(head, rows), ""]


def _next_interactions(by_cell: Mapping[tuple[str, str, str], Mapping[str, Any]]) -> list[str]:
    """Return the table of how often the agent's next interaction is predicted, by time before it is done."""
    lines = [
        "The agent's next interaction ([intentions](intentions.md)): how often its kind and station are predicted",
        "correctly 1, 2 and 4 s before it is done, and in parentheses the kind alone (%). Test partners as above.",
        "",
    ]
    rows = []
    for agent in AGENTS:
        cells = [by_cell[layout, agent, "stream"]["intentions"] for layout in LAYOUTS]
        name = agent.upper()
        rows += [
            [
                f"**{name}, {int(timesteps) // 5} s before**",
                *(_share_of_both(entry["before"][timesteps]) for entry in cells),
            ]
            for timesteps in cells[0]["before"]
        ]
        rows += [
            [f"{name}, {words}: 1 / 2 / 4 s", *(_at_all_times(entry, key) for entry in cells)]
            for key, words in (
                ("first_two", "it or the runner-up"),
                ("nearest_sensible", "nearest station that makes sense"),
                ("frequent", "most frequent for hand and pots"),
                ("states", "states"),
            )
        ]
        rows += [
            [f"{name}, all states (none within 4 s)", *(f"{e['all_states']:.1f} ({e['none']:.1f})" for e in cells)],
            [f"{name}, calibration error", *(f"{entry['ece']:.3f}" for entry in cells)],
            [f"{name}, mean error of when, timesteps", *(f"{entry['when_error']:.1f}" for entry in cells)],
        ]
    return [*lines, *_table(_head(), rows), ""]


def _published_recipe() -> list[str]:
    """Return the table of what the preset `published` has finished."""
    found = {(entry["layout"], entry["agent"], entry["form"]): entry for entry in published_recipe.predictors()}
    points, rows, below = published_recipe.points(), [], []
    for agent in AGENTS:
        name = agent.upper()
        rows.append([f"{name}, the paper", *(f"{value:.2f}" for value in PUBLISHED[agent, "offline"])])
        for form in ("window", "stream"):
            cells = [found.get((layout, agent, form)) for layout in LAYOUTS]
            for layout, one, paper in zip(_head()[1:], cells, PUBLISHED[agent, "offline"], strict=True):
                below += [f"{name} ({form}) in {layout}"] if one and one["accuracy"]["mean"] <= paper else []
            rows.append(
                [f"**{name}, {form}**", *(f"**{one['accuracy']['mean']:.2f}**" if one else "–" for one in cells)]
            )
            rows.append(
                [
                    "step 1 / its ceiling",
                    *(f"{one['accuracy']['step1']:.1f} / {one['ceiling_step1']:.1f}" if one else "–" for one in cells),
                ]
            )
        rows.append([f"{name}, points with itself", *(points.get((layout, agent), "–") for layout in LAYOUTS)])
    missed = [f"Not above the paper's figure: {', '.join(below)}.", ""] if below else []
    return [*published_recipe.WORDS, "", *_table(_head(), rows), "", *missed]


def _share_of_both(values: Mapping[str, Any]) -> str:
    return "-" if values["kind"] is None else f"**{values['kind_and_station']:.1f}** ({values['kind']:.1f})"


def _at_all_times(entry: Mapping[str, Any], key: str) -> str:
    values = [each[key] for each in entry["before"].values()]
    return " / ".join("-" if value is None else f"{value:,}" if key == "states" else f"{value:.1f}" for value in values)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    return [f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows)]


if __name__ == "__main__":
    main()
