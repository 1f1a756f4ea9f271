"""A study that sets every setting: each reaches its page or game."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel

from server.participation.episode_specs import episode_spec, models_of
from server.play.episode_spec import EpisodeSpec
from server.settings import ROOT
from server.store import events, participants
from server.study.assignment import Count, StudyFullError, next_condition
from server.study.definition import Study
from server.study.loader import parse_study
from server.study.steps import StudyStep, steps
from server.study_check import stage_problems
from tests.support.page_site import PageSite, Visitor

TEXT = (ROOT / "tests" / "data" / "every_setting.yaml").read_text(encoding="utf-8")
LINK = "?PID=p1&WAVE=w2&OTHER=x"


@pytest.fixture(scope="module")
def study() -> Study:
    return parse_study(TEXT).study


@pytest.fixture
def site(tmp_path: Path) -> Iterator[PageSite]:
    with PageSite(tmp_path, TEXT) as running:
        yield running


def settings(part: Any) -> Iterator[tuple[str, bool]]:
    """Every setting of a study, named by the block that has it first, and whether the file makes it."""
    if isinstance(part, BaseModel) and type(part).model_fields.keys() != {"root"}:
        for name in type(part).model_fields:
            first = [cls for cls in type(part).__mro__ if name in getattr(cls, "model_fields", {})][-1]
            yield f"{first.__name__}.{name}", name in part.model_fields_set
            yield from settings(getattr(part, name))
    elif isinstance(part, dict | tuple):
        for value in part.values() if isinstance(part, dict) else part:
            yield from settings(value)


# Tested by themselves, as they change who a partner is: test_pairs.py.
OF_TWO_PEOPLE = {"PartnerSettings.human", "Study.waiting_room", "Recruitment.unpaired"}
OF_TWO_PEOPLE |= {"WaitingRoomSettings.limit_s", "WaitingRoomSettings.agent", "WaitingRoomSettings.fallback"}

# Tested by themselves, as they need a debriefing: test_misleading.py, test_debriefing.py.
MISLEADING = {"ConditionSettings.misleading", "Misleading.from_round", "Misleading.share", "Study.debriefing"}

# Tested by themselves, as they take the place of `conditions`: test_factors.py.
FACTORS = {"Study.factors", "Study.cells", "Cells.without", "Cells.quota", "Cells.within", "BlockOrder.blocks"}
FACTORS |= {"PrimaryTest.effect"}


# Tested by themselves, as they decide who gets a page: test_branching.py, test_branching_pages.py.
BRANCHING = {"SurveyQuestion.when", "Questionnaire.when", "TextPage.when"}


# Tested by itself, as the server writes it when a version is made: test_own_models.py.
WRITTEN = {"Study.checkpoints"}


def test_the_study_sets_everything_that_can_be_set(study: Study) -> None:
    never = {name for name, _ in settings(study)} - {name for name, is_made in settings(study) if is_made}
    # A choice that is an attention check, a number that need not be whole, a scale with other numbers and words: tested
    # with the questions and the published scales.
    questions = {"ChoiceQuestion.attention", "NumberQuestion.whole"}
    questions |= {"ScaleQuestion.first", "ScaleQuestion.step", "ScaleQuestion.labels"}
    assert never - OF_TWO_PEOPLE - MISLEADING - FACTORS - BRANCHING - WRITTEN == questions


def spec(study: Study, condition: str, kind: str = "episode", language: str = "en") -> tuple[StudyStep, EpisodeSpec]:
    step = next(step for step in steps(study, condition, 3, 1) if step.kind == kind)
    return step, episode_spec(study, step, condition, language)


def test_every_setting_of_the_game_reaches_it(study: Study) -> None:
    step, drawn_up = spec(study, "worse", language="zh")
    assert (drawn_up.tick_ms, drawn_up.horizon, drawn_up.deadline_ms) == (100, 30, 70)
    assert (drawn_up.steps_shown, drawn_up.confidence_opacity, drawn_up.shown) == (3, False, "predictor")
    assert (drawn_up.pause.each_s, drawn_up.pause.episode_s) == (20, 25)
    assert (drawn_up.progress.onion_in_pot, drawn_up.progress.soup_on_dish) == (2, 11)
    agent = {"cook": "planner@sampled", "pacer": "guide@greedy"}[step.agent]
    assert (drawn_up.agents, drawn_up.watched_seat) == ((agent, None), 0)
    assert drawn_up.predictor == "guide@60", "made worse, also where the study names the predictor"
    assert (drawn_up.show, drawn_up.view_radius) == ("on_key", 2), "the condition's own, not the study's"
    assert drawn_up.display == "both"
    assert drawn_up.title in ("环", "小角落")
    assert drawn_up.episodes == 8
    bare = spec(study, "bare")[1]
    assert (bare.steps_shown, bare.confidence_opacity, bare.shown) == (2, True, "nothing"), "the study's"
    assert bare.display == "none"


def test_the_tutorial_is_the_study_s_own_and_its_marks_are_never_made_worse(study: Study) -> None:
    _, drawn_up = spec(study, "worse", "tutorial")
    assert (drawn_up.title, drawn_up.agents, drawn_up.predictor) == ("Try it", ("stay", None), "random")
    assert drawn_up.lessons == ("walk", "fetch", "fill", "wait", "plate", "deliver")


def test_an_own_grid_is_what_is_played_and_every_model_is_asked_on_it(study: Study) -> None:
    grids = {}
    for step in steps(study, "worse", 3):
        if step.kind == "episode":
            grids[step.layout] = episode_spec(study, step, "worse", "en").grid
    assert grids["nook"] == "XXPXX\nO1 2O\nX   X\nXDXSX"
    agents, predictors = models_of(study)
    assert {("nook", "planner@sampled"), ("nook", "guide@greedy")} <= agents
    assert {("nook", "guide"), ("nook", "guide@60")} <= predictors


def test_the_order_is_the_latin_square_twice(study: Study) -> None:
    way = [step.layout for step in steps(study, "worse", 3, 0) if step.kind == "episode"]
    other = [step.layout for step in steps(study, "worse", 3, 1) if step.kind == "episode"]
    assert (len(way), set(way[:2]), way[:4]) == (8, {way[0]}, way[4:])
    assert way[0] != other[0], "the next participant of the condition begins with the other kitchen"
    assert [step.key for step in steps(study, "worse", 3) if step.kind == "break"] == ["break-03"]


def test_weights_and_quotas_are_kept(study: Study) -> None:
    held = {"bare": 0, "worse": 0}
    for number in range(60):
        held[next_condition(study, {name: Count(completed=count) for name, count in held.items()}, number)] += 1
    assert held == {"bare": 20, "worse": 40}
    with pytest.raises(StudyFullError):
        next_condition(study, {name: Count(completed=count) for name, count in held.items()}, 60)


def test_pages_show_the_texts_of_the_study_file(site: PageSite) -> None:
    visitor = Visitor(site)
    assert visitor.get("/s/every_setting").status_code == 400, "the person's parameter is required"
    page = visitor.get(f"/s/every_setting{LINK}").text
    assert "<strong>cook</strong>" in page
    assert "<li>onions</li>" in page
    assert "Write to lab@example.org." in page
    assert "&#34;latency_ms&#34;: 5000" in page
    assert "OTHER" not in str(visitor.fields("/consent"))
    visitor.get(f"/s/every_setting/declined{LINK}")
    assert "complete?cc=NO777&amp;wave=w2" in visitor.page.text
    visitor.consent("every_setting", LINK)
    me = site.only("every_setting")
    assert site.database.read_now(participants.personal_of, me.id) == {"recruitment_id": "p1", "WAVE": "w2"}
    assert "In years" in visitor.get("/s/every_setting/now").text


def arrived(site: PageSite, key: str, link: str = LINK) -> Visitor:
    visitor = Visitor(site)
    visitor.consent("every_setting", link)
    me = site.everybody("every_setting")[-1]
    keys = [step.key for step in site.studies.steps_of(me)]
    site.database.write_now(participants.advance, me.id, me.position, keys.index(key))
    visitor.get("/s/every_setting/now")
    return visitor


def test_the_practice_is_skipped_only_where_the_file_allows_it(site: PageSite, tmp_path: Path) -> None:
    visitor = arrived(site, "tutorial")
    assert 'id="skip"' in visitor.page.text
    visitor.submit("every_setting")
    me = site.only("every_setting")
    assert site.step(me).key == "ready-01"
    assert len(site.database.read_now(events.of_participant, me.id, "tutorial_skipped")) == 1
    (tmp_path / "strict").mkdir()
    with PageSite(tmp_path / "strict", TEXT.replace("  skippable: true\n", "")) as strict:
        visitor = arrived(strict, "tutorial")
        assert 'id="skip"' not in visitor.page.text
        me = strict.only("every_setting")
        fields = {"step": "tutorial"} | {
            "form_token": strict.app.state.services.web.csrf.form_token(visitor.client.cookies["participant"])
        }
        visitor.send("/s/every_setting/now", fields)
        assert strict.step(me).key == "tutorial"


def test_the_quiz_ends_the_study_after_the_allowed_attempts_with_the_return_link(site: PageSite) -> None:
    visitor = arrived(site, "quiz")
    assert "You have 2 tries." not in visitor.page.text, "the file has its own lead"
    for _ in range(2):
        visitor.submit("every_setting", onions="two")
    assert site.only("every_setting").status == "screened_out"
    assert "complete?cc=OUT77" in visitor.page.text
    assert "Delete my data" in visitor.page.text


def test_questions_follow_the_condition_and_scales_have_their_points(site: PageSite) -> None:
    for number in range(3):
        arrived(site, "after-01", f"?PID=q{number}&WAVE=1")
    shown = {}
    for number, me in enumerate(site.everybody("every_setting")):
        visitor = Visitor(site)
        visitor.consent("every_setting", f"?PID=q{number}&WAVE=1")
        shown[me.condition] = visitor.page.text
    assert set(shown) == {"bare", "worse"}
    asked = {name: set(re.findall(r'name="(marks|bare)"', page)) for name, page in shown.items()}
    assert asked == {"worse": {"marks"}, "bare": {"bare"}}
    assert shown["bare"].count('name="fun" value=') == 5


@pytest.mark.parametrize(
    ("predictor", "message"),
    [
        ("my.module:Mine", "cannot be made worse"),
        ("sp_predictor_stream", "so a degraded version cannot reach 90 %"),
    ],
)
def test_a_predictor_that_cannot_be_made_worse_is_refused_before_the_study_runs(predictor: str, message: str) -> None:
    text = TEXT.replace("predictor: guide}", f"predictor: '{predictor}'}}", 1).replace("accuracy: 0.6", "accuracy: 0.9")
    found = [problem.reason for problem in stage_problems(parse_study(text))]
    assert any(message in reason for reason in found), found
