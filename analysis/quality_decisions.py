"""Say of every episode whether it was analysed, and if not, why: its own exclusion or end, or its participant's."""

import polars as pl

from analysis.exclusions import REASONS

ANALYSED = "analysed"
PARTNER_EXCLUDED = "partner excluded"  # the other person of a round of two


def with_decisions(quality: pl.DataFrame, participants: pl.DataFrame, analysed: pl.DataFrame) -> pl.DataFrame:
    """Return the table of proposals with `decision`: analysed, or "out: " with the first reason that holds.
    `analysed`: the episodes that the results are about."""
    people = participants.select("participant", left=pl.col("status").cast(pl.String), removed=pl.col("excluded"))
    left = pl.col("left").replace(REASONS)
    reason = (
        pl.when(pl.col("excluded") != "")
        .then(pl.col("excluded"))
        .when(pl.col("unfinished"))
        .then(pl.lit("not played to the end"))
        .when(pl.col("removed") != "")
        .then(pl.format("participant excluded, {}", "removed"))
        .when(pl.col("left") == "completed")
        .then(pl.lit(PARTNER_EXCLUDED))
        .otherwise(pl.format("participant {}", left))
    )
    counts = pl.col("episode").is_in(analysed["episode"].to_list())
    decision = pl.when(counts).then(pl.lit(ANALYSED)).otherwise(pl.format("out: {}", reason))
    joined = quality.join(people, on="participant", how="left", maintain_order="left")
    return joined.with_columns(decision=decision).drop("left", "removed")
