"""Propose for every episode to keep it, look at it or drop it, with the rules that apply. The researcher decides.

The thresholds are fixed here, before data collection.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import polars as pl

SAME_ANSWERS = 3  # so many episodes of a person with the same answer to every question count as straight-lining


@dataclass(frozen=True)
class Rule:
    """`look` and `drop` are bounds of a measure that is bad when high; `low_is_bad` reverses that. None: never."""

    name: str
    measure: str
    meaning: str
    look: float | None
    drop: float | None
    low_is_bad: bool = False

    def holds(self, bound: float | None) -> pl.Expr:
        """Return true where the measure has reached the bound; false where it was not recorded."""
        if bound is None:
            return pl.lit(False)
        measure = pl.col(self.measure).cast(pl.Float64)
        return ((measure <= bound) if self.low_is_bad else (measure >= bound)).fill_null(False)


RULES = (
    Rule("unfinished", "unfinished", "the episode did not reach its end", None, 1),
    Rule("idle", "idle_share", "share of timesteps in which the person waited", 0.6, 0.9),
    Rule("absent", "longest_idle_s", "seconds without a key", 20, 60),
    Rule(
        "no interaction",
        "interactions",
        "timesteps in which the person pressed the key to pick up, put down or cook",
        5,
        0,
        low_is_bad=True,
    ),
    Rule("stuck", "pushing_share", "share of timesteps spent pushing against a wall or the partner", 0.15, 0.5),
    Rule("hidden", "hidden_share", "share of the time with the page hidden", 0.1, 0.25),
    Rule("lag", "lag_ms", "extra milliseconds of the slowest keys", 300, None),
    Rule("late", "late_share", "share of timesteps in which the models were late", 0.01, 0.05),
    Rule(
        "display",
        "display_share",
        "share of timesteps in which the screen did not show what the condition requires",
        1e-9,
        0.05,
    ),
    Rule("same answers", "same_answers", "every answer the same, after three episodes or more", 1, None),
    Rule("inattentive", "attention_failed", "attention checks that the person failed in the whole study", 1, 2),
)


def proposals(episodes: pl.DataFrame, answers: pl.DataFrame, rules: Sequence[Rule] = RULES) -> pl.DataFrame:
    """One row per episode of the measures' table: episode, participant, condition, layout, agent, number, proposal
    (keep, look or drop), rules (names of those that hold, the reasons to drop first), excluded, and every measure."""
    table = episodes.join(straight_lined(answers), on="episode", how="left", maintain_order="left").with_columns(
        pl.col("same_answers").fill_null(False), unfinished=pl.col("status") != "done"
    )
    unknown = {rule.measure for rule in rules} - set(table.columns)  # not recorded by earlier versions
    table = table.with_columns(pl.lit(None, dtype=pl.Float64).alias(name) for name in sorted(unknown))
    drop = [pl.when(rule.holds(rule.drop)).then(pl.lit(rule.name)) for rule in rules]
    look = [pl.when(rule.holds(rule.look) & ~rule.holds(rule.drop)).then(pl.lit(rule.name)) for rule in rules]
    table = table.with_columns(
        proposal=pl.when(pl.any_horizontal([rule.holds(rule.drop) for rule in rules]))
        .then(pl.lit("drop"))
        .when(pl.any_horizontal([rule.holds(rule.look) for rule in rules]))
        .then(pl.lit("look"))
        .otherwise(pl.lit("keep")),
        rules=pl.concat_str([*drop, *look], separator=", ", ignore_nulls=True),
    )
    names = ("episode", "participant", "condition", "layout", "agent", "number", "proposal", "rules", "excluded")
    return table.select(*names, *[rule.measure for rule in rules])


def straight_lined(answers: pl.DataFrame) -> pl.DataFrame:
    """Return the episodes whose questions all got the same answer, if their person did so three times or more: episode,
    same_answers. A single such page may be a real opinion."""
    pages = answers.group_by("participant", "episode", maintain_order=True).agg(
        same=(pl.col("value").n_unique() == 1) & (pl.len() > 1)
    )
    return pages.select(
        "episode", same_answers=pl.col("same") & (pl.col("same").sum().over("participant") >= SAME_ANSWERS)
    )
