"""Sentences about the factors of a study: main effects, interactions, and simple effects after an interaction."""

import math
from collections.abc import Sequence

from markupsafe import escape

from analysis import formatting
from analysis.block_orders import ADJUSTED, WHY
from analysis.declared import BY
from analysis.factorial import SECTION, SIMPLE
from analysis.factorial_within import WITHIN
from analysis.formatting import listed, number, p_equals
from analysis.phrases import question, significant, statistic, with_p
from analysis.results import Result, select
from analysis.simulated_participants import PEOPLE, Subjects


def effect_title(term: str) -> str:
    """Return an effect's title: prediction x opacity -> Prediction × opacity."""
    words = term.replace(BY, " × ").replace("_", " ")
    return words[:1].upper() + words[1:]


def factorial_sentences(rows: Sequence[Result], who: Subjects = PEOPLE) -> list[str]:
    """Return a sentence for each outcome, and one for each outcome with an interaction, as HTML."""
    made = []
    tests = with_p(select(rows, section=SECTION, test="anova"))
    for outcome in dict.fromkeys(row.question for row in tests):
        found = [row for row in tests if row.question == outcome]
        made += [_effects(outcome, found, who), *_simple(outcome, found, rows, who)]
    return made


def _name(outcome: str) -> str:
    return f"“{question(outcome)}”" if outcome else "reward"


def _effects(outcome: str, tests: Sequence[Result], who: Subjects) -> str:
    """Say in one sentence which effects were found, each with its test."""
    parts = [f"{_term(row)} ({_numbers(row)})" for row in tests]
    return (
        f"In a factorial analysis of variance of {_name(outcome)} over {tests[0].n} {who.people} "
        f"({_method(tests, who)}), there was {listed(parts)}."
    )


def _method(tests: Sequence[Result], who: Subjects) -> str:
    within = [row.contrast for row in tests if row.note.startswith(WITHIN) and BY not in row.contrast]
    if not within:
        return "type III sums of squares, sum coding"
    names = listed([str(escape(name.replace("_", " "))) for name in within])
    if any(ADJUSTED in row.note for row in tests):
        return f"{names} within {who.people}, with the {ADJUSTED}, {WHY}"
    return f"{names} within {who.people}, with the orders of the blocks averaged"


def _term(row: Result) -> str:
    names = [str(escape(name.replace("_", " "))) for name in row.contrast.split(BY)]
    kind = f"main effect of {names[0]}" if len(names) == 1 else f"interaction of {listed(names)}"
    article = "an" if len(names) > 1 else "a"
    return f"{article} {kind}" if significant(row) else f"no significant {kind}"


def _numbers(row: Result) -> str:
    corrected = "" if row.p_adjusted != row.p_adjusted else f", corrected <i>p</i> {p_equals(row.p_adjusted)}"
    low, high = number(row.ci_low, 3), number(row.ci_high, 3)
    return f"{statistic(row)}{corrected}, partial η² = {number(row.effect, 3)}, 90 % CI [{low}, {high}]"


def _simple(outcome: str, tests: Sequence[Result], rows: Sequence[Result], who: Subjects) -> list[str]:
    """Return the simple effects, which are reported only after an interaction."""
    if not any(significant(row) and BY in row.contrast for row in tests):
        return []
    parts = [
        f"{_contrast(row)} with {escape(row.condition.replace('_', ' '))}: {formatting.signed(row.estimate)} "
        f"(corrected <i>p</i> {p_equals(row.p_adjusted)}{_g(row)})"
        for row in with_p(select(rows, section=SIMPLE, question=outcome))
    ]
    return [f"As factors interacted in {_name(outcome)}, simple effects over {who.people}: {'; '.join(parts)}."]


def _g(row: Result) -> str:
    return "" if math.isnan(row.effect) else f", Hedges’ <i>g</i> = {number(row.effect)}"


def _contrast(row: Result) -> str:
    factor, _, levels = row.contrast.partition(": ")
    first, _, second = levels.partition(" - ")
    return str(escape(f"{factor}, {first} against {second}".replace("_", " ")))
