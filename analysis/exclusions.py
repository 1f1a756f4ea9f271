"""Who and what is in: from the participants assigned to the episodes analysed, with every reason in between."""

from collections.abc import Sequence

import polars as pl

from analysis.results import Result

REASONS = {
    "active": "still taking part",
    "screened_out": "did not pass the checks",
    "withdrawn": "asked for withdrawal",
    "timed_out": "left without a word",
    "returned": "returned the study",
}


def flow(
    participants: pl.DataFrame, episodes: pl.DataFrame, analysed: pl.DataFrame, conditions: Sequence[str]
) -> list[Result]:
    """Counts by condition (and `all`), in the order of a flow diagram; `note` holds a reason, `test` names the step:
    assigned, left, excluded, analysed (people), played, unfinished, removed, analysed (episodes)."""
    unit = "people"
    rows = _counts("assigned", participants, conditions, unit)
    for status in [name for name in participants["status"].unique(maintain_order=True) if name != "completed"]:
        left = participants.filter(pl.col("status") == status)
        rows += _counts("left", left, conditions, unit, REASONS.get(str(status), str(status)))
    rows += _by_reason("excluded", participants.filter(pl.col("excluded") != ""), conditions, unit)
    rows += _counts("analysed", analysed.unique("participant", maintain_order=True), conditions, unit)
    unit = "episodes"
    played = episodes.filter(pl.col("status") != "new")
    rows += _counts("played", played, conditions, unit)
    rows += _counts("unfinished", played.filter(pl.col("status") != "done"), conditions, unit)
    done = played.filter(pl.col("status") == "done")
    rows += _by_reason("removed", done.filter(pl.col("excluded") != ""), conditions, unit)
    of_excluded = participants.filter(pl.col("excluded") != "")["participant"].to_list()
    others = done.filter((pl.col("excluded") == "") & pl.col("participant").is_in(of_excluded))
    rows += _counts("removed", others, conditions, unit, "of excluded participants") if others.height else []
    return rows + _counts("analysed", analysed, conditions, unit)


def _by_reason(step: str, table: pl.DataFrame, conditions: Sequence[str], unit: str) -> list[Result]:
    rows: list[Result] = []
    for reason in sorted(table["excluded"].unique().to_list()):
        rows += _counts(step, table.filter(pl.col("excluded") == reason), conditions, unit, reason)
    return rows


def _counts(step: str, table: pl.DataFrame, conditions: Sequence[str], unit: str, reason: str = "") -> list[Result]:
    counts = {name: table.filter(pl.col("condition") == name).height for name in conditions}
    counts["all"] = table.height
    return [
        Result("exclusions", step, condition=name, estimate=float(count), n=count, unit=unit, note=reason)
        for name, count in counts.items()
    ]
