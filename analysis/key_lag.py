"""How late an episode's keys came, by the clocks of browser and server; unknown where the game ran faster than time."""

import polars as pl

from analysis.table_files import TIMES

FASTER = 1.05  # times real time, by the median timestep: jitter is less


def lag(ticks: pl.DataFrame, pauses: pl.DataFrame) -> pl.DataFrame:
    """Return how much slower than the fastest key the slowest twentieth of an episode's keys came: episode, lag_ms. A
    key that is held decides many timesteps and counts once.

    The clocks of browser and server differ by a constant only from one pause to the next: the server's leaves pauses
    out, and a new page starts its own. So each key is compared with the fastest one between the same two pauses; a page
    cannot be replaced without a pause. Null if no key times were recorded, or not where the pauses are, and where the
    game ran faster than real time (simulated participants): there the server's clock gains on the browser's."""
    known = {"key_client_ms", "key_received_ms"} <= set(ticks.columns)
    if not known or (pauses.height and "timestep" not in pauses.columns):
        return ticks.select("episode", lag_ms=pl.lit(None, dtype=pl.Float64)).unique()
    delay = (pl.col("key_received_ms") - pl.col("key_client_ms")).cast(pl.Float64)
    one_key = ("episode", "pause", "key_client_ms", "key_received_ms")
    keys = _between_pauses(ticks, pauses).unique(one_key, maintain_order=True).with_columns(delay=delay)
    keys = keys.with_columns(extra=pl.col("delay") - pl.col("delay").min().over("episode", "pause"))
    found = keys.group_by("episode").agg(lag_ms=pl.col("extra").quantile(0.95, "linear"))
    is_faster = pl.col("episode").is_in(faster_than_real_time(ticks)["episode"].to_list())
    return found.with_columns(lag_ms=pl.when(~is_faster).then("lag_ms"))


def faster_than_real_time(ticks: pl.DataFrame) -> pl.DataFrame:
    """Return the episodes in which the time between two deadlines was shorter by the wall clock than by the game's:
    episode. A timestep was due `late_ms` before it was made, so a slow server that catches up is not taken for a fast
    one; pauses and changes of the wall clock concern a few timesteps, not the median one."""
    if not set(TIMES) <= set(ticks.columns):
        return pl.DataFrame(schema={"episode": pl.String})
    made = pl.col("made_at")
    if ticks.schema["made_at"] == pl.String:  # of a CSV file
        made = made.str.to_datetime(time_unit="us", time_zone="UTC", strict=False)
    due_ms = made.cast(pl.Datetime("us", "UTC"), strict=False).dt.timestamp("us") / 1000 - pl.col("late_ms")
    order = ticks.select("episode", "timestep", "scheduled_ms", due_ms=due_ms).sort("episode", "timestep")
    steps = order.select("episode", *(pl.col(name).diff().over("episode") for name in ("scheduled_ms", "due_ms")))
    pace = steps.drop_nulls().group_by("episode").agg(pl.col("scheduled_ms").median(), pl.col("due_ms").median())
    return pace.filter(pl.col("scheduled_ms") > FASTER * pl.col("due_ms")).select("episode")


def _between_pauses(ticks: pl.DataFrame, pauses: pl.DataFrame) -> pl.DataFrame:
    """Return the ticks with `pause`, the state at which the last pause before their actions was; -1: none. A pause at
    state t comes before the actions of timestep t."""
    ticks = ticks.with_columns(pl.col("timestep").cast(pl.Int64))
    if pauses.is_empty():
        return ticks.with_columns(pause=pl.lit(-1, dtype=pl.Int64))
    when = pl.col("timestep").cast(pl.Int64)
    found = pauses.select(pl.col("episode").cast(pl.String), pause=when, timestep=when).drop_nulls().unique()
    order = ["episode", "timestep"]
    joined = ticks.sort(order).join_asof(found.sort(order), on="timestep", by="episode", check_sortedness=False)
    return joined.with_columns(pl.col("pause").fill_null(-1))
