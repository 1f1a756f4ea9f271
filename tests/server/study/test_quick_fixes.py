"""What the study builder offers for a problem solves it."""

import re

import pytest

from server.settings import ROOT
from server.study.drafting import changed, view
from server.study.loader import PlacedProblem

PAPER = (ROOT / "studies" / "external_predictor.yaml").read_text(encoding="utf-8")
ONE_KITCHEN = re.sub(r"(?m)^  - \{name: (double_rings|double_counters|matrix|clear_division), .*\n", "", PAPER)
THREE_KITCHENS = re.sub(r"(?m)^  - \{name: (matrix|clear_division), .*\n", "", PAPER)
ONE_AGENT = PAPER.replace("  - {name: fcp}\n", "")
OTHER_CONDITION = PAPER.replace("conditions: with_predictor", "conditions: [tom, gone]", 1)
NO_CONDITION = PAPER.replace("conditions: with_predictor", "conditions: [gone]", 1)
TWICE = PAPER.replace("debriefing, thanks]", "debriefing, nowhere, debriefing, thanks]")
PRIMARY = f"""{PAPER}
primary: {{comparison: [tom, none], layouts: [matrix, gone]}}
smallest_effect: {{reward: 5, layouts: [gone]}}
"""
HUMAN = PAPER.replace("  - {name: fcp}", "  - {name: fcp, human: true, predictor: fcp_predictor_stream}")


def wrong(text: str) -> list[PlacedProblem]:
    return [problem for problem in view(text).problems if not problem.warning]


@pytest.mark.parametrize(
    ("text", "labels"),
    [
        (ONE_KITCHEN, ["Leave these breaks out"]),
        (THREE_KITCHENS, ["Leave this break out"]),
        (ONE_AGENT, ["Use latin_square", "Leave this break out"]),
        (OTHER_CONDITION, ["Ask in tom only"]),
        (NO_CONDITION, ["Ask in all conditions"]),
        (TWICE, ["Take nowhere out of the flow", "Take debriefing out of the flow"]),
        (PRIMARY, ["Leave gone out", "Leave gone out"]),
        (HUMAN, ["Use fixed"]),
        (PAPER.replace("flow: [about_you, ", "flow: ["), ["Put about_you before the last page"]),
    ],
)
def test_one_click_solves_each_problem(text: str, labels: list[str]) -> None:
    clicked = []
    while problems := wrong(text):
        assert problems[0].fix is not None, problems[0]
        clicked.append(problems[0].fix.label)
        text = changed(text, dict(problems[0].fix.operation))
    assert clicked == labels
    assert view(text).file is not None


def test_breaks_that_are_still_between_rounds_stay() -> None:
    (problem,) = wrong(THREE_KITCHENS)
    assert problem.fix is not None
    study = view(changed(THREE_KITCHENS, dict(problem.fix.operation))).file
    assert study is not None
    assert study.study.breaks.after == (4,)


def test_a_problem_that_needs_a_decision_has_no_button() -> None:
    (problem,) = wrong(PAPER.replace("deadline_ms: 120", "deadline_ms: 300"))
    assert problem.fix is None
