"""A study in which two people play together: errors have place and remedy."""

from pathlib import Path

import pytest

from server.participation.episode_specs import models_of
from server.study.loader import StudyError, parse_study

STUDY = (Path(__file__).parents[3] / "studies" / "two_people.yaml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("rule: fixed", "rule: shuffled", "Use `rule: fixed`"),
        ("human: true, predictor: fcp_strong_predictor_stream", "human: true", "Add `predictor:`"),
        ("human: true, predictor", "human: true, model: sp, predictor", "neither `model` nor `mode`"),
        ("agent: {name: fcp_strong}", "agent: {name: somebody, human: true}", "a person cannot stand in for one"),
        ("limit_s: 180", "limit_s: 0", "limit_s"),
    ],
)
def test_misfits_are_reported_with_their_remedy(old: str, new: str, told: str) -> None:
    assert STUDY.count(old) == 1
    with pytest.raises(StudyError) as raised:
        parse_study(STUDY.replace(old, new), "pairs.yaml")
    assert told in str(raised.value)
    assert "pairs.yaml:" in str(raised.value)


def test_models_are_those_that_watch_people_and_the_fallback_agent() -> None:
    study = parse_study(STUDY, "pairs.yaml").study
    agents, predictors = models_of(study)
    assert {name for _, name in agents} == {"fcp_strong", "guide"}
    assert {name for layout, name in predictors if layout != "practice"} == {"fcp_strong_predictor_stream"}


def test_without_marks_no_predictor_for_people_is_needed() -> None:
    text = STUDY.replace(", predictor: fcp_strong_predictor_stream", "")
    text = text.replace("  - {name: tom, predictor: tom}\n", "")
    study = parse_study(text, "pairs.yaml").study
    assert study.agent("person").predictor is None
