"""Sentences about equivalence. Equivalent, different, both and neither are four different outcomes."""

import math
from collections.abc import Sequence

from analysis import formatting
from analysis.equivalence import SECTION
from analysis.formatting import number, p_equals
from analysis.groups import ALL
from analysis.phrases import ALPHA, condition, layout, note, question, statistic
from analysis.results import Result, select
from analysis.simulated_participants import PEOPLE, Subjects


def outcome(equivalence: Result, difference: Result) -> str:
    """Return equivalent, different, trivial (a difference smaller than what matters), not shown, or nothing."""
    if math.isnan(equivalence.p):
        return ""
    alike, other = equivalence.p < ALPHA, difference.p < ALPHA
    return ("trivial" if other else "equivalent") if alike else ("different" if other else "not shown")


def pairs_of_rows(rows: Sequence[Result]) -> list[tuple[Result, Result]]:
    """Return the two rows of each claim."""
    tests = [select(rows, section=SECTION, test=test) for test in ("equivalence", "difference")]
    return list(zip(*tests, strict=True))


def equivalence_sentences(rows: Sequence[Result], who: Subjects = PEOPLE) -> list[str]:
    """Return a sentence for each claim of equivalence, as HTML."""
    return [_sentence(*pair, who) for pair in pairs_of_rows(rows)]


def _sentence(row: Result, difference: Result, who: Subjects) -> str:
    subject = _subject(row)
    first, second = (condition(name) for name in row.contrast.split(" - "))
    found = outcome(row, difference)
    if not found:
        return f"{subject}, equivalence of {first} and {second} could not be tested: {note(row)}."
    decimals = 2 if row.question else 1
    bound = f"{number(row.effect, decimals)} points, the smallest effect of interest"
    low, high = (number(value, decimals) for value in (row.estimate_low, row.estimate_high))
    estimate = f"difference {formatting.signed(row.estimate, decimals)}, 90 % CI [{low}, {high}]"
    equal = f"two one-sided Welch tests over {who.people}, {statistic(row)}, {row.n} {who.people}"
    other = f"test of a difference: <i>p</i> {p_equals(difference.p)}"
    words = {
        "equivalent": f"{first} and {second} were equivalent within ±{bound}",
        "trivial": f"{first} and {second} differed, but by less than {bound}",
        "different": f"{first} and {second} differed, and were not shown to be equivalent within ±{bound}",
        "not shown": f"neither a difference between {first} and {second} nor equivalence within ±{bound}, was shown",
    }
    return f"{subject}, {words[found]} ({estimate}; {equal}; {other})."


def _subject(row: Result) -> str:
    if row.question:
        return f"In the answers to “{question(row.question)}”"
    return "In reward over all layouts" if row.layout == ALL else f"In reward on {layout(row.layout)}"
