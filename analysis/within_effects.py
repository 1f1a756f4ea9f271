"""Fixed effects for the levels that people meet in blocks, so that a mixed model does not take them for variance within
people.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
import polars as pl
from numpy.typing import NDArray

PREFIX: Final = "factor_"  # of the columns with the levels of a factor
Array = NDArray[np.float64]


def level_columns(episodes: pl.DataFrame) -> list[str]:
    """Return the columns of the factors whose levels differ between the episodes of a person."""
    names = [name for name in episodes.columns if name.startswith(PREFIX)]
    counts = episodes.group_by("participant").agg(pl.col(name).drop_nulls().n_unique() for name in names)
    return [name for name in names if (counts[name] > 1).any()]


def with_levels(table: pl.DataFrame, episodes: pl.DataFrame) -> pl.DataFrame:
    """Return a table about episodes with the levels that people met in them."""
    levels = episodes.select("episode", *level_columns(episodes))
    return table.join(levels, on="episode", how="left", maintain_order="left")


def with_within_effects(chosen: pl.DataFrame, conditions: Sequence[str], base: Array) -> Array:
    """Return the columns of `base` and, where people met levels in blocks, the combinations of these levels and their
    interaction with the conditions: (episodes, columns).

    The conditions are then the orders of the blocks, so that the interaction holds what a block adds, and the residual
    is what the test within people uses. The combinations are coded as deviations: a difference between conditions stays
    that of their means over the combinations. Columns that follow from earlier ones are left out."""
    names = level_columns(chosen)
    if not names:
        return base
    levels = chosen.select(pl.struct(names).rank("dense").alias("combination"))["combination"].to_numpy()
    first, *others = np.unique(levels)
    deviations = np.stack([(levels == one).astype(float) - (levels == first) for one in others], axis=1)
    condition = chosen["condition"].cast(pl.String).to_numpy()
    effect = np.stack([(condition == name).astype(float) for name in conditions[1:]], axis=1)
    products = (effect[:, :, None] * deviations[:, None, :]).reshape(chosen.height, -1)
    return _with_independent(base, np.concatenate([deviations, products], axis=1))


def _with_independent(base: Array, more: Array) -> Array:
    """Return `base` with those columns of `more` that do not follow from the columns before them."""
    for column in more.T:
        wider = np.concatenate([base, column[:, None]], axis=1)
        if np.linalg.matrix_rank(wider) == wider.shape[1]:
            base = wider
    return base
