"""The introduction says what is true in a participant's condition: steps that are drawn, time that a soup cooks."""

import pytest

from server.study.definition import Study
from server.study.loader import parse_study
from server.study.locale import Locale, locale
from server.web.participant.introduction import cooking_time, introduction_of
from tests.support.page_site import SMALL_STUDY

EN, ZH = locale("en"), locale("zh")


def study(condition: str = "predictor: tom", tick_ms: int = 200, text: str = SMALL_STUDY) -> Study:
    changed = text.replace("{name: with, predictor: tom}", f"{{name: with, {condition}}}")
    return parse_study(changed.replace("tick_ms: 200", f"tick_ms: {tick_ms}, deadline_ms: {tick_ms // 2}")).study


def words_of(slide: str, made: Study, words: Locale = EN, condition: str = "with") -> str:
    slides = introduction_of(made, made.condition(condition), words).slides
    return next(f"{one.title} {one.text} {one.view}" for one in slides if one.key == slide)


@pytest.mark.parametrize("display", ["actions", "both"])
@pytest.mark.parametrize(
    ("steps", "english", "chinese"),
    [(1, "in its next step", "接下来一步"), (2, "in its next 2 steps", "接下来 2 步"), (3, "3 steps", "接下来 3 步")],
)
def test_the_slide_on_marks_names_as_many_steps_as_are_drawn(
    display: str, steps: int, english: str, chinese: str
) -> None:
    made = study(f"predictor: tom, steps_shown: {steps}, display: {display}")
    assert introduction_of(made, made.condition("with"), EN).steps == steps
    assert english in words_of("marks", made)
    assert chinese in words_of("marks", made, ZH)


@pytest.mark.parametrize("display", ["actions", "both"])
def test_people_who_cook_with_people_read_about_their_partners_steps(display: str) -> None:
    two = SMALL_STUDY.replace("  - {name: stay, predictor: random}\n", "").replace("{rule: paper}", "{rule: fixed}")
    two = two.replace("{name: planner, predictor: random}", "{name: person, human: true, predictor: random}")
    two = two.replace("breaks: {after: [2]}\n", "")
    one, more = (study(f"predictor: tom, steps_shown: {steps}, display: {display}", text=two) for steps in (1, 2))
    assert "their partner is predicted to do in the next step" in words_of("marks", one)
    assert "their partner is predicted to do in the next 2 steps" in words_of("marks", more)


def test_a_condition_without_marks_does_not_explain_any() -> None:
    made = study()
    assert "marks" not in [one.key for one in introduction_of(made, made.condition("without"), EN).slides]


@pytest.mark.parametrize(
    ("tick_ms", "english", "chinese"),
    [
        (200, "4 seconds", "4 秒"),
        (50, "1 second", "1 秒"),
        (125, "2.5 seconds", "2.5 秒"),
        (20, "0.4 seconds", "0.4 秒"),
    ],
)
def test_cooking_takes_as_long_as_at_the_studys_speed(tick_ms: int, english: str, chinese: str) -> None:
    made = study(tick_ms=tick_ms)
    assert (cooking_time(made, EN), cooking_time(made, ZH)) == (english, chinese)
    assert words_of("wait", made).startswith(f"Cooking takes {english} ")


@pytest.mark.parametrize(("radius", "seen"), [(1, "up to 1 cell away"), (3, "up to 3 cells away")])
def test_limited_sight_is_explained_with_its_radius(radius: int, seen: str) -> None:
    made = study(f"predictor: tom, view_radius: {radius}")
    assert seen in words_of("team", made)
    assert seen not in words_of("team", made, condition="without")
    assert f"{radius} 格" in words_of("team", made, ZH)
