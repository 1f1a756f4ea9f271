"""The lessons of the tutorial, taught by doing."""

import numpy as np
import pytest

from models.agents.planner import PlannerPolicy
from models.protocols import Observations
from overcooked.constants import INTERACT, STAY
from overcooked.state import Kitchens
from server.play.messages import Input
from server.play.session import Session
from server.play.tutorial import LESSONS, MARKS_WATCHED_TIMESTEPS, Tutor
from tests.support.live_fakes import RuleModels, make_spec, new_record

ALL = tuple(LESSONS)


def tutorial(shown: str = "predictor", lessons: tuple[str, ...] = ALL) -> Session:
    session = Session(new_record(make_spec(kind="tutorial", horizon=0, lessons=lessons, number=0, shown=shown)), 0.0)
    session.release(0, 0.0)
    session.count_down(0.0, 0.0)
    session.finish_tick([None], 1.0) if session.begin_start() else None
    session.stored = True
    return session


def seen_by_cook(session: Session) -> Observations:
    simulation = session.simulation
    players, contents = simulation.players()[None].copy(), simulation.contents()[None].copy()
    return Kitchens(simulation.layout, players, contents, np.zeros(1, np.int32)).encode(horizon=0)[:, 0]


def cook(session: Session, most: int = 400) -> list[str]:
    """Let a planner follow the lessons; return the lessons in their order."""
    seen: list[str] = []
    models = RuleModels()
    for seq in range(most):
        lesson = session.lesson()
        assert lesson is not None
        if not lesson.done and (not seen or seen[-1] != lesson.key):
            seen.append(lesson.key)
        probabilities = PlannerPolicy().probabilities(seen_by_cook(session))
        action = INTERACT if lesson.key == "marks" else int(np.argmax(probabilities[0]))
        if action != STAY:
            session.key(0, Input(seq, None, action, 0.0), session.next_deadline)
        session.finish_tick([models.decide(question) for question in session.begin_tick(session.next_deadline)], 1.0)
        session.stored = True
        if session.over:
            return seen
    raise AssertionError(f"not learnt: {seen}")


def test_lessons_come_in_order_and_end_the_endless_tutorial_with_a_delivery() -> None:
    session = tutorial()
    assert cook(session) == [key for key in ALL if key in set(cook(tutorial()))]
    result = session.result()
    assert (result.passed, result.reason) == (True, "lessons")
    assert result.soups >= 1


def test_marks_are_taught_by_watching_them_first() -> None:
    session = tutorial()
    cook(session)
    assert session.tutor is not None
    assert session.simulation.timestep > MARKS_WATCHED_TIMESTEPS


def test_marks_are_not_taught_where_none_are_shown() -> None:
    session = tutorial(shown="nothing")
    assert "marks" not in cook(session)


def test_standing_still_teaches_nothing() -> None:
    session = tutorial()
    for _ in range(60):
        session.begin_tick(session.next_deadline)
        session.finish_tick([None], 1.0)
        session.stored = True
    lesson = session.lesson()
    assert lesson is not None
    assert (lesson.key, lesson.index, lesson.steps, lesson.done) == ("walk", 0, len(ALL), False)
    assert not session.over


@pytest.mark.parametrize("lessons", [("walk",), ("walk", "fetch")])
def test_a_tutorial_without_a_delivery_among_its_lessons_is_passed_with_the_last_one(lessons: tuple[str, ...]) -> None:
    session = tutorial(lessons=lessons)
    assert cook(session) == list(lessons)
    assert session.simulation.soups == 0
    assert session.result().passed, "the participant would repeat it for ever"


@pytest.mark.parametrize("lessons", [(), ("marks",)])
def test_a_tutorial_in_which_nothing_is_taught_ends_with_a_delivery(lessons: tuple[str, ...]) -> None:
    session, models = tutorial("nothing", lessons), RuleModels()
    for seq in range(400):
        if session.over:
            break
        action = int(np.argmax(PlannerPolicy().probabilities(seen_by_cook(session))[0]))
        session.key(0, Input(seq, None, action, 0.0), session.next_deadline)
        session.finish_tick([models.decide(question) for question in session.begin_tick(session.next_deadline)], 1.0)
        session.stored = True
    assert (session.over, session.simulation.soups) == (True, 1)
    assert session.result().passed


def test_unfinished_tutorial_is_not_passed() -> None:
    result = tutorial().result("aborted", "away")
    assert not result.passed


def test_unknown_lesson_is_refused() -> None:
    with pytest.raises(ValueError, match="dance"):
        Tutor(("walk", "dance"), 0)
