"""The accuracy of predictors in the games that were played, in addition to the offline test. The interval is over
people: ticks of one game are not independent trials.

Each predictor counts by itself: conditions may have another form of it, or one with errors added on purpose.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import polars as pl

from analysis.person_means import mean_over_people
from analysis.results import Result
from analysis.tables import STEPS

_DEGRADED: Final = re.compile(r"@(\d+(?:\.\d+)?)$")  # as the server writes it, see models/agents/model_paths.py


def degraded_to(predictor: str) -> float | None:
    """Return the accuracy in % to which a predictor was degraded on purpose: 60 for `sp_predictor_stream@60`. None: it
    is as it was trained."""
    found = _DEGRADED.search(predictor)
    return float(found[1]) if found else None


def without_degradation(predictor: str) -> str:
    """Return the name of the predictor as it was trained."""
    return _DEGRADED.sub("", predictor)


def with_predictor(episodes: pl.DataFrame) -> pl.DataFrame:
    """Return the episodes with the name of the predictor that ran; empty: an older export, or none ran."""
    name = pl.col("predictor").cast(pl.String).fill_null("") if "predictor" in episodes.columns else pl.lit("")
    return episodes.with_columns(predictor=name)


def predictors_of(episodes: pl.DataFrame, agent: str) -> list[str]:
    """Return the predictors that watched an agent, those with errors added on purpose last, the best of them first."""
    mine = with_predictor(episodes).filter(pl.col("agent") == agent)
    names = [str(name) for name in mine["predictor"].unique(maintain_order=True)]
    return sorted(names, key=lambda name: (degraded_to(name) is not None, -(degraded_to(name) or 0)))


def human_agents(episodes: pl.DataFrame) -> frozenset[str]:
    """Return the partners, by the names that the study gives them, who are people: agents with `human: true`."""
    return frozenset(episodes.filter(pl.col("watched_person").is_not_null())["agent"])


def live(episodes: pl.DataFrame, layouts: Sequence[str], agents: Sequence[str]) -> list[Result]:
    """Accuracy per agent, predictor (in `note`) and layout, for every step and for their mean (step 0); over all
    conditions in which the predictor ran, shown or not, and for each condition alone."""
    rows = []
    conditions = ["", *episodes["condition"].unique(maintain_order=True)]
    for agent in agents:
        for predictor in predictors_of(episodes, agent):
            chosen = with_predictor(episodes).filter(pl.col("agent") == agent, pl.col("predictor") == predictor)
            for layout in [*layouts, "all"]:
                for condition in conditions:
                    row = Result("accuracy", "live", layout, agent, condition=condition or "all", note=predictor)
                    rows += _rows(chosen, row)
    return [row for row in rows if row.n]


def _rows(chosen: pl.DataFrame, base: Result) -> list[Result]:
    if base.layout != "all":
        chosen = chosen.filter(pl.col("layout") == base.layout)
    if base.condition != "all":
        chosen = chosen.filter(pl.col("condition") == base.condition)
    return [
        mean_over_people(chosen, f"accuracy_{step}" if step else "accuracy", replace(base, step=step))
        for step in range(STEPS + 1)
    ]


def offline(cards: Mapping[str, Mapping[str, object]], layouts: Sequence[str], agents: Sequence[str]) -> list[Result]:
    """Accuracy with unseen partners, from the models' cards: agent -> predictor (in `note`) -> layout -> a share for
    each step. No rows without a card."""
    rows = []
    for agent in agents:
        for predictor, known in cards.get(agent, {}).items():
            if isinstance(known, Mapping):
                rows += _offline_rows(known, layouts, Result("accuracy", "offline", agent=agent, note=predictor))
    return rows


def _offline_rows(known: Mapping[str, Sequence[float]], layouts: Sequence[str], base: Result) -> list[Result]:
    shares = {layout: [float(share) for share in known[layout]] for layout in layouts if layout in known}
    if len(shares) == len(layouts) and layouts:
        shares["all"] = [sum(column) / len(layouts) for column in zip(*shares.values(), strict=True)]
    return [
        replace(base, layout=layout, step=step, estimate=share, unit="predictions")
        for layout, steps in shares.items()
        for step, share in enumerate([sum(steps) / len(steps), *steps])
    ]
