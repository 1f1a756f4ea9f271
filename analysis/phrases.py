"""Pieces of the report's sentences: names escaped for HTML, statistics in APA style, and the direction of a difference.
Every name from a study file or an export is escaped here.
"""

import math
from collections.abc import Sequence

from markupsafe import escape

from analysis import formatting, questionnaires
from analysis.formatting import degrees, listed, number, p_equals
from analysis.results import Result

ALPHA = 0.05


def agent(name: str) -> str:
    """Return an agent's name as HTML."""
    return str(escape(formatting.agent_title(name)))


def partner(name: str) -> str:
    """Return the words for an agent, or a person as partner, as HTML: the SP agent."""
    return str(escape(formatting.partner_phrase(name)))


def layout(name: str) -> str:
    """Return a layout's name as HTML."""
    return str(escape(formatting.layout_title(name)))


def condition(name: str) -> str:
    """Return what a condition shows, as HTML: ToM predictions."""
    return str(escape(formatting.condition_phrase(name)))


def question(key: str) -> str:
    """Return a question's short name as HTML."""
    return str(escape(questionnaires.title(key)))


def note(row: Result) -> str:
    """Return the reason why a row has no test, as HTML."""
    return str(escape(row.note))


def statistic(row: Result) -> str:
    """Return a test in APA style: t(55) = 3.46, p = .001; F(2, 83) = ...; H(2, n = 430) = ... with letters in
    italics."""
    letter = {"chi2": "χ²"}.get(row.statistic_name, row.statistic_name)
    inside = degrees(row.df)
    if letter == "H":
        inside += f", <i>n</i> = {row.n}"
    elif not math.isnan(row.df_residual):
        inside += f", {degrees(row.df_residual)}"
    brackets = "" if math.isnan(row.df) else f"({inside})"
    return f"<i>{letter}</i>{brackets} = {number(row.statistic)}, <i>p</i> {p_equals(row.p)}"


def corrected(row: Result) -> str:
    """Return the statistic with both its p values."""
    return f"{statistic(row)}, corrected <i>p</i> {p_equals(row.p_adjusted)}"


def interval(row: Result, decimals: int = 1) -> str:
    """Return the interval of the estimate: 95 % CI [1.2, 3.4]."""
    return f"95 % CI [{number(row.estimate_low, decimals)}, {number(row.estimate_high, decimals)}]"


def with_p(rows: Sequence[Result]) -> list[Result]:
    """Return the rows whose test could be computed."""
    return [row for row in rows if not math.isnan(row.p)]


def significant(row: Result) -> bool:
    """Return true if the row's test is significant, after correction where there is one."""
    return (row.p if math.isnan(row.p_adjusted) else row.p_adjusted) < ALPHA


def raised(rows: Sequence[Result]) -> list[Result]:
    """Return the significant differences in favour of the first condition."""
    return [row for row in rows if significant(row) and row.estimate > 0]


def lowered(rows: Sequence[Result]) -> list[Result]:
    """Return the significant differences against the first condition."""
    return [row for row in rows if significant(row) and row.estimate < 0]


def places(rows: Sequence[Result]) -> str:
    """Return where differences are: with SP on Matrix and Double Rings and with FCP on Matrix."""
    parts = []
    for name in dict.fromkeys(row.agent for row in rows):
        where = [layout(row.layout) for row in rows if row.agent == name]
        parts.append(f"with {agent(name)} on {listed(where)}")
    return listed(parts)


def span(values: Sequence[float], decimals: int = 2) -> str:
    """Return the range of values: from 0.41 to 0.78; a single value as it is."""
    low, high = (number(value, decimals) for value in (min(values), max(values)))
    return low if low == high else f"from {low} to {high}"
