"""Findings and APA sentences made of result rows, ready to paste. Says what the rows say, also when nothing was found.

Marked up with <i> for statistical letters, as both HTML and word processors take it.
"""

import math

from analysis.names import (
    agent_title,
    condition_phrase,
    degrees,
    layout_title,
    listed,
    number,
    p_equals,
    word,
)
from analysis.questionnaires import title
from analysis.results import Result, select
from analysis.study import Analysis

ALPHA = 0.05


def statistic(row: Result) -> str:
    """t(55) = 3.46, p = .001; F(2, 83) = ...; H(2, n = 430) = ... with letters in italics."""
    letter = {"chi2": "χ²"}.get(row.statistic_name, row.statistic_name)
    inside = degrees(row.df)
    if letter == "H":
        inside += f", <i>n</i> = {row.n}"
    elif not math.isnan(row.df_residual):
        inside += f", {degrees(row.df_residual)}"
    brackets = "" if math.isnan(row.df) else f"({inside})"
    return f"<i>{letter}</i>{brackets} = {number(row.statistic)}, <i>p</i> {p_equals(row.p)}"


def findings(analysis: Analysis) -> list[str]:
    """The two or three lines at the top of the report."""
    found = [_reward_finding(analysis), _layouts_finding(analysis), _accuracy_finding(analysis)]
    return [line for line in found if line] or ["There is too little data for a comparison yet."]


def _tested(analysis: Analysis, test: str, **wanted: object) -> list[Result]:
    return [row for row in select(analysis.rows, section="reward", test=test, **wanted) if not math.isnan(row.p)]


def _reward_finding(analysis: Analysis) -> str:
    tests = _tested(analysis, "kruskal_wallis")
    if not tests:
        return ""
    sure = [agent_title(row.agent) for row in tests if row.p < ALPHA]
    values = ", ".join(f"{agent_title(row.agent)} <i>p</i> {p_equals(row.p)}" for row in tests)
    if len(sure) == len(tests):
        who = "both agents" if len(tests) == 2 else "every agent" if len(tests) > 1 else f"the {sure[0]} agent"
        return f"Reward differs between the conditions for {who} (Kruskal-Wallis, {values})."
    if sure:
        return f"Reward differs between the conditions for {listed(sure)} only (Kruskal-Wallis, {values})."
    return f"No difference in reward between the conditions was found (Kruskal-Wallis, {values})."


def _main_tests(analysis: Analysis) -> list[Result]:
    if analysis.contrast is None:
        return []
    return _tested(analysis, "t_test", contrast=" - ".join(analysis.contrast))


def _layouts_finding(analysis: Analysis) -> str:
    tests = _main_tests(analysis)
    if not tests or analysis.contrast is None:
        return ""
    parts: list[str] = []
    for agent in analysis.agents:
        rows = [row for row in tests if row.agent == agent]
        better = [row for row in rows if row.p_adjusted < ALPHA and row.estimate > 0]
        layouts = "" if parts else " layouts"
        parts += [f"{len(better)} of {len(rows)}{layouts} with {agent_title(agent)}"] if rows else []
    worse = sum(row.p_adjusted < ALPHA and row.estimate < 0 for row in tests)
    first, second = (condition_phrase(name) for name in analysis.contrast)
    also = f" They earn less in {word(worse)}." if worse else ""
    return f"With {first} teams earn more than with {second} in {listed(parts)}, after correction.{also}"


def _accuracy_finding(analysis: Analysis) -> str:
    lives = select(analysis.rows, section="accuracy", test="live", layout="all", condition="all", step=0)
    if not lives:
        return ""
    live = 100 * sum(row.estimate for row in lives) / len(lives)
    text = f"The predictor is right {number(live, 1)} % of the time with people"
    offline = select(analysis.rows, section="accuracy", test="offline", layout="all", step=0)
    if len(offline) == len(lives):
        gap = live - 100 * sum(row.estimate for row in offline) / len(offline)
        text += f", {number(abs(gap), 1)} points {'less' if gap < 0 else 'more'} than in the offline test"
    return text + "."


def sentences(analysis: Analysis) -> list[str]:
    """Sentences for a results section."""
    made = [
        _excluded(analysis),
        _kruskal(analysis),
        _pairwise(analysis),
        _mixed(analysis),
        *_questionnaire(analysis),
        _accuracy_sentence(analysis),
    ]
    return [text for text in made if text]


def _excluded(analysis: Analysis) -> str:
    counts = select(analysis.rows, section="exclusions", condition="all", unit="episodes")
    done = sum(row.n for row in counts if row.test == "played")
    left = sum(row.n for row in counts if row.test == "analysed")
    people = next(row.n for row in select(analysis.rows, test="analysed", condition="all", unit="people"))
    if not done:
        return ""
    text = f"The analysis is of {left} episodes of {people} participants."
    out = done - left
    return (
        f"Of {done} episodes, {word(out)} ({100 * out / done:.1f} %) were removed; {text[0].lower()}{text[1:]}"
        if out
        else text
    )


def _kruskal(analysis: Analysis) -> str:
    tests = _tested(analysis, "kruskal_wallis")
    if not tests:
        return ""
    parts = [f"with the {agent_title(row.agent)} agent ({statistic(row)}, ε² = {number(row.effect)})" for row in tests]
    which = {row.p < ALPHA for row in tests}
    if which == {True}:
        count = word(len(analysis.conditions))
        return f"Rewards differed between the {count} conditions {listed(parts)} (Kruskal-Wallis)."
    if which == {False}:
        return f"Rewards did not differ significantly between the conditions {listed(parts)} (Kruskal-Wallis)."
    verbs = [
        ("differed " if row.p < ALPHA else "did not differ significantly ") + part
        for row, part in zip(tests, parts, strict=True)
    ]
    return f"Rewards {listed(verbs)} (Kruskal-Wallis)."


def _pairwise(analysis: Analysis) -> str:
    tests = _main_tests(analysis)
    if not tests or analysis.contrast is None:
        return ""
    first, second = (condition_phrase(name) for name in analysis.contrast)
    sure = [row for row in tests if row.p_adjusted < ALPHA and row.estimate > 0]
    if not sure:
        return (
            f"After Benjamini-Hochberg correction over {len(tests)} t-tests, {first} did not raise the reward "
            f"significantly over {second}."
        )
    parts = []
    for agent in dict.fromkeys(row.agent for row in sure):
        rows = [row for row in sure if row.agent == agent]
        parts.append(f"with {agent_title(agent)} on {listed([layout_title(row.layout) for row in rows])}")
    sizes = sorted(row.effect for row in sure)
    span = number(sizes[0]) if len(sizes) == 1 else f"from {number(sizes[0])} to {number(sizes[-1])}"
    return (
        f"After Benjamini-Hochberg correction over {len(tests)} t-tests, {first} raised the reward over {second} "
        f"{listed(parts)} (Hedges’ <i>g</i> {span})."
    )


def _mixed(analysis: Analysis) -> str:
    if analysis.contrast is None:
        return ""
    rows = select(analysis.rows, section="mixed model", test="fixed_effect", contrast=" - ".join(analysis.contrast))
    if not rows or math.isnan(rows[0].p) or analysis.model.variance is None:
        return ""
    row = rows[0]
    first, second = (condition_phrase(name) for name in analysis.contrast)
    way = "higher" if row.estimate > 0 else "lower"
    interval = f"95 % CI [{number(row.estimate_low, 1)}, {number(row.estimate_high, 1)}]"
    return (
        f"In a mixed model with participants as random effect and agent and layout as fixed effects, the reward was "
        f"{number(abs(row.estimate), 1)} points {way} with {first} than with {second} ({interval}, {statistic(row)}; "
        f"ICC = {number(analysis.model.variance.icc)})."
    )


def _questionnaire(analysis: Analysis) -> list[str]:
    """One sentence a question and contrast where any agent's test is significant as published (uncorrected)."""
    tests = select(analysis.rows, section="questionnaire", test="t_test")
    made = []
    for question, contrast in dict.fromkeys((row.question, row.contrast) for row in tests):
        rows = [row for row in select(tests, question=question, contrast=contrast) if not math.isnan(row.p)]
        first, second = (condition_phrase(name) for name in contrast.split(" - "))
        parts = [f"{way} {_with_agents(found)}" for way, found in _by_way(rows) if found]
        if parts:
            rest = [row for row in rows if row.p >= ALPHA]
            also = f", but not significantly so {_with_agents(rest)}" if rest else ""
            made.append(f"“{title(question)}” was rated {listed(parts)} under {first} than under {second}{also}.")
    return made


def _by_way(rows: list[Result]) -> list[tuple[str, list[Result]]]:
    sure = [row for row in rows if row.p < ALPHA]
    return [
        ("higher", [row for row in sure if row.estimate > 0]),
        ("lower", [row for row in sure if row.estimate < 0]),
    ]


def _with_agents(rows: list[Result]) -> str:
    values = [f"{agent_title(row.agent)} ({statistic(row)}, <i>g</i> = {number(row.effect)})" for row in rows]
    return f"with {listed(values)}"


def _accuracy_sentence(analysis: Analysis) -> str:
    parts = []
    for row in select(analysis.rows, section="accuracy", test="live", layout="all", condition="all", step=0):
        interval = f"95 % CI [{number(100 * row.estimate_low, 1)}, {number(100 * row.estimate_high, 1)}]"
        parts.append(f"{number(100 * row.estimate, 1)} % of the {agent_title(row.agent)} agent’s actions ({interval})")
    return f"In the games with people the predictor foresaw {listed(parts)}, mean of the three steps." if parts else ""
