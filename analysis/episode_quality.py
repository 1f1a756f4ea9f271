"""Quality proposals for single episodes while a study runs: the same rules, measures and code as the report's."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from analysis import data_quality, measures
from analysis.tables import export_of, frame


def judge(tables: Mapping[str, Any]) -> dict[str, tuple[str, str]]:
    """Episode -> proposal and the rules that say so. `tables`: those of an export, as anything Arrow-like."""
    export = export_of({name: frame(table) for name, table in tables.items()}, Path(), "")
    found = data_quality.proposals(measures.episode_measures(export), export.answers)
    return {row[0]: (row[1], row[2] or "") for row in found.select("episode", "proposal", "rules").iter_rows()}
