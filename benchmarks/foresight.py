"""Measure how much simulated participants gain from foresight: paired differences in every kitchen of the study.

    python benchmarks/foresight.py            plays what is missing in --folder, prints the tables
    python benchmarks/foresight.py --write    also writes foresight.json and the tables of docs/explanation/foresight.md

The participants are programs that are built so that foresight can help: no evidence about people. They play with the
bundled agents, without predictions, with random ones, with those of the bundled predictors (ToM) and with the agent's
true next actions: see support/foresight_games.py.
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy asks
# `training.py` next to this file has the name of a package: remove this folder from the module search path.
ROOT = Path(__file__).resolve().parent.parent
sys.path[:] = [str(ROOT), *(folder for folder in sys.path if Path(folder).resolve() != ROOT / "benchmarks")]

import numpy as np  # noqa: E402
from numpy.typing import NDArray  # noqa: E402

from analysis.effects import mean_interval  # noqa: E402
from benchmarks.processor import described as processor  # noqa: E402
from benchmarks.support.foresight_games import NONE, RANDOM, SEED, TOM, TRUE, VARIANTS, Cell, played  # noqa: E402
from models.agents.catalogue import agent_sha256  # noqa: E402
from overcooked.constants import HORIZON  # noqa: E402
from overcooked.layout import load_layout  # noqa: E402
from server.bots.foresight.people import FITTED, VERSION, described  # noqa: E402
from server.required_models import fingerprint  # noqa: E402

FIGURES, DOCUMENT = Path(__file__).with_suffix(".json"), ROOT / "docs" / "explanation" / "foresight.md"
EFFECT = ROOT / "analysis" / "simulated_effect.json"  # what `kitchenmind power --simulated-effect` reads
FITTED_FIGURES = Path(__file__).with_name("fit_simulated_participants.json")
FEWER = (
    "The rows below 100 % and the next table have 50 episodes a cell, all with the participant on seat 0; the 100 % "
    "row and the tables above have 200 on both seats, so the rows are not exactly comparable."
)
BEGIN, END = "<!-- tables of benchmarks/foresight.py -->", "<!-- end of the tables -->"
LAYOUTS = ("coordination_ring", "double_rings", "double_counters", "matrix", "clear_division")
POOLED = LAYOUTS[:4]
AGENTS = ("sp", "fcp")
ACCURACIES = (1.0, 0.89, 0.77, 0.67, 0.57, 0.48, 0.38, 0.29)


def cells() -> Iterator[tuple[str, Cell]]:
    """Yield (part, cell), the most important part first."""
    for kinds in ((NONE, RANDOM, TOM), (TRUE,)):
        for layout in LAYOUTS:
            for agent in AGENTS:
                for shown in kinds:
                    yield "main", Cell(layout, agent, shown)
    for part, shown_variants in (
        ("accuracy", [(TRUE, "all", right) for right in ACCURACIES[1:]]),
        ("credulous", [(shown, "credulous", 1.0) for shown in (RANDOM, TOM)]),
        ("sensitivity", [(s, v, 1.0) for v in VARIANTS if v not in ("all", "credulous") for s in (NONE, TOM)]),
    ):
        for shown, variant, right in shown_variants:
            for layout in POOLED:
                for agent in AGENTS:
                    yield part, Cell(layout, agent, shown, variant, right)


def measured(
    folder: Path, episodes: Mapping[str, int], horizon: int, play: bool = True
) -> dict[str, dict[str, list[float]]]:
    """Play the cells that are not in the folder, unless that is switched off, and return all cells by name."""
    folder.mkdir(parents=True, exist_ok=True)
    found = {}
    for part, cell in cells():
        path = folder / f"{cell.name}.json"
        settings = {
            "cell": asdict(cell),
            "episodes": episodes[part],
            "horizon": horizon,
            "seed": SEED,
            "agent": agent_sha256(cell.agent, load_layout(cell.layout)),
            "predictor": fingerprint(cell.layout, f"{cell.agent}_predictor_stream") if cell.shown == TOM else None,
            "version": VERSION,
            "parameters": json.loads(json.dumps(described(FITTED))),
        }
        stored = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
        if stored.get("settings") != settings:
            if not play:
                continue
            began = time.monotonic()
            stored = {"settings": settings, "found": played(cell, episodes[part], horizon)}
            path.write_text(json.dumps(stored), encoding="utf-8")
            mean = np.mean(stored["found"]["points"])
            print(f"{part}: {cell.name}: {mean:.1f} points, {time.monotonic() - began:.0f} s", file=sys.stderr)
        found[cell.name] = stored["found"]
    return found


def difference(one: NDArray[np.float64], other: NDArray[np.float64]) -> dict[str, float]:
    """Return the mean paired difference with its 95 % interval."""
    mean = mean_interval(one - other)
    return {"mean": mean.value, "low": mean.low, "high": mean.high, "episodes": one.size}


class ForesightSummary:
    """The figures of all cells, and statistics of them."""

    def __init__(self, found: Mapping[str, Mapping[str, Sequence[float]]]) -> None:
        self._found = found

    def of(self, cell: Cell, figure: str = "points") -> NDArray[np.float64]:
        return np.array(self._found[cell.name][figure], np.float64)

    def has(self, shown: str, variant: str = "all", right: float = 1.0, layouts: Sequence[str] = POOLED) -> bool:
        """Return whether these cells were played."""
        names = [Cell(layout, agent, shown, variant, right).name for layout in layouts for agent in AGENTS]
        return all(name in self._found for name in names)

    def pooled(self, shown: str, variant: str = "all", right: float = 1.0, figure: str = "points") -> Any:
        """Return the mean over the first four kitchens and both agents, for each episode number: the same person."""
        every = [self.of(Cell(one, agent, shown, variant, right), figure) for one in POOLED for agent in AGENTS]
        return np.mean(every, 0)

    def pooled_difference(self, one: tuple[Any, ...], other: tuple[Any, ...]) -> dict[str, float]:
        first, second = self.pooled(*one), self.pooled(*other)
        fewer = min(len(first), len(second))
        return difference(first[:fewer], second[:fewer])

    def figures(self) -> dict[str, Any]:
        """Return everything that the document says, as plain data: of all cells that were played."""
        played_here = [name for name in (RANDOM, TOM, TRUE) if self.has(name)] if self.has(NONE) else []
        sensitive = [name for name in VARIANTS if name not in ("all", "credulous")]
        return {
            "missing": sum(cell.name not in self._found for _, cell in cells()),
            "main": [self._row(layout, agent) for layout in LAYOUTS for agent in AGENTS],
            "pooled": {shown: self.pooled_difference((shown,), (NONE,)) for shown in played_here},
            "accuracy": [
                {
                    "kept": right,
                    "measured": float(self.pooled(TRUE, "all", right, "accuracy").mean()),
                    "gain": self.pooled_difference((TRUE, "all", right), (NONE,)),
                }
                for right in ACCURACIES
                if self.has(TRUE, "all", right)
            ],
            "credulous": {
                shown: self.pooled_difference((shown, "credulous"), (NONE,))
                for shown in (RANDOM, TOM)
                if self.has(shown, "credulous")
            },
            "sensitivity": {
                variant: self.pooled_difference((TOM, variant), (NONE, variant))
                for variant in sensitive
                if self.has(TOM, variant) and self.has(NONE, variant)
            },
        }

    def _row(self, layout: str, agent: str) -> dict[str, Any]:
        """One kitchen with one agent."""
        row: dict[str, Any] = {"layout": layout, "agent": agent}
        played_here = [
            cell for kind in (NONE, RANDOM, TOM, TRUE) if (cell := Cell(layout, agent, kind)).name in self._found
        ]
        for cell in played_here:
            found = {figure: float(self.of(cell, figure).mean()) for figure in ("points", "collisions")}
            row[cell.shown] = found
            if cell.shown != NONE:
                against = difference(self.of(cell), self.of(Cell(layout, agent, NONE)))
                row[cell.shown] |= {"accuracy": float(self.of(cell, "accuracy").mean()), "difference": against}
        return row


def _interval(found: Mapping[str, float] | None) -> str:
    if found is None:
        return "not yet played"
    return f"{found['mean']:+.1f} [{found['low']:.1f}, {found['high']:.1f}]"


def rendered(figures: Mapping[str, Any], fit: Mapping[str, Any]) -> str:
    """Return the tables of the document, markers included."""
    version = figures["version"]
    lines = [BEGIN, f"Simulated participants of version {version}; {figures['processor']}; seed {figures['seed']}.", ""]
    if figures["missing"]:
        lines += [f"{figures['missing']} of {len(list(cells()))} cells are not yet played.", ""]
    lines += [*_main_tables(figures), *_sensitivity_tables(figures), *_fit_tables(fit), END]
    return "\n".join(lines)


def _main_tables(figures: Mapping[str, Any]) -> list[str]:
    """Return points and collisions by kitchen, agent and predictions."""
    title = {name: name.replace("_", " ").title() for name in LAYOUTS}
    main, pooled, kinds = figures["main"], figures["pooled"], (RANDOM, TOM, TRUE)
    lines = ["Points of 400 timesteps, and paired differences from no predictions with 95 % intervals:", ""]
    head = ["kitchen", "agent", "none", "random - none", "ToM - none", "true - none", "ToM accuracy"]
    rows = [
        [
            title[row["layout"]], row["agent"].upper(), _number(row, NONE, "points", ".0f"),
            *(_interval(row.get(shown, {}).get("difference")) for shown in kinds), _number(row, TOM, "accuracy", ".0%"),
        ]
        for row in main
    ]  # fmt: skip
    rows.append(["first four, pooled", "both", "", *(_interval(pooled.get(shown)) for shown in kinds), ""])
    lines += _table(head, rows)
    lines += ["", "Collisions in 400 timesteps:", ""]
    rows = [
        [
            title[row["layout"]],
            row["agent"].upper(),
            *(_number(row, one, "collisions", ".1f") for one in (NONE, *kinds)),
        ]
        for row in main
    ]
    return [*lines, *_table(["kitchen", "agent", NONE, RANDOM, "ToM", TRUE], rows), ""]


def _sensitivity_tables(figures: Mapping[str, Any]) -> list[str]:
    """Return the gain by accuracy, for other parameters, and of participants who believe every arrow."""
    lines = [
        f"Gain by accuracy: the true actions, mixed with wrong ones (first four kitchens, both agents). {FEWER}",
        "",
    ]
    lines += _table(
        ["arrows kept true", "accuracy, measured", "gain over none"],
        [
            [f"{100 * r['kept']:.0f} %", f"{100 * r['measured']:.0f} %", _interval(r["gain"])]
            for r in figures["accuracy"]
        ],
    )
    lines += ["", "Sensitivity of ToM - none, and participants who believe every arrow (first four kitchens):", ""]
    rows = [[f"{variant}: ToM - none", _interval(found)] for variant, found in figures["sensitivity"].items()]
    rows += [[f"credulous: {shown} - none", _interval(found)] for shown, found in figures["credulous"].items()]
    return [*lines, *_table(["", "points"], rows), ""]


def _number(row: Mapping[str, Any], shown: str, figure: str, how: str) -> str:
    return format(row[shown][figure], how) if shown in row else "not yet played"


def _fit_tables(fit: Mapping[str, Any]) -> list[str]:
    """Simulated pairs against recorded pairs of people."""
    head = ["kitchen", "games", "no key", "interactions", "collisions", "soups", "cross-entropy (nats)"]
    rows = []
    for part in ("fitted games", "held-out games"):
        for name, cell in fit[part].items():
            pairs = [
                [f"{cell[who][fact] * scale:.{digits}f}" for who in ("people", "simulated")]
                for fact, scale, digits in (
                    ("stay", 100, 0), ("interact", 100, 1), ("collisions", 1, 1), ("soups", 1, 1),
                )
            ]  # fmt: skip
            cells = [" / ".join(pair) for pair in pairs]
            rows.append([name.replace("_", " ").title(), part, *cells, f"{cell['likelihood']['nats']:.2f}"])
    intro = "People / simulated pairs at 150 ms a timestep, without arrows (shares in %; numbers in 400 timesteps):"
    return [intro, "", *_table(head, rows), ""]


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    return [f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows)]


def main() -> None:
    parser = argparse.ArgumentParser(
        allow_abbrev=False, description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--folder", type=Path, default=ROOT / "runs" / "foresight", help="the cells played so far")
    parser.add_argument("--tables", action="store_true", help="play nothing: the tables of what the folder has")
    parser.add_argument("--write", action="store_true", help="write the figures and the tables")
    parser.add_argument("--quick", action="store_true", help="two short episodes of each cell; nothing is stored")
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    arguments = parser.parse_args()
    if arguments.quick and arguments.write:
        parser.error("--quick measures too little to be stored: leave out --write.")
    number = {"main": 200, "accuracy": 50, "credulous": 50, "sensitivity": 50}
    episodes, horizon = (dict.fromkeys(number, 2), 20) if arguments.quick else (number, HORIZON)
    folder = arguments.folder / "quick" if arguments.quick else arguments.folder
    found = measured(folder, episodes, horizon, not arguments.tables)
    figures = ForesightSummary(found).figures() | {"processor": processor(), "seed": SEED, "version": VERSION}
    fit = json.loads(FITTED_FIGURES.read_text(encoding="utf-8"))
    print(json.dumps(figures, indent=1) if arguments.json else rendered(figures, fit))
    if arguments.write:
        FIGURES.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
        if TOM in figures["pooled"]:
            effect = figures["pooled"][TOM] | {"layouts": POOLED, "agents": AGENTS, "seed": SEED}
            effect["games"] = effect.pop("episodes") * len(POOLED) * len(AGENTS)
            EFFECT.write_text(json.dumps(effect, indent=1) + "\n", encoding="utf-8")
        text = DOCUMENT.read_text(encoding="utf-8")
        tables = rendered(figures, fit)
        DOCUMENT.write_text(f"{text.partition(BEGIN)[0]}{tables}{text.partition(END)[2]}", encoding="utf-8")


if __name__ == "__main__":
    main()
