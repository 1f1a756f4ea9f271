"""Make the intention columns of an export's ticks."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from server.export.codebook_intentions import CAME_PARTS, PARTS, RANKS, SHOWN_PARTS
from server.store.interactions import UNKNOWN
from server.store.packed_intentions import unpack, unpack_shown


def columns(
    intentions: Sequence[Any], shown: Sequence[Any], came: Sequence[NDArray[np.int16] | None]
) -> dict[str, Any]:
    """Return the columns of some rows, from the stored intentions and the chef's actual next interactions. `came`: a
    table for each row's episode and state; None where no intention was predicted."""
    predicted = [unpack(blob) for blob in intentions]
    found: dict[str, Any] = {}
    for rank in RANKS:
        of_rank = [each[rank - 1] if len(each) >= rank else None for each in predicted]
        for part in PARTS:
            found[f"intention_{rank}_{part}"] = [None if one is None else getattr(one, part) for one in of_rank]
    displayed = [unpack_shown(blob) for blob in shown]
    for index, part in enumerate(SHOWN_PARTS):
        found[f"displayed_intention_{part}"] = [None if one is None else one[index] for one in displayed]
    return found | _came(came)


def _came(rows: Sequence[NDArray[np.int16] | None]) -> dict[str, Any]:
    unknown = np.full(len(CAME_PARTS), UNKNOWN, np.int16)
    table = np.stack([unknown if row is None else row for row in rows])  # (rows, parts)
    missing = table[:, 0] == UNKNOWN
    return {
        f"interaction_{part}": without(np.ascontiguousarray(table[:, index]), missing)
        for index, part in enumerate(CAME_PARTS)
    }


def without(values: NDArray[Any], missing: NDArray[np.bool_]) -> pl.Series:
    """Return the values as a column, null where they are missing."""
    return pl.Series(values).set(pl.Series(missing), None)
