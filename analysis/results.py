"""The rows of the analysis: one number with its context each, and the tidy table of all rows (results.csv). A report is
built from these rows, so every number in it is in the file.
"""

import csv
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from analysis.spreadsheet import safe_text


@dataclass(frozen=True)
class Interval:
    """A value with its confidence interval; nan where it cannot be computed."""

    value: float
    low: float = math.nan
    high: float = math.nan
    level: float = 0.95


@dataclass(frozen=True)
class Result:
    """One row of results.csv. Empty text or nan: does not apply, or could not be computed (then `note` says why)."""

    section: str  # primary, reward, questionnaire, accuracy, exclusions, assumptions, mixed model, equivalence, ...
    test: str  # what was computed: mean, kruskal_wallis, anova, t_test, ...
    layout: str = ""  # "all": over the chosen layouts together
    agent: str = ""  # "all": over the agents together
    condition: str = ""  # of a mean or a count
    contrast: str = ""  # "tom - none": first minus second
    question: str = ""
    step: int = 0  # steps ahead of a prediction, 1 is the action about to happen; 0: does not apply or all
    estimate: float = math.nan  # a mean, a count or a difference, in the unit of what is compared
    estimate_low: float = math.nan
    estimate_high: float = math.nan
    se: float = math.nan
    statistic_name: str = ""
    statistic: float = math.nan
    df: float = math.nan
    df_residual: float = math.nan
    n: int = 0  # values that went in: episodes, answers or people, see `unit`
    unit: str = "episodes"
    p: float = math.nan
    p_adjusted: float = math.nan  # Benjamini-Hochberg within the family named in `note`
    effect_name: str = ""
    effect: float = math.nan
    ci_low: float = math.nan
    ci_high: float = math.nan
    ci_level: float = math.nan
    note: str = ""


COLUMNS = tuple(field.name for field in fields(Result))


def write_results(rows: Iterable[Result], path: Path) -> None:
    """Write all rows as CSV with a header, numbers with 10 significant digits, nan as an empty cell."""
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(COLUMNS)
        for row in rows:
            writer.writerow([_cell(value) for value in asdict(row).values()])


def select(rows: Sequence[Result], **wanted: object) -> list[Result]:
    """Return the rows whose fields equal all that is wanted, in their order."""
    return [row for row in rows if all(getattr(row, name) == value for name, value in wanted.items())]


def _cell(value: object) -> str:
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.10g}"
    return safe_text(str(value))
