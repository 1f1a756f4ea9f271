"""Measure how much simulated participants gain from foresight: paired differences in every kitchen of the study.

    python benchmarks/foresight.py            plays what is missing in --folder, prints the tables
    python benchmarks/foresight.py --write    also writes foresight.json, the tables of docs/explanation/foresight.md,
                                              and the effect that `kitchenmind power --simulated-effect` takes

The participants are programs that are built so that foresight can help: no evidence about people. They play with the
strong agents, without predictions, with random ones, with those of the bundled predictors (ToM) and with the agent's
true next actions: see support/foresight_games.py. Two seeds, each with people and chance of its own, are published
side by side.
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy asks
# `training.py` next to this file has the name of a package: remove this folder from the module search path.
ROOT = Path(__file__).resolve().parent.parent
sys.path[:] = [str(ROOT), *(folder for folder in sys.path if Path(folder).resolve() != ROOT / "benchmarks")]

import numpy as np  # noqa: E402

from benchmarks.processor import described as processor  # noqa: E402
from benchmarks.support.foresight_figures import AGENTS, POOLED, ForesightSummary, cells  # noqa: E402
from benchmarks.support.foresight_games import FIRST_SEED, FRESH_SEED, TOM, Cell, played  # noqa: E402
from benchmarks.support.foresight_tables import BEGIN, END, rendered  # noqa: E402
from benchmarks.support.kept_figures import keep, put  # noqa: E402
from models.agents.catalogue import agent_sha256  # noqa: E402
from overcooked.constants import HORIZON  # noqa: E402
from overcooked.layout import load_layout  # noqa: E402
from server.bots.foresight.people import FITTED, VERSION, described  # noqa: E402
from server.required_models import fingerprint  # noqa: E402

FIGURES, DOCUMENT = Path(__file__).with_suffix(".json"), ROOT / "docs" / "explanation" / "foresight.md"
EFFECT = ROOT / "analysis" / "simulated_effect.json"
FITTED_FIGURES = Path(__file__).with_name("fit_simulated_participants.json")
EPISODES = 200  # of every cell


def measured(
    folder: Path, episodes: int, horizon: int, seed: int, play: bool = True
) -> dict[str, dict[str, list[float]]]:
    """Play the cells that are not in the folder, unless that is switched off, and return all cells by name."""
    folder.mkdir(parents=True, exist_ok=True)
    found = {}
    for cell in (replace(one, seed=seed) for one in cells()):
        path, settings = folder / f"{cell.name}.json", _settings(cell, episodes, horizon)
        stored = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
        if stored.get("settings") != settings:
            if not play:
                continue
            began = time.monotonic()
            stored = {"settings": settings, "found": played(cell, episodes, horizon)}
            path.write_text(json.dumps(stored), encoding="utf-8")
            mean = np.mean(stored["found"]["points"])
            print(f"{seed}: {cell.name}: {mean:.1f} points, {time.monotonic() - began:.0f} s", file=sys.stderr)
        found[cell.name] = stored["found"]
    return found


def _settings(cell: Cell, episodes: int, horizon: int) -> dict[str, Any]:
    """Return everything that a stored cell depends on."""
    return {
        "cell": asdict(cell),
        "episodes": episodes,
        "horizon": horizon,
        "agent": agent_sha256(cell.agent, load_layout(cell.layout)),
        "predictor": fingerprint(cell.layout, f"{cell.agent}_predictor_stream") if cell.shown == TOM else None,
        "version": VERSION,
        "parameters": json.loads(json.dumps(described(FITTED))),
    }


def simulated_effect(runs: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the pooled difference between ToM and no predictions with the fresh seed, and what it was measured on."""
    pooled = next(run for run in runs if run["seed"] == FRESH_SEED)["pooled"][TOM]
    games = pooled["episodes"] * len(POOLED) * len(AGENTS)
    interval = {name: pooled[name] for name in ("mean", "low", "high")}
    return interval | {"layouts": POOLED, "agents": AGENTS, "seed": FRESH_SEED, "games": games}


def main() -> None:
    parser = argparse.ArgumentParser(
        allow_abbrev=False, description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--folder", type=Path, default=ROOT / "runs" / "foresight", help="the cells played so far")
    parser.add_argument("--tables", action="store_true", help="play nothing: the tables of what the folder has")
    parser.add_argument("--write", action="store_true", help="write the figures and the tables")
    parser.add_argument(
        "--quick", action="store_true", help="two short episodes of each cell, one seed: rough figures, not for --write"
    )
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    arguments = parser.parse_args()
    if arguments.quick and arguments.write:
        parser.error("--quick measures too little to be stored: leave out --write.")
    episodes, horizon = (2, 20) if arguments.quick else (EPISODES, HORIZON)
    folder = arguments.folder / "quick" if arguments.quick else arguments.folder
    runs = []
    for seed in (FRESH_SEED,) if arguments.quick else (FRESH_SEED, FIRST_SEED):
        found = measured(folder / str(seed), episodes, horizon, seed, not arguments.tables)
        runs.append({"seed": seed} | ForesightSummary(found).figures())
    figures = {"processor": processor(), "version": VERSION, "episodes": episodes, "horizon": horizon, "runs": runs}
    tables = rendered(figures, json.loads(FITTED_FIGURES.read_text(encoding="utf-8")))
    print(json.dumps(figures, indent=1) if arguments.json else tables)
    if arguments.write:
        keep(figures, FIGURES)
        keep(simulated_effect(runs), EFFECT)
        put(tables, DOCUMENT, BEGIN, END)


if __name__ == "__main__":
    main()
