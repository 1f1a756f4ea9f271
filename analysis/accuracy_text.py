"""Write about the accuracy of predictors: each by itself, and only as trained against its offline test."""

import math
from collections.abc import Collection, Sequence

from markupsafe import escape

from analysis.accuracy import degraded_to, without_degradation
from analysis.formatting import listed, number
from analysis.phrases import partner
from analysis.results import Result, select
from analysis.simulated_participants import Subjects


def _live(rows: Sequence[Result]) -> list[Result]:
    """Return a row for each agent and predictor: over all layouts, the conditions in which it ran, and the steps."""
    return select(rows, section="accuracy", test="live", layout="all", condition="all", step=0)


def predictor_words(rows: Sequence[Result], row: Result) -> str:
    """Return which of an agent's predictors a row is about: its name if there are several, and how far it was degraded;
    empty for the only one."""
    bases = {without_degradation(one.note) for one in _live(rows) if one.agent == row.agent}
    wanted = degraded_to(row.note)
    words = [without_degradation(row.note)] if len(bases) > 1 else []
    words += [f"degraded to {wanted:g} %"] if wanted is not None else []
    return ", ".join(words)


def accuracy_lines(rows: Sequence[Result], agent_name: str, who: Subjects) -> list[tuple[str, str, str]]:
    """Return the lines of an agent's part of the table: label, test (`difference`: live minus offline), predictor."""
    lines = []
    for row in _live(rows):
        if row.agent != agent_name:
            continue
        words = predictor_words(rows, row)
        label = f", {words}" if words else ""
        tested = bool(select(rows, section="accuracy", test="offline", agent=row.agent, note=row.note))
        lines += [(f"Offline test{label}", "offline", row.note)] if tested else []
        lines.append((f"With {who.people}{label}", "live", row.note))
        lines += [("Difference", "difference", row.note)] if tested else []
    return lines


def accuracy_finding(rows: Sequence[Result], who: Subjects, human_agents: Collection[str] = ()) -> str:
    """Return how often the predictors were right; empty without predictions. Predictions about people (`human_agents`:
    the partners who are people) and about AI agents are never averaged: people are harder to predict."""
    trained = [row for row in _live(rows) if degraded_to(row.note) is None]
    if not trained:
        text = ""
    elif len({row.agent for row in trained}) == len(trained):
        text = _trained_finding(rows, trained, who, human_agents)
    else:
        parts = [f"{_named(row)} {_percent([row])} of the time{_against_offline(rows, [row])}" for row in trained]
        text = f"With {who.people}, the predictors are right: {'; '.join(parts)}."
    return " ".join(part for part in (text, *_degraded_findings(rows, who, human_agents)) if part)


def _trained_finding(
    rows: Sequence[Result], trained: Sequence[Result], who: Subjects, human_agents: Collection[str]
) -> str:
    about_agents, about_people = _by_kind(trained, human_agents)
    if not (about_agents and about_people):
        share = f"The predictor is right {_percent(trained)} of the time with {who.people}"
        return f"{share}{_against_offline(rows, trained)}."
    agents = f"{_percent(about_agents)} of the time about AI agents{_against_offline(rows, about_agents)}"
    people = f"{_percent(about_people)} of the time about other {who.people}{_against_offline(rows, about_people)}"
    return f"In games with {who.people}, the predictor is right {agents}, and {people}."


def _degraded_findings(rows: Sequence[Result], who: Subjects, human_agents: Collection[str]) -> list[str]:
    degraded = [(wanted, row) for row in _live(rows) if (wanted := degraded_to(row.note)) is not None]
    return [
        f"Degraded on purpose to {wanted:g} %, the predictor is right "
        f"{_shares([row for one, row in degraded if one == wanted], who, human_agents)} with {who.people}."
        for wanted in sorted({wanted for wanted, _ in degraded}, reverse=True)
    ]


def _shares(rows: Sequence[Result], who: Subjects, human_agents: Collection[str]) -> str:
    about_agents, about_people = _by_kind(rows, human_agents)
    if not (about_agents and about_people):
        return f"{_percent(rows)} of the time"
    agents = f"{_percent(about_agents)} of the time about AI agents"
    return f"{agents} and {_percent(about_people)} of the time about other {who.people}, in games"


def _by_kind(rows: Sequence[Result], human_agents: Collection[str]) -> tuple[list[Result], list[Result]]:
    """Return the rows about AI agents and those about people."""
    return (
        [row for row in rows if row.agent not in human_agents],
        [row for row in rows if row.agent in human_agents],
    )


def _named(row: Result) -> str:
    return f"{escape(row.note)} with {partner(row.agent)}"


def _percent(rows: Sequence[Result]) -> str:
    return f"{number(100 * sum(row.estimate for row in rows) / len(rows), 1)} %"


def _against_offline(rows: Sequence[Result], lives: Sequence[Result]) -> str:
    """Return the distance from the offline test of the same predictors; empty where one has none."""
    tests = select(rows, section="accuracy", test="offline", layout="all", step=0)
    offline = {(row.agent, row.note): row.estimate for row in tests}
    if not all((row.agent, row.note) in offline for row in lives):
        return ""
    gap = 100 * sum(row.estimate - offline[row.agent, row.note] for row in lives) / len(lives)
    return f", {number(abs(gap), 1)} points {'less' if gap < 0 else 'more'} than in the offline test"


def accuracy_sentence(rows: Sequence[Result], who: Subjects) -> str:
    """Return the accuracy of each predictor with its interval, for a results section; empty without predictions."""
    parts = []
    for row in _live(rows):
        low, high = (number(100 * bound, 1) for bound in (row.estimate_low, row.estimate_high))
        bounds = "" if math.isnan(row.estimate_low) else f" (95 % CI [{low}, {high}])"
        words = predictor_words(rows, row)
        which = f" (predictor: {escape(words)})" if words else ""
        parts.append(f"{_percent([row])} of {partner(row.agent)}’s actions{which}{bounds}")
    games = f"In the games with {who.people}"
    return f"{games} the predictor correctly predicted {listed(parts)}, mean of the three steps." if parts else ""
