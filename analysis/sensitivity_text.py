"""Sentences about exclusions and attrition."""

import math
from collections.abc import Sequence

from analysis import formatting
from analysis.declared import Declaration, DeclaredTest
from analysis.exclusions import REASONS
from analysis.formatting import listed, p_equals, word
from analysis.phrases import ALPHA, condition
from analysis.primary import at_this_look
from analysis.primary_text import compared_words, measure_words
from analysis.results import Result, select
from analysis.robustness import main_test
from analysis.sensitivity import ATTRITION, SECTION
from analysis.simulated_participants import PEOPLE, Subjects


def sensitivity_sentences(
    declaration: Declaration, contrast: tuple[str, str] | None, rows: Sequence[Result], who: Subjects = PEOPLE
) -> list[str]:
    """Return sentences on whether the conclusion depends on exclusions, and whether attrition differs between
    conditions."""
    declared = main_test(declaration, contrast)
    tests = select(rows, section=SECTION)
    made = [_exclusions(declared, tests, who)] if declared and tests else []
    return [text for text in (*made, _attrition(rows)) if text]


def conclusion(row: Result, declared: DeclaredTest) -> str:
    """Return what a row says: higher, lower, no significant difference, or nothing."""
    if math.isnan(row.p):
        return ""
    if row.p >= declared.alpha:
        return "no significant effect" if declared.effect else "no significant difference"
    if declared.effect and math.isnan(row.estimate):
        return "an effect"
    # The estimate of ranks is the median of differences, which may be 0; eta squared has no sign.
    return "higher" if (row.estimate if declared.effect else row.effect) > 0 else "lower"


def _exclusions(declared: DeclaredTest, tests: Sequence[Result], who: Subjects) -> str:
    declared = at_this_look(declared, select(tests, test="analysed")[0].n)
    found = {row.test: conclusion(row, declared) for row in tests}
    if not found["analysed"]:
        return ""
    sizes = {row.test: _size(declared, row) for row in tests}
    what = f"The {_compared(declared)}"
    others = [name for name, text in found.items() if text and text != found["analysed"]]
    untested = [name for name, text in found.items() if not text]
    names = {
        "assigned": "all who were assigned",
        "completed": "all who finished",
        "no_drop": f"only {who.people} without an episode that a rule proposes to drop",
        "no_flag": f"only {who.people} without a flagged episode",
    }
    asked = [name for name in names if name not in untested]
    values = ", ".join(f"{sizes[name]} with {names[name]}" for name in asked)
    missing = f" It could not be computed with {listed([names[name] for name in untested])}." if untested else ""
    if not others:
        return f"{what} does not depend on the exclusions: {sizes['analysed']} as analysed, {values}.{missing}"
    changed = listed([f"{names[name]} ({found[name]})" for name in others])
    return (
        f"{what} depends on the exclusions: {sizes['analysed']} as analysed ({found['analysed']}), {values}; the "
        f"conclusion differs with {changed}.{missing}"
    )


def _compared(declared: DeclaredTest) -> str:
    if declared.effect:
        return f"{compared_words(declared)} on {measure_words(declared)}"
    first, second = (condition(name) for name in declared.comparison)
    return f"comparison of {measure_words(declared)} between {first} and {second}"


def _size(declared: DeclaredTest, row: Result) -> str:
    """Return the difference; where there is more than one, the share of variance."""
    if declared.effect and math.isnan(row.estimate):
        return f"partial η² = {formatting.number(row.effect, 3)}"
    return formatting.signed(row.estimate, 2 if declared.measure != "reward" else 1)


def _attrition(rows: Sequence[Result]) -> str:
    parts = select(rows, section=ATTRITION, test="left")
    tests = select(rows, section=ATTRITION, test="left_by_condition")
    if not parts or not tests:
        return ""
    lost = listed([f"{round(row.estimate * row.n)} of {row.n} with {condition(row.condition)}" for row in parts])
    row = tests[0]
    text = f"Of those assigned{_still_active(rows)}, these did not finish the study: {lost}"
    if math.isnan(row.p):
        return f"{text}."
    verb = "differed" if row.p < ALPHA else "did not differ significantly"
    return f"{text}; attrition {verb} between the conditions ({row.note}, <i>p</i> {p_equals(row.p)})."


def _still_active(rows: Sequence[Result]) -> str:
    """Return that the shares leave out people who are still taking part, whom the table of the flow counts."""
    active = select(rows, section="exclusions", test="left", condition="all", note=REASONS["active"])
    return (
        f", without the {word(active[0].n)} who {'are' if active[0].n > 1 else 'is'} still taking part"
        if active
        else ""
    )
