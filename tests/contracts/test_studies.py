"""Every bundled study is valid, complete and as published."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from server.participation.episode_specs import episode_spec
from server.required_models import required_models
from server.study.loader import load_study, parse_study
from server.study.steps import steps
from server.study_check import stage_problems

STUDIES = Path(__file__).parents[2] / "studies"
BUNDLED = sorted(STUDIES.glob("**/*.yaml"))


@pytest.fixture(params=BUNDLED, ids=lambda path: path.stem)
def path(request: pytest.FixtureRequest) -> Path:
    found: Path = request.param
    return found


def test_study_loads_without_a_warning_and_is_named_like_its_file(path: Path) -> None:
    file = load_study(path)
    assert file.warnings == ()
    assert file.study.name == path.stem


def test_study_needs_nothing_but_weights(path: Path) -> None:
    assert [problem for problem in stage_problems(load_study(path)) if not problem.warning] == []


def test_every_game_of_every_condition_can_be_drawn_up(path: Path) -> None:
    study = load_study(path).study
    for condition in study.conditions:
        for step in steps(study, condition.name, 5):
            if step.is_game:
                spec = episode_spec(study, step, condition.name, "zh")
                assert spec.human_seats == (0,)
                assert spec.watched_seat == 1
                assert spec.predictor is not None


def test_conditions_differ_in_what_is_shown_and_in_nothing_else() -> None:
    study = load_study(STUDIES / "external_predictor.yaml").study
    specs = {}
    for condition in study.conditions:
        step = next(step for step in steps(study, condition.name, 5) if step.kind == "episode")
        specs[condition.name] = episode_spec(study, step, condition.name, "en")
    assert {name: spec.shown for name, spec in specs.items()} == {
        "none": "nothing",
        "random": "random",
        "tom": "predictor",
    }
    assert len({replace(spec, shown="nothing", display="none") for spec in specs.values()}) == 1


def test_published_study_is_as_published() -> None:
    study = load_study(STUDIES / "external_predictor.yaml").study
    assert [condition.predictor for condition in study.conditions] == ["none", "random", "tom"]
    assert {condition.weight for condition in study.conditions} == {1}
    assert (study.game.tick_ms, study.game.horizon, study.game.human_seat) == (200, 400, 0)
    assert (study.predictor.form, study.predictor.steps_shown, study.order.rule) == ("window", 3, "paper")
    questions = study.questions("teamwork")
    assert [question.text.of("en") for question in questions] == [
        "How satisfied are you with your AI teammate?",
        "How satisfied are you with the predictor (the green marks)?",
        "To what extent can you predict the intention of your AI teammate?",
        "How would you rate the efficiency of cooperation?",
    ]
    assert all(question.type == "scale" and question.points == 7 and question.required for question in questions)
    assert [question.conditions for question in questions] == ["all", "with_predictor", "all", "all"]


def test_the_pages_do_not_reveal_that_predictions_are_random(path: Path) -> None:
    """Before the end, no text for participants contains the name of a condition."""
    study = load_study(path).study
    texts = [
        study.consent,
        study.title,
        study.summary,
        study.quiz,
        *study.questionnaires.values(),
        *study.pages.values(),
    ]
    words = " ".join(part.model_dump_json() for part in texts if part is not None).lower()
    assert "under a random number" in words
    assert "random" not in words.replace("under a random number", "")


def test_participants_can_tell_the_bundled_studies_apart_by_their_titles() -> None:
    studies = [load_study(path).study for path in sorted(STUDIES.glob("*.yaml"))]
    for language in ("en", "zh"):
        titles = [study.title.of(language) for study in studies]
        assert len(set(titles)) == len(titles), titles


def test_a_study_that_names_no_form_of_predictor_gets_one_that_is_bundled() -> None:
    text = (STUDIES / "quick_look.yaml").read_text(encoding="utf-8")
    without = re.sub(r"(?m)^predictor: .*\n", "", text)
    assert without != text
    required = required_models([parse_study(without)])
    assert ("coordination_ring", "sp_strong_predictor_stream") in required.predictors
    assert required.missing == ()
