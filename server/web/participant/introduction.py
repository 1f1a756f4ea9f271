"""The slides of the introduction: what the game is like in a participant's condition."""

from dataclasses import dataclass
from typing import Final

from overcooked.constants import COOK_TIME
from server.participation.episode_specs import show_of, steps_shown_of, view_radius_of
from server.study.condition import Condition, Display
from server.study.definition import Study
from server.study.locale import Locale

SLIDES: Final = ("team", "fetch", "fill", "wait", "deliver", "marks")


@dataclass(frozen=True)
class Slide:
    """One slide. `view` is what limited sight means, empty on other slides."""

    key: str
    title: str
    text: str
    view: str = ""


@dataclass(frozen=True)
class Introduction:
    """What the template needs. `steps`: how many predicted steps the scene draws."""

    slides: tuple[Slide, ...]
    show: str
    display: Display
    steps: int


def introduction_of(study: Study, condition: Condition, words: Locale) -> Introduction:
    """Return the introduction of a condition; predictions are only explained if it shows them."""
    slides = tuple(
        Slide(key, _title(key, study, words), _text(key, study, condition, words), _view(key, study, condition, words))
        for key in SLIDES
        if key != "marks" or study.shows_predictions(condition)
    )
    return Introduction(slides, show_of(study, condition), study.drawn(condition), _steps(study, condition))


def cooking_time(study: Study, words: Locale) -> str:
    """Return how long a soup cooks at the study's speed, such as `4 seconds` or `0.4 seconds`."""
    seconds = f"{COOK_TIME * study.game.tick_ms / 1000:.1f}".removesuffix(".0")
    return words("game.one_second") if seconds == "1" else words("game.some_seconds", seconds=seconds)


def _title(key: str, study: Study, words: Locale) -> str:
    title = f"introduction.{key}_title"
    return words(title, time=cooking_time(study, words)) if key == "wait" else words(title)


def _text(key: str, study: Study, condition: Condition, words: Locale) -> str:
    """Return the text of a slide: what marks are depends on what is drawn, and who the partner is on the study."""
    human = "_human" if all(agent.human for agent in study.agents) else ""
    if key != "marks":
        return words(f"introduction.{key}{human if key == 'team' else ''}")
    display, steps = study.drawn(condition), _steps(study, condition)
    drawn = f"_{display}" if display in ("intention", "both") else ""
    if drawn == "_intention":
        return words(f"introduction.marks{drawn}{human}")
    if steps == 1:
        return words(f"introduction.marks{drawn}_one{human}")
    return words(f"introduction.marks{drawn}{human}", steps=steps)


def _view(key: str, study: Study, condition: Condition, words: Locale) -> str:
    cells = next(filter(None, (view_radius_of(study, one) for one in condition.displays)), 0)
    if key != "team" or not cells:
        return ""
    return words("introduction.view_one") if cells == 1 else words("introduction.view", cells=cells)


def _steps(study: Study, condition: Condition) -> int:
    """Return how many steps are drawn; where blocks of rounds differ, the largest number of them."""
    shown = [one for one in condition.displays if study.drawn(one) in ("actions", "both")]
    return max(steps_shown_of(study, one) for one in shown or [condition])
