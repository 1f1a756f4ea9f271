"""Count participants and episodes from assignment to analysis, with every reason for exclusion."""

from collections.abc import Sequence

import polars as pl

from analysis.formatting import listed
from analysis.results import Result
from analysis.tables import Export

WITHDRAWN = "asked for withdrawal, data deleted"
NO_EPISODE = "finished without an episode that is analysed"
WATCHED = "watched partner: their rounds are those of the other person"
REASONS = {
    "active": "still taking part",
    "screened_out": "did not pass the checks",
    "withdrawn": WITHDRAWN,
    "timed_out": "not seen for too long",
    "returned": "left without a partner, or was released by the researcher",
}


def flow(export: Export, episodes: pl.DataFrame, analysed: pl.DataFrame) -> list[Result]:
    """Count by condition (and `all`), in the order of a flow diagram; `note` holds a reason, `test` names the step:
    assigned, left, excluded, watched, no_episode, analysed (people), played, unfinished, removed, analysed
    (episodes)."""
    participants, conditions = export.participants, export.conditions
    everybody = pl.concat([participants.select("condition"), export.withdrawals.select("condition")])
    rows = _counts("assigned", everybody, conditions, "people")
    if export.withdrawals.height:
        rows += _counts("left", export.withdrawals, conditions, "people", WITHDRAWN)
    for status in [name for name in participants["status"].unique(maintain_order=True) if name != "completed"]:
        left = participants.filter(pl.col("status") == status)
        rows += _counts("left", left, conditions, "people", REASONS.get(str(status), str(status)))
    completed = participants.filter(pl.col("status") == "completed")
    rows += _by_reason("excluded", completed.filter(pl.col("excluded") != ""), conditions, "people")
    watched = watched_partners(export, analysed)
    rows += _counts("watched", watched, conditions, "people", WATCHED) if watched.height else []
    empty = without_episode(export, analysed)
    rows += _counts("no_episode", empty, conditions, "people", NO_EPISODE) if empty.height else []
    people = analysed.unique("participant", maintain_order=True)
    rows += _counts("analysed", people, conditions, "people")
    return rows + _episodes(participants, episodes, conditions) + _counts("analysed", analysed, conditions, "episodes")


def watched_partners(export: Export, analysed: pl.DataFrame) -> pl.DataFrame:
    """Return the participants of rounds of two people who finished, were not excluded, and have no analysed episode
    because each of their rounds counts for the other person."""
    begun = export.episodes.filter(pl.col("status") != "new")
    finished = export.participants.filter((pl.col("status") == "completed") & (pl.col("excluded") == ""))
    watched = finished.join(begun.select(participant="watched_person"), on="participant", how="semi")
    return watched.join(analysed.select("participant"), on="participant", how="anti")


def without_episode(export: Export, analysed: pl.DataFrame) -> pl.DataFrame:
    """Return the participants who finished, were not excluded or only watched, and have no analysed episode: each was
    removed, or not played to its end."""
    finished = export.participants.filter((pl.col("status") == "completed") & (pl.col("excluded") == ""))
    for others in (analysed, watched_partners(export, analysed)):
        finished = finished.join(others.select("participant"), on="participant", how="anti", maintain_order="left")
    return finished


def _episodes(participants: pl.DataFrame, episodes: pl.DataFrame, conditions: Sequence[str]) -> list[Result]:
    unit = "episodes"
    played = episodes.filter(pl.col("status") != "new")
    rows = _counts("played", played, conditions, unit)
    done = played.filter(pl.col("status") == "done")
    rows += _counts("unfinished", played.filter(pl.col("status") != "done"), conditions, unit)
    rows += _by_reason("removed", done.filter(pl.col("excluded") != ""), conditions, unit)
    kept = done.filter(pl.col("excluded") == "")
    complete = pl.col("participant").is_in(_named(participants.filter(pl.col("status") == "completed")))
    names = _named(participants.filter(pl.col("excluded") != ""))
    of_excluded = pl.any_horizontal(pl.col("participant", "watched_person").is_in(names).fill_null(value=False))
    for step, wanted in (("of_incomplete", ~complete), ("of_excluded", complete & of_excluded)):
        others = kept.filter(wanted)
        rows += _counts(step, others, conditions, unit) if others.height else []
    return rows


def _named(participants: pl.DataFrame) -> list[str]:
    return participants["participant"].to_list()


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


def versions_notice(export: Export) -> str:
    """Say that several versions of the study are analysed together, and how to choose one; empty if there is one."""
    if len(export.versions) < 2:
        return ""
    who = export.subjects
    parts = [
        f"version {version} ({count} {who.participant if count == 1 else who.participants})"
        for version, count in export.versions.items()
    ]
    return (
        f"This data set holds several versions of the study, analysed together: {listed(parts)}. "
        "To analyse one of them, add --study-version and its number."
    )
