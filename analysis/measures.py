"""Compute measures of episodes from ticks: reward, idleness, lateness, and the predictor's accuracy.

Row t holds what was predicted before timestep t, and the actions that were done in it: the first
predicted step is about row t itself, the second about the next row.
"""

import polars as pl

from analysis.groups import DECIMALS
from analysis.key_lag import lag
from analysis.tables import INTERACT, STAY, STEPS, Export

MOVES = 4  # actions 0-3 are moves
# more equal moves in a row than this must go into a wall or a chef: kitchens are hardly ever wider or higher
PUSHES = 8


def episode_measures(export: Export) -> pl.DataFrame:
    """Return the export's episodes with reward, and measures from their ticks: idle_share, longest_idle_s,
    interactions, pushing_share, late_share, display_share (timesteps not shown as required), lag_ms, hidden_share,
    accuracy and accuracy_1..3 (shares, 0 to 1; null without ticks). attention_failed counts the attention checks that
    the person failed in the whole study."""
    ticks = export.ticks
    of_ticks = ticks.group_by("episode").agg(
        timesteps_seen=pl.len(),
        idle_share=(pl.col("person") == STAY).mean(),
        interactions=(pl.col("person") == INTERACT).sum(),
        late_share=pl.col("late").mean(),
    )
    reward = (pl.col("score") + pl.col("progress")).round(DECIMALS)
    episodes = export.episodes.with_columns(reward=reward)
    for table in (
        of_ticks,
        longest_idle(ticks),
        pushing(ticks),
        lag(ticks, export.pauses),
        accuracy_of_episodes(ticks),
    ):
        episodes = episodes.join(table, on="episode", how="left")
    hidden = _without_server_failures(export.pauses).filter(pl.col("reason").is_in(["hidden", "blur"]))
    if "of_person" in hidden.columns:
        hidden = hidden.filter("of_person")
    hidden = hidden.group_by("episode").agg(hidden_ms=_away_ms(hidden).sum())
    failed = export.participants.select("participant", pl.col("attention_failed").cast(pl.Int64))
    episodes = episodes.join(failed, on="participant", how="left", maintain_order="left")
    length_ms = pl.col("timesteps_seen") * pl.col("tick_ms")
    return (
        episodes.join(hidden, on="episode", how="left", maintain_order="left")
        .with_columns(
            display_share=pl.col("display_violations") / pl.col("timesteps_seen"),
            longest_idle_s=pl.col("longest_idle") * pl.col("tick_ms") / 1000,
            hidden_share=pl.col("hidden_ms").fill_null(0) / (length_ms + pl.col("hidden_ms").fill_null(0)),
        )
        .drop("hidden_ms", "longest_idle")
    )


def _away_ms(pauses: pl.DataFrame) -> pl.Expr:
    """Return how much of each pause was the person's absence, not for example the researcher's pause that came during
    it. An export of an older version does not say: then it is all of it."""
    lasted_ms = pl.col("duration_ms").cast(pl.Float64)
    if "away_ms" not in pauses.columns:
        return lasted_ms
    return pl.min_horizontal(lasted_ms, pl.col("away_ms").cast(pl.Float64))  # leaves out what is null


def _without_server_failures(pauses: pl.DataFrame) -> pl.DataFrame:
    """Return the pauses without absences during which the server failed: these end exactly when the pause `server`
    begins, and it is unknown how long the person was away."""
    if "started_at" not in pauses.columns:
        return pauses
    start = pl.col("started_at").dt.timestamp("us")
    server = pauses.filter(pl.col("reason") == "server").select("episode", end_us=start)
    lasted_us = (pl.col("duration_ms").cast(pl.Float64) * 1000).round().cast(pl.Int64)
    return pauses.with_columns(end_us=start + lasted_us).join(server, on=["episode", "end_us"], how="anti")


def analysed(episodes: pl.DataFrame, participants: pl.DataFrame) -> pl.DataFrame:
    """Return the episodes that count: played to their end by somebody who finished the study; neither of them, nor the
    person who was watched in it, excluded by the researcher."""
    people = participants.filter((pl.col("status") == "completed") & (pl.col("excluded") == ""))
    counting = episodes.filter((pl.col("status") == "done") & (pl.col("excluded") == ""))
    excluded = participants.filter(pl.col("excluded") != "").select(watched_person="participant")
    counting = counting.join(people.select("participant"), on="participant", how="semi", maintain_order="left")
    return counting.join(excluded, on="watched_person", how="anti", maintain_order="left")


def _runs(ticks: pl.DataFrame) -> pl.DataFrame:
    """Return runs of the same action of the person: episode, person, length."""
    return (
        ticks.sort("episode", "timestep")
        .with_columns(run=pl.struct("episode", "person").rle_id())
        .group_by("episode", "run")
        .agg(person=pl.col("person").first(), length=pl.len())
    )


def longest_idle(ticks: pl.DataFrame) -> pl.DataFrame:
    """Return the longest run of waiting in timesteps: episode, longest_idle."""
    waiting = pl.when(pl.col("person") == STAY).then(pl.col("length")).otherwise(0)
    return _runs(ticks).group_by("episode").agg(longest_idle=waiting.max())


def pushing(ticks: pl.DataFrame) -> pl.DataFrame:
    """Return the share of timesteps beyond the eighth of the same move in a row: the chef is blocked by a wall or the
    partner. It detects being stuck from the actions alone."""
    beyond = pl.when(pl.col("person") < MOVES).then((pl.col("length").cast(pl.Int64) - PUSHES).clip(0)).otherwise(0)
    return _runs(ticks).group_by("episode").agg(pushing_share=beyond.sum() / pl.col("length").sum())


def prediction_hits(ticks: pl.DataFrame) -> pl.DataFrame:
    """Return one row per prediction whose action was then seen: episode, timestep, step, hit."""
    ticks = ticks.sort("episode", "timestep")
    steps = []
    for step in range(1, STEPS + 1):
        done = pl.col("partner").shift(1 - step).over("episode")
        hits = ticks.select(
            "episode",
            "timestep",
            step=pl.lit(step, dtype=pl.Int8),
            hit=(pl.col(f"predicted_{step}").cast(pl.Int8) == done),
        )
        steps.append(hits.drop_nulls("hit"))
    return pl.concat(steps)


def accuracy_of_episodes(ticks: pl.DataFrame) -> pl.DataFrame:
    """Return episode, accuracy_1..3 and accuracy (their mean): shares of predicted actions that were then done."""
    names = [f"accuracy_{step}" for step in range(1, STEPS + 1)]
    rates = prediction_hits(ticks).group_by("episode", "step").agg(rate=pl.col("hit").mean())
    episodes = rates.select("episode").unique()
    for step, name in enumerate(names, start=1):
        column = rates.filter(pl.col("step") == step).select("episode", pl.col("rate").alias(name))
        episodes = episodes.join(column, on="episode", how="left")
    return episodes.with_columns(accuracy=pl.mean_horizontal(names))
