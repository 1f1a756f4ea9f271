"""The text of the report's first box: the primary test as declared, and its result."""

import math
from collections.abc import Sequence

from markupsafe import escape

from analysis import formatting, questionnaires
from analysis.alpha_spending import Look
from analysis.block_orders import ADJUSTED, WHY
from analysis.declared import ANOVA, REWARD, Declaration, DeclaredTest
from analysis.formatting import listed, number
from analysis.phrases import condition, note, statistic
from analysis.primary import SECTION, level_of, look_at
from analysis.results import Result, select
from analysis.simulated_participants import PEOPLE, Subjects

TITLES = {
    "welch": "Welch’s t-test",
    "student": "Student’s t-test",
    "mann_whitney": "Mann-Whitney test",
    ANOVA: "Factorial analysis of variance",
}
DIRECTIONS = {"two_sided": "two-sided", "greater": "one-sided: greater", "less": "one-sided: less"}
NO_PRIMARY = (
    "The study file declared no primary test before data collection, so every test in this report is exploratory: a "
    "single significant result among many proves little."
)
SECONDARY = "Every other test in this report is secondary or exploratory."


def primary_lines(declaration: Declaration, rows: Sequence[Result], who: Subjects = PEOPLE) -> list[str]:
    """Return the lines of the box as HTML: what was declared, the result, and what everything else is."""
    declared = declaration.primary
    if declared is None:
        return [*_warning(declaration), NO_PRIMARY]
    lines = [f"Declared: {declaration_words(declared, who)}.", *_look(declared, rows, who)]
    return [*_warning(declaration), *lines, primary_sentence(declaration, rows, who), SECONDARY]


def _look(declared: DeclaredTest, rows: Sequence[Result], who: Subjects) -> list[str]:
    """Describe which of the declared looks this is, and its boundary."""
    found = select(rows, section=SECTION)
    if not declared.looks or not found:
        return []
    kind = {"obrien_fleming": "O’Brien-Fleming-type", "pocock": "Pocock-type"}[declared.spending]
    plan = f"looks at {listed([str(look) for look in declared.looks])} {who.people}, {kind} spending (Lan and DeMets)"
    row, look = found[0], look_at(declared, found[0].n)
    if look is None:
        here = f"{row.n} {who.person if row.n == 1 else who.people}"
        return [f"Declared {plan}. With {here}, no look is due: the primary test is not computed."]
    letter = {"two_sided": "|z|", "greater": "z", "less": "−z"}[declared.direction]
    crossed = "is crossed" if row.p < look.nominal_alpha else "is not crossed"
    crossed = "The test could not be computed." if math.isnan(row.p) else f"It {crossed}."
    end = "This is the last look." if look.number == look.of else "No other test may decide whether the study stops."
    return [
        f"Declared {plan}. This is look {look.number} of {look.of}, at {look.people} {who.people}: the boundary is "
        f"{letter} = {number(look.boundary, 3)}, a nominal level of {_level(look.nominal_alpha)}. {crossed} {end}",
        *_between_looks(look, declared, who),
    ]


def _between_looks(look: Look, declared: DeclaredTest, who: Subjects) -> list[str]:
    """Warn that a look at another number than declared must be the only one there; empty at a declared number."""
    planned, earlier = declared.looks[look.number - 1], declared.looks[: look.number - 1]
    if look.people == planned:
        return []
    at = listed([str(number_of) for number_of in earlier])
    before = f"computed before at {at} {who.people} only" if earlier else "not computed before"
    return [
        f"Look {look.number} was declared at {planned} {who.people}, and this is computed at {look.people}. The "
        f"boundary holds only if the primary test was {before}: every further report tests once more, which "
        f"the spending does not cover, so the rate of false alarms exceeds α = {declared.alpha:g}."
    ]


def _level(alpha: float) -> str:
    return f"{alpha:.2g}" if alpha < 0.001 else f"{alpha:.4f}"


def _warning(declaration: Declaration) -> list[str]:
    return [f"<b>{escape(declaration.warning)}</b>"] if declaration.warning else []


def declaration_words(declared: DeclaredTest, who: Subjects = PEOPLE) -> str:
    """Return the declaration as HTML: test, measure, where, comparison, direction and level."""
    return (
        f"{TITLES[declared.test]} over {who.people} of {measure_words(declared)} (each {who.person}’s mean over "
        f"{_where(declared)}), {compared_words(declared)}, {DIRECTIONS[declared.direction]}, α = {declared.alpha:g}"
    )


def compared_words(declared: DeclaredTest) -> str:
    """Return what is tested, as HTML: two conditions, or the effect of factors."""
    if declared.effect:
        names = [str(escape(name.replace("_", " "))) for name in declared.effect]
        return f"main effect of {names[0]}" if len(names) == 1 else f"interaction of {listed(names)}"
    first, second = (condition(name) for name in declared.comparison)
    return f"{first} against {second}"


def measure_words(declared: DeclaredTest) -> str:
    """Return what is compared, as HTML."""
    if declared.measure == REWARD:
        return "the reward"
    return f"the answers to “{escape(questionnaires.title(declared.measure))}”"


def _where(declared: DeclaredTest) -> str:
    layouts = listed([formatting.layout_title(name) for name in declared.layouts]) or "all layouts"
    agents = listed([formatting.agent_title(name) for name in declared.agents])
    every = "all agents" if declared.layouts else "agents"
    return str(escape(f"{layouts} with {agents}" if agents else f"{layouts} and {every}"))


def primary_sentence(declaration: Declaration, rows: Sequence[Result], who: Subjects = PEOPLE) -> str:
    """Return the result of the primary test as a sentence to paste; empty if none was declared."""
    declared = declaration.primary
    found = select(rows, section=SECTION)
    if declared is None or not found:
        return ""
    row = found[0]
    if declared.looks and look_at(declared, row.n) is None:
        return f"The primary test is not computed{'' if row.note.startswith('before') else ':'} {note(row)}."
    if math.isnan(row.p):
        return f"The primary test could not be computed: {note(row)}."
    numbers = f"{_numbers(row)}, {row.n} {who.people}"
    if declared.effect:
        return f"In the primary test, {_effect(declared, row)} ({numbers})."
    first, second = (condition(name) for name in declared.comparison)
    return f"In the primary test, {measure_words(declared)} {_outcome(declared, row, first, second)} ({numbers})."


def _effect(declared: DeclaredTest, row: Result) -> str:
    """Describe whether there was an effect; for a single difference, also its direction."""
    found = row.p < level_of(declared, row.n)
    article = "an" if len(declared.effect) > 1 else "a"
    outcome = f"there was {article if found else 'no'} {'' if found else 'significant '}{compared_words(declared)}"
    how = row.note.rpartition(", ")[2]
    which = f"; the difference is {escape(how.replace('_', ' '))}" if not math.isnan(row.estimate) else ""
    which += f"; {ADJUSTED}, {WHY}" if ADJUSTED in row.note else ""
    return f"{outcome} on {measure_words(declared)}{which}"


def _outcome(declared: DeclaredTest, row: Result, first: str, second: str) -> str:
    way = {"greater": "higher", "less": "lower"}.get(declared.direction, "")
    plural = declared.measure != REWARD
    if row.p < level_of(declared, row.n):
        way = way or ("higher" if row.effect > 0 else "lower")  # the median of differences may be 0
        return f"{'were' if plural else 'was'} significantly {way} with {first} than with {second}"
    if way:
        return f"{'were' if plural else 'was'} not significantly {way} with {first} than with {second}"
    return f"did not differ significantly between {first} and {second}"


def _numbers(row: Result) -> str:
    """Estimate, interval, statistic and effect size."""
    decimals = 2 if row.question else 1
    if math.isnan(row.estimate):  # more than one difference
        return f"{statistic(row)}, {_effect_size(row)}"
    estimate = f"difference {formatting.signed(row.estimate, decimals)}"
    if not math.isnan(row.estimate_low):
        low, high = (number(bound, decimals) for bound in (row.estimate_low, row.estimate_high))
        estimate += f", {100 * row.ci_level:.4g} % CI [{low}, {high}]"
    return f"{estimate}, {statistic(row)}, {_effect_size(row)}"


def _effect_size(row: Result) -> str:
    names = {"Hedges g": "Hedges’ <i>g</i>", "Cliff delta": "Cliff’s δ", "partial eta squared": "partial η²"}
    return f"{names[row.effect_name]} = {number(row.effect, 3 if row.test == ANOVA else 2)}"
