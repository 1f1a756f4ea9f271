"""Write findings and APA sentences from result rows, ready to paste, also if nothing was found.

Both report the tests over people. The published tests, which treat episodes as independent, are named as such.
Marked up with <i> for statistical letters, as both HTML and word processors take it.
"""

import math
from collections.abc import Sequence

from markupsafe import escape

from analysis.accuracy import human_agents
from analysis.accuracy_text import accuracy_finding, accuracy_sentence
from analysis.factorial import SECTION
from analysis.factorial_text import factorial_sentences
from analysis.flow_text import flow_sentence
from analysis.formatting import listed, number, p_equals, word
from analysis.phrases import (
    ALPHA,
    agent,
    condition,
    corrected,
    interval,
    layout,
    lowered,
    note,
    partner,
    places,
    question,
    raised,
    significant,
    span,
    statistic,
    with_p,
)
from analysis.results import Result, select
from analysis.study import Analysis
from analysis.tables import PERSON


def findings(analysis: Analysis) -> list[str]:
    """Return the two or three lines at the top of the report."""
    # With blocks, conditions are orders of blocks, whose comparison is not the main question.
    reward = _effects_finding(analysis) if analysis.within else _reward_finding(analysis)
    accuracy = accuracy_finding(analysis.rows, analysis.subjects, human_agents(analysis.episodes))
    found = [reward, _layouts_finding(analysis), accuracy]
    return [line for line in found if line] or ["There is too little data for a comparison yet."]


def _effects_finding(analysis: Analysis) -> str:
    """Return the effects on reward of factors within people, or why there are none."""
    effects = select(analysis.rows, section=SECTION, question="")
    if made := factorial_sentences(effects, analysis.subjects):
        return made[0]
    tried = [row for row in select(effects, test="anova") if row.n]
    names = listed([str(escape(name.replace("_", " "))) for name in analysis.within])
    return f"The effects of {names} on reward could not be tested: {note(tried[0])}." if tried else ""


def _reward_finding(analysis: Analysis) -> str:
    tests = with_p(select(analysis.rows, section="reward", test="kruskal_wallis_people"))
    if not tests:
        return _no_comparison(analysis)
    sure = [agent(row.agent) for row in tests if significant(row)]
    values = ", ".join(f"{agent(row.agent)} <i>p</i> {p_equals(row.p_adjusted)}" for row in tests)
    over = analysis.subjects.people
    how = f"(Kruskal-Wallis, conditions permuted over {over}, {_corrected_for(tests)}{values}; {_size(analysis)})"
    if not sure:
        return f"No difference in reward between the conditions was found {how}."
    if len(sure) < len(tests):
        return f"Reward differs between the conditions for {listed(sure)} only {how}."
    who = "both agents" if len(tests) == 2 else "every agent" if len(tests) > 1 else partner(tests[0].agent)
    where = "in rounds with" if tests[0].agent == PERSON and len(tests) == 1 else "for"
    return f"Reward differs between the conditions {where} {who} {how}."


def _no_comparison(analysis: Analysis) -> str:
    """Return why rewards were not compared: the reason of the agent with most data, as one that stood in for a missing
    partner may have been met in one condition alone."""
    for test in ("kruskal_wallis_people", "kruskal_wallis"):
        tried = select(analysis.rows, section="reward", test=test)
        tried = [row for row in tried if row.n and math.isnan(row.p)]  # with p, the note is not a reason
        if tried:
            return f"The conditions could not be compared by reward: {note(max(tried, key=lambda row: row.n))}."
    return ""


def _corrected_for(tests: Sequence[Result]) -> str:
    return f"corrected over {len(tests)} agents: " if len(tests) > 1 else ""


def _size(analysis: Analysis) -> str:
    """Return the size of the data in words: 860 episodes of 87 people."""
    number_of_people = analysis.episodes["participant"].n_unique()
    return f"{analysis.episodes.height} episodes of {number_of_people} {analysis.subjects.people}"


def _main_tests(analysis: Analysis) -> list[Result]:
    """Return the tests over people per layout and agent of the comparison that the study is about."""
    if analysis.contrast is None:
        return []
    contrast = " - ".join(analysis.contrast)
    return with_p(select(analysis.rows, section="reward", test="t_test_people", contrast=contrast))


def _layouts_finding(analysis: Analysis) -> str:
    tests = _main_tests(analysis)
    if not tests or analysis.contrast is None:
        return ""
    first, second = (condition(name) for name in analysis.contrast)
    how = f"(t-tests over {analysis.subjects.people}, Benjamini-Hochberg over {len(tests)})"
    more, less = raised(tests), lowered(tests)
    if not more and not less:
        text = f"Reward does not differ significantly between {first} and {second} in any layout {how}."
    else:
        ways = (("more", more), ("less", less))
        parts = [f"{way} in {_counted(analysis, tests, found)}" for way, found in ways if found]
        text = f"With {first} teams earn {listed(parts)} than with {second} {how}."
    depends = [name for name in ("layout", "agent") if _dependent(analysis, name)]
    return text + (f" The difference depends on the {listed(depends)}." if depends else "")


def _counted(analysis: Analysis, tests: Sequence[Result], found: Sequence[Result]) -> str:
    """Return the counts in words: 4 of 5 layouts with SP and 0 of 5 with FCP."""
    parts: list[str] = []
    for name in analysis.agents:
        rows, mine = ([row for row in some if row.agent == name] for some in (tests, found))
        layouts = "" if parts else " layouts"
        parts += [f"{len(mine)} of {len(rows)}{layouts} with {agent(name)}"] if rows else []
    return listed(parts)


def _dependent(analysis: Analysis, column: str) -> bool:
    """Return true if the difference of the main comparison depends on the layout or agent."""
    return any(significant(row) for row in with_p(select(analysis.rows, test=f"contrast_by_{column}")))


def sentences(analysis: Analysis) -> list[str]:
    """Return sentences for a results section. With blocks of rounds, those about the factors replace comparisons of
    conditions, which would compare orders of the blocks."""
    accuracy = accuracy_sentence(analysis.rows, analysis.subjects)
    if analysis.within:
        return [text for text in (flow_sentence(analysis), accuracy) if text]
    reward = (flow_sentence(analysis), _kruskal(analysis), _pairwise(analysis), _mixed(analysis))
    return [text for text in (*reward, *_questionnaire(analysis), accuracy) if text]


def _kruskal(analysis: Analysis) -> str:
    tests = with_p(select(analysis.rows, section="reward", test="kruskal_wallis_people"))
    if not tests:
        return ""
    who = analysis.subjects
    people = {row.agent: row.n for row in tests}
    sure, other = ([row for row in tests if significant(row) is way] for way in (True, False))
    ways = (("differed", sure), ("did not differ significantly", other))
    parts = [f"{verb} {_agents_p(rows)}" for verb, rows in ways if rows]
    published = [
        f"with {partner(row.agent)} {statistic(row)}, ε² = {number(row.effect)}, "
        f"{row.n} episodes of {people[row.agent]} {who.people}"
        for row in with_p(select(analysis.rows, section="reward", test="kruskal_wallis"))
    ]
    correction = f", corrected over {len(tests)} agents" if len(tests) > 1 else ""
    count = len(analysis.conditions)
    is_whole = all(row.df == count - 1 for row in tests)  # an agent may have episodes in some conditions only
    between = f"the {word(count)} conditions" if is_whole else "the conditions with episodes of an agent"
    return (
        f"Between {between} rewards {listed(parts)} (Kruskal-Wallis with "
        f"conditions permuted over {who.people}{correction}). The published test, which treats the episodes of a "
        f"{who.person} as independent, gives: {'; '.join(published)}."
    )


def _agents_p(rows: Sequence[Result]) -> str:
    return listed([f"with {partner(row.agent)} (<i>p</i> {p_equals(row.p_adjusted)})" for row in rows])


def _pairwise(analysis: Analysis) -> str:
    tests = _main_tests(analysis)
    if not tests or analysis.contrast is None:
        return ""
    first, second = (condition(name) for name in analysis.contrast)
    how = f"After Benjamini-Hochberg correction over {_t_tests(len(tests))} over {analysis.subjects.people}, "
    more, less = raised(tests), lowered(tests)
    if not more and not less:
        estimates = span([row.estimate for row in tests], 1)
        return (
            f"{how}the reward did not differ significantly between {first} and {second} on any layout "
            f"(estimates {estimates} points)."
        )
    parts = [f"raised the reward {places(more)}"] if more else []
    parts += [f"lowered {'it' if more else 'the reward'} {places(less)}"] if less else []
    sizes = span([row.effect for row in [*more, *less]])
    rest = len(tests) - len(more) - len(less)
    others = f"; the other {word(rest)} did not differ significantly" if rest else ""
    return f"{how}{first} {listed(parts)}, compared with {second} (Hedges’ <i>g</i> {sizes}{others})."


def _t_tests(count: int) -> str:
    return f"{count} t-tests" if count > 1 else "one t-test"


def _mixed(analysis: Analysis) -> str:
    if analysis.contrast is None or analysis.model.variance is None:
        return ""
    contrast = " - ".join(analysis.contrast)
    rows = with_p(select(analysis.rows, section="mixed model", test="fixed_effect", contrast=contrast))
    if not rows:
        return ""
    row = rows[0]
    first, second = (condition(name) for name in analysis.contrast)
    inside = f"{interval(row)}, {statistic(row)}; ICC = {number(analysis.model.variance.icc)}"
    if row.p < ALPHA:
        way = "higher" if row.estimate > 0 else "lower"
        result = f"was {number(abs(row.estimate), 1)} points {way} with {first} than with {second} ({inside})"
    else:
        estimate = f"estimate {number(row.estimate, 1)} points"
        result = f"did not differ significantly between {first} and {second} ({estimate}, {inside})"
    return (
        f"In a mixed model with {analysis.subjects.participants} as random effect{_fixed(analysis)}, the reward "
        f"{result}.{_depends(analysis)}"
    )


def _fixed(analysis: Analysis) -> str:
    """Return which further effects the mixed model has: of what was there more than once."""
    names = [name for name, levels in (("agent", analysis.agents), ("layout", analysis.layouts)) if len(levels) > 1]
    return f" and {listed(names)} as fixed effect{'s' if len(names) > 1 else ''}" if names else ""


def _depends(analysis: Analysis) -> str:
    """Return whether one difference describes all layouts and agents."""
    made = []
    for column in ("layout", "agent"):
        for row in with_p(select(analysis.rows, section="reward", test=f"contrast_by_{column}")):
            verb = "depended" if significant(row) else "did not depend significantly"
            made.append(f"{verb} on the {column} (<i>p</i> {p_equals(row.p_adjusted)})")
    how = f"conditions permuted over {analysis.subjects.people}" + (", corrected over both" if len(made) > 1 else "")
    return f" The difference {listed(made)}; {how}." if made else ""


def _questionnaire(analysis: Analysis) -> list[str]:
    """Return a summary, and a sentence for every question and comparison, also where nothing was found."""
    tests = select(analysis.rows, section="questionnaire", test="t_test_people")
    tested = with_p(tests)
    if not tested:
        return []
    who = analysis.subjects
    where = listed([layout(name) for name in analysis.questionnaire_layouts])
    if others := [layout(name) for name in analysis.layouts if name not in analysis.questionnaire_layouts]:
        where += f", and not those about {listed(others)},"
    sure = sum(significant(row) for row in tested)
    count = word(sure) if sure else "none"
    made = [
        f"Answers about {where} were averaged for each {who.person} and compared by {_t_tests(len(tested))} over "
        f"{who.people}, with Benjamini-Hochberg correction over all of them; {count} of {len(tested)} differed "
        "significantly."
    ]
    for key, contrast in dict.fromkeys((row.question, row.contrast) for row in tested):
        rows = select(tested, question=key, contrast=contrast)
        made.append(f"“{question(key)}” {_rated(rows, contrast)}.")
    return made


def _rated(rows: Sequence[Result], contrast: str) -> str:
    first, second = (condition(name) for name in contrast.split(" - "))
    ways = (("higher", raised(rows)), ("lower", lowered(rows)))
    parts = [f"{way} with {_agents_statistic(found)}" for way, found in ways if found]
    rest = [row for row in rows if not significant(row)]
    if not parts:
        return f"did not differ significantly between {first} and {second}: {_estimates(rest)}"
    others = f"; the difference was not significant {_estimates(rest)}" if rest else ""
    return f"was rated {listed(parts)} under {first} than under {second}{others}"


def _agents_statistic(rows: Sequence[Result]) -> str:
    return listed([f"{agent(row.agent)} ({corrected(row)}, <i>g</i> = {number(row.effect)})" for row in rows])


def _estimates(rows: Sequence[Result]) -> str:
    values = [f"with {agent(row.agent)} (estimate {number(row.estimate)}, {corrected(row)})" for row in rows]
    return listed(values)
