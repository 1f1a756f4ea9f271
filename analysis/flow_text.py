"""The sentence about participants and episodes: how many are analysed, and why others are not."""

from analysis.formatting import listed, word
from analysis.results import select
from analysis.study import Analysis

REASONS = {  # steps of the flow, in words; {}: participants
    "of_incomplete": "of {} who did not finish the study",
    "unfinished": "not played to the end",
    "removed": "removed by the researcher",
    "of_excluded": "of {} whom the researcher excluded",
}


def flow_sentence(analysis: Analysis) -> str:
    """Return how many episodes and people are analysed, and why others are not; empty without episodes."""
    counts = select(analysis.rows, section="exclusions", condition="all", unit="episodes")
    begun = sum(row.n for row in counts if row.test == "played")
    left = sum(row.n for row in counts if row.test == "analysed")
    people = next(row.n for row in select(analysis.rows, test="analysed", condition="all", unit="people"))
    if not begun:
        return ""
    who = analysis.subjects
    episodes = f"{left} episode{'' if left == 1 else 's'}"
    of = f"{people} {who.participant if people == 1 else who.participants}"
    text = f"The analysis is of {episodes} of {of}.{_watched(analysis)}"
    if left == begun:
        return text
    parts = []
    for step, reason in REASONS.items():
        count = sum(row.n for row in counts if row.test == step)
        number_of = "" if count == begun - left else f"{word(count)} "
        parts += [f"{number_of}{reason.format(who.participants)} ({100 * count / begun:.1f} %)"] if count else []
    were = "was" if begun - left == 1 else "were"
    return f"{text} Of {begun} episodes begun, {word(begun - left)} {were} left out: {listed(parts)}."


def _watched(analysis: Analysis) -> str:
    """Say how rounds of two people are counted, and for how many participants no round is."""
    watched = select(analysis.rows, section="exclusions", test="watched", condition="all")
    if not watched:
        return ""
    were = f"{analysis.subjects.participants} were" if watched[0].n > 1 else f"{analysis.subjects.participant} was"
    return (
        " Each round of two people counts once, for the person who was not watched; "
        f"{word(watched[0].n)} {were} always watched."
    )
