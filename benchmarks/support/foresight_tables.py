"""The tables of benchmarks/foresight.py, as Markdown."""

from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks.support.foresight_figures import LAYOUTS, cells
from benchmarks.support.foresight_games import FRESH_SEED, NONE, RANDOM, TOM, TRUE

BEGIN, END = "<!-- tables of benchmarks/foresight.py -->", "<!-- end of the tables -->"


def _kind_of(agent: str) -> str:
    """Return SP for `sp_strong`: the tables have one set of agents."""
    return agent.removesuffix("_strong").upper()


def _interval(found: Mapping[str, float] | None) -> str:
    if found is None:
        return "not yet played"
    return f"{found['mean']:+.1f} [{found['low']:.1f}, {found['high']:.1f}]"


def rendered(figures: Mapping[str, Any], fit: Mapping[str, Any]) -> str:
    """Return the tables of the document, markers included."""
    lines = [
        BEGIN,
        f"Simulated participants of version {figures['version']}; {figures['processor']}. Every cell has "
        f"{figures['episodes']} episodes of {figures['horizon']} timesteps, in half of them with the participant on "
        "the second seat. The agents are `sp_strong` and `fcp_strong`, the predictors those of the stream form.",
        "",
    ]
    for run in figures["runs"]:
        lines += [f"### Seed {run['seed']}", "", _origin(run["seed"]), ""]
        if run["missing"]:
            lines += [f"{run['missing']} of {len(list(cells()))} cells are not yet played.", ""]
        lines += [*_main_tables(run), *_sensitivity_tables(run)]
    return "\n".join([*lines, "### Simulated pairs and recorded people", "", *_fit_tables(fit), END])


def _origin(seed: int) -> str:
    """Return which versions of the participants played the games of a seed."""
    if seed == FRESH_SEED:
        return "A fresh seed: random numbers that no earlier version played with."
    return "The seed of version 1: the same random numbers for people and agents."


def _main_tables(figures: Mapping[str, Any]) -> list[str]:
    """Return points and collisions by kitchen, agent and predictions."""
    title = {name: name.replace("_", " ").title() for name in LAYOUTS}
    main, pooled, kinds = figures["main"], figures["pooled"], (RANDOM, TOM, TRUE)
    lines = ["Points of 400 timesteps, and paired differences from no predictions with 95 % intervals:", ""]
    head = ["kitchen", "agent", "none", "random - none", "ToM - none", "true - none", "ToM accuracy"]
    rows = [
        [
            title[row["layout"]], _kind_of(row["agent"]), _number(row, NONE, "points", ".0f"),
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
            _kind_of(row["agent"]),
            *(_number(row, one, "collisions", ".1f") for one in (NONE, *kinds)),
        ]
        for row in main
    ]
    return [*lines, *_table(["kitchen", "agent", NONE, RANDOM, "ToM", TRUE], rows), ""]


def _sensitivity_tables(figures: Mapping[str, Any]) -> list[str]:
    """Return the gain by accuracy, for other parameters, and of participants who believe every arrow."""
    lines = ["Gain by accuracy: the true actions, mixed with wrong ones (first four kitchens, both agents):", ""]
    lines += _table(
        ["arrows kept true", "accuracy, measured", "gain over none"],
        [
            [f"{100 * r['kept']:.0f} %", f"{100 * r['measured']:.0f} %", _interval(r["gain"])]
            for r in figures["accuracy"]
        ],
    )
    lines += ["", "Sensitivity of ToM - none, and participants who believe every arrow (first four kitchens):", ""]
    rows = [[f"{variant}: ToM - none", _interval(found)] for variant, found in figures["sensitivity"].items()]
    title = {RANDOM: "random", TOM: "ToM"}
    rows += [[f"credulous: {title[one]} - none", _interval(found)] for one, found in figures["credulous"].items()]
    return [*lines, *_table(["", "points"], rows), ""]


def _number(row: Mapping[str, Any], shown: str, figure: str, how: str) -> str:
    return format(row[shown][figure], how) if shown in row else "not yet played"


def _fit_tables(fit: Mapping[str, Any]) -> list[str]:
    """Compare simulated pairs with recorded pairs of people."""
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
