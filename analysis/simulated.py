"""Simulated participants and people: which is which, and never both in one analysis."""

from collections.abc import Mapping

import polars as pl

LABEL = "Simulated participants: no evidence about people"


def is_simulated(participants: pl.DataFrame) -> pl.Series:
    """Return for each participant whether it is a bot. Older exports do not say; they are taken for people."""
    if "simulated" not in participants.columns:
        return pl.Series("simulated", [False] * participants.height, pl.Boolean)
    return participants["simulated"].cast(pl.String).str.to_lowercase().eq("true").fill_null(value=False)


def without_pooling(raw: Mapping[str, pl.DataFrame]) -> tuple[dict[str, pl.DataFrame], int]:
    """Return the tables with people only, where there are any, and the number of simulated participants left out."""
    simulated = is_simulated(raw["participants"])
    if simulated.all():
        return dict(raw), 0
    return {**raw, "participants": raw["participants"].filter(~simulated)}, int(simulated.sum())
