"""Measure the agents of the five classic kitchens with the human proxy, next to what Carroll et al. (2019) measured.

python benchmarks/classic_kitchens.py            measures and prints the table
python benchmarks/classic_kitchens.py --write    also writes classic_kitchens.json and docs/explanation/results.md
"""

import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import fmean, pstdev
from typing import Any

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy asks
# `training.py` next to this file has the name of a package: remove this folder from the module search path.
ROOT = Path(__file__).resolve().parent.parent
sys.path[:] = [str(ROOT), *(folder for folder in sys.path if Path(folder).resolve() != ROOT / "benchmarks")]

from benchmarks.support.kept_figures import KeptTable  # noqa: E402
from models.agents.catalogue import WEIGHTS, agent_sha256  # noqa: E402
from overcooked.layout import load_layout  # noqa: E402

FIGURES, DOCUMENT = Path(__file__).with_suffix(".json"), ROOT / "docs" / "explanation" / "results.md"
BEGIN, END = "<!-- table of benchmarks/classic_kitchens.py -->", "<!-- end of the table -->"
LAYOUTS = ("cramped_room", "asymmetric_advantages", "coordination_ring", "forced_coordination", "counter_circuit")
HUMAN = "human_bc"
AGENTS = ("sp", "fcp", HUMAN)
EPISODES = 100  # a seat
# Points of five self-play agents (five seeds): with themselves, with H_proxy as chef 1, as chef 2. Printed in the
# authors' notebook, github.com/HumanCompatibleAI/human_aware_rl, "NeurIPS Experiments and Visualizations.ipynb".
PUBLISHED = {
    "cramped_room": (
        (199.0, 182.0, 208.0, 199.5, 205.5), (90.5, 106.5, 106.0, 76.5, 104.5), (118.0, 104.5, 120.5, 104.5, 108.5),
    ),
    "asymmetric_advantages": (
        (176.0, 155.5, 168.5, 175.5, 160.5), (29.5, 51.0, 34.5, 48.0, 24.5), (98.5, 116.0, 100.0, 98.5, 103.0),
    ),
    "coordination_ring": (
        (196.5, 203.0, 193.5, 175.5, 185.5), (35.5, 108.5, 50.0, 64.5, 76.0), (46.0, 113.5, 59.5, 65.5, 79.5),
    ),
    "forced_coordination": (
        (153.5, 150.5, 140.5, 163.5, 151.5), (24.0, 26.5, 20.5, 31.5, 13.5), (38.0, 42.0, 35.5, 63.0, 11.0),
    ),
    "counter_circuit": (
        (110.0, 131.0, 131.0, 115.0, 124.5), (33.0, 32.0, 25.0, 29.5, 35.5), (31.5, 32.5, 25.0, 25.5, 45.5),
    ),
}  # fmt: skip


def main() -> None:
    KeptTable(FIGURES, DOCUMENT, BEGIN, END).measure_and_print(__doc__, measured, rendered)


def measured(quick: bool = False) -> dict[str, Any]:
    """Measure points in self-play and with the human proxy, with the hashes of the agents."""
    from training.choose_agents import evaluate_with

    size = {"episodes": 1, "timesteps": 20} if quick else {"episodes": EPISODES}
    entries = [entry for name in LAYOUTS for entry in evaluate_with(load_layout(name), HUMAN, AGENTS, **size)]
    return {"sha256": bundled_agents(), "agents": entries}


def bundled_agents() -> dict[str, str]:
    """Return layout/agent -> sha256 of every bundled agent."""
    return {
        f"{layout}/{agent}": agent_sha256(agent, load_layout(layout))
        for layout in LAYOUTS
        for agent in AGENTS
        if (WEIGHTS / layout / agent).is_dir()
    }


def rendered(figures: Mapping[str, Any]) -> str:
    """Return the table in docs/explanation/results.md, markers included."""
    found = {(entry["layout"], entry["agent"]): entry for entry in figures["agents"]}
    rows = [
        _row(found, "sp", "self_play", "**SP, with itself**"),
        ["Carroll et al.: SP, with itself", *(_over_seeds(PUBLISHED[layout][0]) for layout in LAYOUTS)],
        _row(found, "sp", "with_partner", f"**SP, with `{HUMAN}`**"),
        _seats(found, "sp"),
        ["Carroll et al.: SP, with their human proxy", *(_published(layout) for layout in LAYOUTS)],
        ["as chef 1 / as chef 2", *(_published_seats(layout) for layout in LAYOUTS)],
        _row(found, "fcp", "self_play", "**FCP, with itself**"),
        _row(found, "fcp", "with_partner", f"**FCP, with `{HUMAN}`**"),
        _seats(found, "fcp"),
        _row(found, HUMAN, "self_play", f"`{HUMAN}`, with itself"),
    ]
    head = ["", *(name.replace("_", " ").title() for name in LAYOUTS)]
    lines = [f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows)]
    return "\n".join([BEGIN, *lines, END])


def _row(found: Mapping[tuple[str, str], Mapping[str, Any]], agent: str, key: str, words: str) -> list[str]:
    entries = [found.get((layout, agent)) for layout in LAYOUTS]
    return [words, *("–" if one is None else f"{one[key]['mean']:.0f} ± {one[key]['se']:.0f}" for one in entries)]


def _seats(found: Mapping[tuple[str, str], Mapping[str, Any]], agent: str) -> list[str]:
    entries = [found.get((layout, agent)) for layout in LAYOUTS]
    seats = [[] if one is None else one["with_partner"]["seats"] for one in entries]
    return ["as chef 1 / as chef 2", *(" / ".join(f"{seat['mean']:.0f}" for seat in both) or "–" for both in seats)]


def _over_seeds(values: Sequence[float]) -> str:
    return f"{fmean(values):.0f} ± {pstdev(values) / len(values) ** 0.5:.0f}"


def _published(layout: str) -> str:
    """Average over the seeds; each seed has the mean of both seats."""
    return _over_seeds([fmean(pair) for pair in zip(*PUBLISHED[layout][1:], strict=True)])


def _published_seats(layout: str) -> str:
    return " / ".join(f"{fmean(values):.0f}" for values in PUBLISHED[layout][1:])


if __name__ == "__main__":
    main()
