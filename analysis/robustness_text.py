"""Sentences about the checks on the mixed model, simple effects and the answers as ordered categories."""

from collections.abc import Sequence

from analysis import formatting
from analysis.formatting import listed, p_equals
from analysis.groups import ALL
from analysis.model_checks import SECTION, SIMPLE
from analysis.ordinal import SECTION as ORDINAL
from analysis.phrases import ALPHA, agent, condition, layout, question, significant, with_p
from analysis.results import Result, select
from analysis.simulated_participants import PEOPLE, Subjects


def checks(who: Subjects) -> dict[str, str]:
    """Return each check of the mixed model in words."""
    return {
        "cluster_robust": "with errors robust to clusters of episodes",
        "random_slopes": f"with a random slope of the agent for each {who.person}",
        "with_round": "with the round as covariate",
    }


def check_sentences(contrast: tuple[str, str] | None, rows: Sequence[Result], who: Subjects = PEOPLE) -> list[str]:
    """Return a sentence for each kind of check that was computed, as HTML. Without a main contrast there is none: the
    conditions are then orders of blocks, or there is only one."""
    if contrast is None:
        return []
    made = [_models(contrast, rows, who), _learning(contrast, rows), *_simple(contrast, rows, who), _ordinal(rows)]
    return [text for text in made if text]


def _words(contrast: tuple[str, str]) -> str:
    first, second = (condition(name) for name in contrast)
    return f"between {first} and {second}"


def _models(contrast: tuple[str, str] | None, rows: Sequence[Result], who: Subjects) -> str:
    """Return the difference under other assumptions, in addition to that of the mixed model."""
    if contrast is None:
        return ""
    name, words = " - ".join(contrast), checks(who)
    plain = with_p(select(rows, section="mixed model", test="fixed_effect", contrast=name))
    found = with_p([row for test in words for row in select(rows, section=SECTION, test=test, contrast=name)])
    if not plain or not found:
        return ""
    estimates = listed(
        [f"{formatting.signed(row.estimate)} {words[row.test]} (<i>p</i> {p_equals(row.p)})" for row in found]
    )
    other = [row for row in found if _conclusion(row) != _conclusion(plain[0])]
    holds = "the conclusion of the mixed model holds in all of them"
    if other:
        holds = f"the conclusion of the mixed model does not hold {listed([words[row.test] for row in other])}"
    return f"The difference in reward {_words(contrast)} was {estimates}; {holds}."


def _conclusion(row: Result) -> int:
    """Return 1 or -1 for a significant difference, 0 for none."""
    return 0 if row.p >= ALPHA else 1 if row.estimate > 0 else -1


def _learning(contrast: tuple[str, str] | None, rows: Sequence[Result]) -> str:
    slopes = with_p(select(rows, section=SECTION, test="round"))
    if contrast is None or not slopes:
        return ""
    row = slopes[0]
    verb = "changed" if row.p < ALPHA else "did not change significantly"
    text = f"Reward {verb} from round to round ({formatting.signed(row.estimate)} a round, <i>p</i> {p_equals(row.p)})"
    for other in with_p(select(rows, section=SECTION, test="round_by_condition", contrast=" - ".join(contrast))):
        verb = "differed" if other.p < ALPHA else "did not differ significantly"
        text += f"; this {verb} {_words(contrast)} ({formatting.signed(other.estimate)}, <i>p</i> {p_equals(other.p)})"
    return f"{text}."


def _simple(contrast: tuple[str, str] | None, rows: Sequence[Result], who: Subjects) -> list[str]:
    """Return the simple effects, which are reported only if the difference depends on the layout or the agent."""
    made = []
    for column, other in (("layout", "agent"), ("agent", "layout")):
        depends = any(significant(row) for row in with_p(select(rows, section="reward", test=f"contrast_by_{column}")))
        effects = with_p([row for row in select(rows, section=SIMPLE) if getattr(row, other) == ALL])
        if contrast is None or not depends or not effects:
            continue
        name = {"layout": layout, "agent": agent}[column]
        parts = listed(
            [
                f"{formatting.signed(row.estimate)} {'on' if column == 'layout' else 'with'} "
                f"{name(getattr(row, column))} (corrected <i>p</i> {p_equals(row.p_adjusted)})"
                for row in effects
            ]
        )
        made.append(
            f"As the difference {_words(contrast)} depended on the {column}, simple effects over {who.people}: {parts}."
        )
    return made


def _ordinal(rows: Sequence[Result]) -> str:
    tests = with_p(select(rows, section=ORDINAL, test="odds"))
    if not tests:
        return ""
    sure = [
        f"“{question(row.question)}” {' against '.join(condition(name) for name in row.contrast.split(' - '))} "
        f"(odds ratio {formatting.number(row.effect)}, corrected <i>p</i> {p_equals(row.p_adjusted)})"
        for row in tests
        if significant(row)
    ]
    found = f"these differed significantly: {listed(sure)}" if sure else "none differed significantly"
    return (
        f"In cumulative-link mixed models of the answers, with Benjamini-Hochberg correction over {len(tests)} "
        f"{'comparisons' if len(tests) > 1 else 'comparison'}, {found}."
    )
