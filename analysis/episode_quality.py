"""Quality proposals for single episodes while a study runs: the same rules, measures and code as the report's."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import polars as pl

from analysis import data_quality, measures
from analysis.tables import export_of


def episode_proposals(tables: Mapping[str, pl.DataFrame], chosen: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Return the proposal for each chosen episode, with the rules that say so. `tables`: those of an export, with all
    episodes and answers of the participants; of episodes that are not chosen, ticks may be missing."""
    export = export_of(tables, Path(), "")
    found = data_quality.proposals(measures.episode_measures(export), export.answers)
    found = found.filter(pl.col("episode").is_in(list(chosen)))
    return {row[0]: (row[1], row[2] or "") for row in found.select("episode", "proposal", "rules").iter_rows()}
