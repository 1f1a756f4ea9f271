"""Pauses of one episode without clock or socket: keys, absences, reasons and seats."""

from datetime import timedelta

import pytest

from overcooked.constants import EAST, INTERACT, SOUTH, STAY
from server.play.episode_spec import PauseLimits
from server.play.session import Session
from tests.support.live_fakes import make_spec, new_record
from tests.support.played_session import AT, MODELS, press, start, tick


def test_pause_forgets_keys_and_resumes_at_the_same_timestep() -> None:
    session, _ = start(now=0.0)
    press(session, 0, EAST, EAST)
    begun = session.pause(0, "blur", 0.1, AT)
    assert begun is not None
    assert (begun.timestep, begun.reason, begun.duration_ms) == (0, "blur", None)
    assert not session.moving
    assert session.release(0, 5.1)
    ended = session.count_down(5.1, 8.2)
    assert ended is not None
    assert ended.duration_ms == pytest.approx(5000.0)
    assert ended.started_at == begun.started_at
    assert session.next_deadline == pytest.approx(8.4)
    record = tick(session)
    assert record.timestep == 1
    assert record.actions is not None
    assert record.actions[0] == STAY
    assert record.scheduled_ms == 200.0


def test_taps_while_paused_are_not_played_later() -> None:
    session, _ = start(now=0.0)
    session.pause(0, "hidden", 0.1, AT)
    press(session, 3, None, INTERACT, now=1.0)
    session.release(0, 2.0)
    session.count_down(2.0, 5.0)
    record = tick(session)
    assert record.actions is not None
    assert record.actions[0] == STAY


def test_taps_during_the_countdown_do_not_count_but_a_key_held_into_the_game_does() -> None:
    session, _ = start(now=0.0)
    session.pause(0, "hidden", 0.1, AT)
    session.release(0, 2.0)
    session.count_down(2.0, 5.0)
    press(session, 1, SOUTH, INTERACT, now=3.0)
    record = tick(session)
    assert record.actions is not None
    assert record.actions[0] == SOUTH


def test_absences_add_up_to_the_limit_of_the_episode() -> None:
    session, _ = start(make_spec(pause=PauseLimits(30.0, 60.0)), now=0.0)
    for round_number in range(2):
        since = round_number * 100.0
        session.pause(0, "hidden", since, AT + timedelta(seconds=since))
        left_s = session.pause_reasons.left_s(since + 25.0)
        assert left_s == pytest.approx(5.0)
        session.release(0, since + 25.0)
        session.count_down(since + 25.0, since + 28.0)
    session.pause(0, "hidden", 500.0, AT)
    assert session.pause_reasons.left_s(505.0) == pytest.approx(5.0)


def test_waiting_for_the_database_costs_the_participant_nothing() -> None:
    session, _ = start(now=0.0)
    session.pause("database", "database", 1.0, AT)
    assert session.pause_reasons.left_s(1000.0) is None
    assert session.paused(0, 1000.0).left_s == 0.0
    assert session.release("database", 1000.0)


def test_game_resumes_only_when_no_pause_reason_is_left() -> None:
    session, _ = start(now=0.0)
    session.pause("database", "database", 1.0, AT)
    session.pause(0, "lost", 2.0, AT)
    assert not session.release("database", 3.0)
    assert session.paused(0, 3.0).reason == "lost"
    assert session.release(0, 4.0)


def test_absence_before_the_start_is_not_a_pause() -> None:
    session = Session(new_record(make_spec()), 0.0)
    assert session.pause(0, "lost", 1.0, AT) is None
    assert session.phase == "waiting"
    assert session.pause_reasons.left_s(1000.0) is None


@pytest.mark.parametrize(("holder", "reason"), [(0, "hidden"), (1, "blur"), (1, "lost")])
def test_a_pause_says_which_of_two_people_began_it(holder: int, reason: str) -> None:
    session = Session(new_record(make_spec(agents=(None, None))), 0.0)
    assert not session.release(0, 0.0)
    assert session.release(1, 0.0)
    session.count_down(0.0, 0.0)
    session.finish_tick([MODELS.decide(question) for question in session.begin_start()], 1.0)
    session.stored = True
    tick(session)
    begun = session.pause(holder, reason, 1.0, AT)
    assert begun is not None
    assert begun.seat == holder
    assert session.pause(1 - holder, "hidden", 1.5, AT) is None
    over = session.end_pause(4.0)
    assert over is not None
    assert (over.seat, over.duration_ms) == (holder, 3000.0)


def test_a_pause_that_is_nobodys_absence_has_no_seat() -> None:
    session, _ = start()
    held = session.pause("researcher", "researcher", 101.0, AT)
    assert held is not None
    assert held.seat is None
    watched = Session(new_record(make_spec(kind="watch", agents=("sp", "sp"))), 0.0)
    watched.release(-1, 0.0)
    watched.count_down(0.0, 0.0)
    watched.finish_tick([MODELS.decide(question) for question in watched.begin_start()], 1.0)
    watched.stored = True
    away = watched.pause(-1, "hidden", 0.1, AT)
    assert away is not None
    assert (away.reason, away.seat) == ("hidden", None)
