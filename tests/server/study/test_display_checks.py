"""What a study may draw of a prediction, and what is refused at its place."""

import pytest

from server.participation.episode_specs import episode_spec, lessons
from server.prediction_warnings import prediction_warnings
from server.study.loader import StudyError, parse_study
from server.study.steps import steps
from server.study_check import stage_problems
from tests.support.study_text import SMALL_STUDY, study_head

START, END = SMALL_STUDY.index("conditions:\n"), SMALL_STUDY.index("agents:\n")


def text(conditions: str, more: str = "") -> str:
    return f"{SMALL_STUDY[:START]}conditions: [{conditions}]\n{SMALL_STUDY[END:]}\n{more}"


def refused(content: str) -> str:
    with pytest.raises(StudyError) as caught:
        parse_study(content, "small.yaml")
    return str(caught.value)


@pytest.mark.parametrize(
    ("condition", "display", "shown"),
    [
        ("{name: a, predictor: tom}", "both", "predictor"),
        ("{name: a, predictor: tom, display: intention}", "intention", "predictor"),
        ("{name: a, predictor: random}", "both", "random"),
        ("{name: a, predictor: tom, display: none}", "none", "nothing"),
        ("{name: a, predictor: none}", "none", "nothing"),
    ],
)
def test_a_condition_draws_by_its_own_setting_or_the_study_s(condition: str, display: str, shown: str) -> None:
    study = parse_study(text(condition, "predictor: {display: both}\n")).study
    step = next(one for one in steps(study, "a", 1) if one.kind == "episode")
    spec = episode_spec(study, step, "a", "en")
    assert (spec.display, spec.shown) == (display, shown)
    assert ("marks" in lessons(study, study.condition("a"))) == (display != "none")
    assert spec.predictor is not None, "predictions are computed in every condition"


@pytest.mark.parametrize(
    ("condition", "reason"),
    [
        ("{name: a, predictor: none, display: both}", "`display: both` in a condition without marks has no effect"),
        ("{name: a, predictor: tom, display: none, show: on_key}", "`show: on_key` in a condition without marks"),
        ("{name: a, predictor: tom, display: intention, steps_shown: 2}", "that draws no steps has no effect"),
        ("{name: a, predictor: random, display: none}", "`predictor: random` is about what is drawn"),
    ],
)
def test_a_setting_that_changes_nothing_is_refused(condition: str, reason: str) -> None:
    assert reason in refused(text(condition))


def test_in_a_factorial_a_level_without_display_is_a_warning() -> None:
    factors = "factors: {display: [intention, none], prediction: [random, tom]}\n"
    file = parse_study(SMALL_STUDY[:START] + factors + SMALL_STUDY[END:], "small.yaml")
    assert [one.display for one in file.study.conditions] == ["intention", "intention", "none", "none"]
    (warning,) = file.warnings
    assert "in the condition none_random" in warning
    assert "cells: {without: [none_random]}" in warning


SP = """
conditions: [{{name: a, predictor: tom, display: intention}}, {{name: b, predictor: random, display: both}}]
agents: [{{name: sp{predictor}}}]
layouts: [{{name: matrix, title: {{en: Matrix}}}}]
tutorial: {{agent: {{name: {practice}, predictor: {practice}}}}}
flow: [introduction, tutorial, episodes, thanks]
"""


def test_an_intention_display_without_a_predictor_of_intentions_is_refused_with_a_remedy() -> None:
    file = parse_study(study_head("small", "Small") + SP.format(predictor=", predictor: random", practice="carrier"))
    (problem,) = [one for one in stage_problems(file, loads=False) if not one.warning]
    assert problem.path == ("conditions", 0, "display")
    assert "'random' has none" in problem.reason
    assert "display: actions" in problem.remedy
    with_intentions = file.text.replace("predictor: random}]", "predictor: guide}]")
    assert [one for one in stage_problems(parse_study(with_intentions), loads=False) if not one.warning] == []


@pytest.mark.parametrize(("practice", "warned"), [("guide", True), ("carrier", False)])
def test_a_practice_that_shows_no_intention_is_a_warning(practice: str, warned: bool) -> None:
    file = parse_study(study_head("small", "Small") + SP.format(predictor=", predictor: guide", practice=practice))
    assert any("the practice shows no intention" in one.reason for one in prediction_warnings(file)) == warned
