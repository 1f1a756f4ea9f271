"""The predictor's accuracy in the games that were played, in addition to the offline test. The interval is over people:
ticks of one game are not independent trials.
"""

from collections.abc import Mapping, Sequence

import polars as pl

from analysis.person_means import mean_over_people
from analysis.results import Result
from analysis.tables import STEPS


def live(episodes: pl.DataFrame, layouts: Sequence[str], agents: Sequence[str]) -> list[Result]:
    """Accuracy per agent and layout, for every step and for their mean (step 0); over all conditions, because the
    predictor runs in every one, and for each condition alone."""
    rows = []
    conditions = ["", *episodes["condition"].unique(maintain_order=True)]
    for agent in agents:
        for layout in [*layouts, "all"]:
            for condition in conditions:
                rows += [_row(episodes, layout, agent, str(condition), step) for step in range(STEPS + 1)]
    return [row for row in rows if row.n]


def _row(episodes: pl.DataFrame, layout: str, agent: str, condition: str, step: int) -> Result:
    measure = f"accuracy_{step}" if step else "accuracy"
    chosen = episodes.filter(pl.col("agent") == agent)
    if layout != "all":
        chosen = chosen.filter(pl.col("layout") == layout)
    if condition:
        chosen = chosen.filter(pl.col("condition") == condition)
    row = Result("accuracy", "live", layout, agent, condition=condition or "all", step=step)
    return mean_over_people(chosen, measure, row)


def offline(cards: Mapping[str, object], layouts: Sequence[str], agents: Sequence[str]) -> list[Result]:
    """Accuracy with unseen partners, from the models' cards: agent -> layout -> a share for each step. No rows without
    a card."""
    rows = []
    for agent in agents:
        known = cards.get(agent)
        if not isinstance(known, Mapping):
            continue
        shares = {layout: [float(share) for share in known[layout]] for layout in layouts if layout in known}
        if len(shares) == len(layouts) and layouts:
            shares["all"] = [sum(column) / len(layouts) for column in zip(*shares.values(), strict=True)]
        for layout, steps in shares.items():
            means = [sum(steps) / len(steps), *steps]
            rows += [
                Result("accuracy", "offline", layout, agent, step=step, estimate=share, unit="predictions")
                for step, share in enumerate(means)
            ]
    return rows
