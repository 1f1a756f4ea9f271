"""Separate simulated participants from people: an analysis never has both."""

from collections.abc import Mapping
from dataclasses import dataclass

import polars as pl

LABEL = "Simulated participants: no evidence about people"


@dataclass(frozen=True)
class Subjects:
    """The words for the people of a data set, real or simulated. Every text of a report uses them."""

    person: str
    people: str
    participant: str
    participants: str
    heading: str  # of a column with their number


PEOPLE = Subjects("person", "people", "participant", "participants", "People")
_ONE, _MANY = "simulated participant", "simulated participants"
SIMULATED = Subjects(_ONE, _MANY, _ONE, _MANY, "Simulated")


def is_simulated(table: pl.DataFrame) -> pl.Series:
    """Return for each row whether it is about a bot. Older exports do not say; they are taken for people."""
    if "simulated" not in table.columns:
        return pl.Series("simulated", [False] * table.height, pl.Boolean)
    return table["simulated"].cast(pl.String).str.to_lowercase().eq("true").fill_null(value=False)


def without_pooling(raw: Mapping[str, pl.DataFrame]) -> tuple[dict[str, pl.DataFrame], int]:
    """Return the tables with people only, or, where there are none, with simulated participants only; and the number
    of simulated participants left out."""
    simulated = is_simulated(raw["participants"])
    all_who_came = simulated if len(simulated) else is_simulated(raw["withdrawals"])
    rehearsal = len(all_who_came) > 0 and bool(all_who_came.all())
    chosen = {name: raw[name].filter(is_simulated(raw[name]) == rehearsal) for name in ("participants", "withdrawals")}
    return {**raw, **chosen}, 0 if rehearsal else int(simulated.sum())
