"""What is said of a kitchen without trained models, and what the study builder offers for it."""

import re

import pytest

from overcooked.layout import load_layout
from server.participation.draft_checks import draft_problems
from server.settings import ROOT
from server.study.drafting import changed, view
from server.study.loader import PlacedProblem

STUDIES = ROOT / "studies"
GRID = "".join(f"      {row}\n" for row in load_layout("coordination_ring").text.splitlines())
KITCHEN = f"layouts:\n  - name: nook\n    title: {{en: Nook, zh: 小屋}}\n    grid: |\n{GRID}"


def in_own_kitchen(name: str) -> str:
    """A study of the repository, in a kitchen that was drawn by hand."""
    text = (STUDIES / f"{name}.yaml").read_text(encoding="utf-8")
    return re.sub(r"(?m)^layouts:\n(  .*\n)*", KITCHEN, text)


QUICK = in_own_kitchen("quick_look")
PAPER = in_own_kitchen("external_predictor")
DEGRADED = QUICK.replace("{name: tom, predictor: tom}", "{name: tom, predictor: degraded, accuracy: 0.5}")
ICONS = QUICK.replace("steps_shown: 3}", "steps_shown: 3, display: intention}")


def wrong(text: str) -> list[PlacedProblem]:
    shown = view(text)
    found = shown.problems if shown.file is None else draft_problems(shown.file, [])
    return [problem for problem in found if not problem.warning]


def fixed(text: str) -> list[str]:
    """Press the first button until none is offered; return their words."""
    clicked = []
    while problems := [problem for problem in wrong(text) if problem.fix is not None]:
        assert problems[0].fix is not None
        clicked.append(problems[0].fix.label)
        text = changed(text, dict(problems[0].fix.operation))
        assert len(clicked) < 10, clicked
    return clicked


def test_an_agent_that_was_never_trained_and_its_predictor_are_one_problem() -> None:
    (problem,) = wrong(QUICK)
    assert "the kitchen nook has no trained agent called 'sp_strong'" in problem.text
    assert "It has no predictor either: condition `tom` shows its predictions." in problem.text
    silent = QUICK.replace("{name: tom, predictor: tom}", "{name: none, predictor: none}")
    (problem,) = wrong(silent.replace("conditions: with_predictor", "conditions: all"))
    assert "It has no predictor either. A scripted agent needs `predictor: random`." in problem.text


def test_a_predictor_that_the_study_names_is_a_problem_of_its_own() -> None:
    named = QUICK.replace("{name: sp_strong}", "{name: sp_strong, predictor: mine}")
    of_predictor, of_agent = (problem.text for problem in wrong(named))
    assert "predictor called 'mine'" in of_predictor
    assert "agent called 'sp_strong'" in of_agent
    assert "no predictor either" not in of_agent


@pytest.mark.parametrize(
    ("text", "labels"),
    [
        (QUICK, ["Use the planner with random predictions"]),
        (QUICK.replace("{name: sp_strong}", "{name: planner}"), ["Use random predictions"]),
        (in_own_kitchen("two_people"), ["Use random predictions", "Let the planner stand in for a missing partner"]),
        (
            PAPER,
            [
                "Leave these breaks out",
                "Use the planner with random predictions",
                "Leave fcp out",
                "Use latin_square",
            ],
        ),
    ],
)
def test_scripted_models_make_a_study_in_a_new_kitchen_playable(text: str, labels: list[str]) -> None:
    assert fixed(text) == labels


@pytest.mark.parametrize(
    ("name", "labels"),
    [
        ("quick_look", ["Play only in nook", "Use the planner with random predictions"]),
        (
            "two_people",
            ["Play only in nook", "Use random predictions", "Let the planner stand in for a missing partner"],
        ),
        (
            "external_predictor",
            [
                "Play only in nook",
                "Leave these breaks out",
                "Use the planner with random predictions",
                "Leave fcp out",
                "Use latin_square",
            ],
        ),
    ],
)
def test_a_new_kitchen_next_to_those_of_a_template_can_take_their_place(name: str, labels: list[str]) -> None:
    text = (STUDIES / f"{name}.yaml").read_text(encoding="utf-8")
    clicked = fixed(re.sub(r"(?m)^layouts:\n", KITCHEN, text))
    assert clicked == labels


def test_a_new_kitchen_does_not_replace_those_in_which_the_agent_is_missing_too() -> None:
    text = (STUDIES / "quick_look.yaml").read_text(encoding="utf-8").replace("{name: sp_strong}", "{name: nobody}")
    assert [problem.fix for problem in wrong(re.sub(r"(?m)^layouts:\n", KITCHEN, text))] == [None, None]


@pytest.mark.parametrize(
    "text",
    [
        DEGRADED,
        ICONS,
        QUICK.replace("{name: sp_strong}", "{name: sp, model: ./sp, predictor: random}"),
        (STUDIES / "quick_look.yaml").read_text(encoding="utf-8").replace("{name: sp_strong}", "{name: nobody}"),
    ],
    ids=["degraded", "intentions", "path", "a kitchen with trained models"],
)
def test_scripted_models_are_not_offered_where_they_cannot_give_what_the_study_needs(text: str) -> None:
    problems = wrong(text)
    assert problems
    assert [problem.fix for problem in problems] == [None] * len(problems)
