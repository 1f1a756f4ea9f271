"""Why a game is paused: what counts as an absence, and how long it may last."""

import pytest

from server.play.episode_spec import PauseLimits
from server.play.pause_reasons import PauseReasons

LIMITS = PauseLimits(each_s=30, episode_s=60)


def test_a_page_that_goes_and_comes_all_the_time_uses_its_time_up() -> None:
    reasons = PauseReasons(LIMITS, 0)
    for count in range(1000):
        reasons.hold(0, "hidden", now := count * 0.01)
        left_s = reasons.left_s(now)
        if left_s is not None and left_s <= 0:
            break
        reasons.release(0, now)
    assert count == 120


@pytest.mark.parametrize("holder", ["researcher", "database"])
def test_time_in_which_nobody_could_return_does_not_count_as_an_absence(holder: str) -> None:
    reasons = PauseReasons(LIMITS, 0)
    reasons.hold(0, "hidden", 0.0)
    reasons.hold(holder, holder, 10.0)
    assert reasons.left_s(10_000.0) is None
    reasons.release(holder, 10_000.0)
    assert reasons.left_s(10_005.0) == pytest.approx(25.0)
    reasons.hold(holder, holder, 10_005.0)
    reasons.release(0, 20_000.0)
    reasons.release(holder, 20_000.0)
    reasons.hold(0, "hidden", 20_000.0)
    assert reasons.left_s(20_028.0) == pytest.approx(2.0)
    reasons.release(0, 20_028.0)
    reasons.hold(0, "hidden", 30_000.0)
    assert reasons.left_s(30_000.0) == pytest.approx(60.0 - 5.0 - 28.0)


def test_time_used_up_by_absences_is_known_while_one_lasts() -> None:
    reasons = PauseReasons(LIMITS, 1500.0)
    assert reasons.away_ms(0.0) == 1500.0
    reasons.hold(0, "hidden", 0.0)
    reasons.hold(1, "server", 0.0)
    assert reasons.away_ms(4.0) == 5500.0
    reasons.hold("researcher", "researcher", 5.0)
    assert reasons.away_ms(1000.0) == 6500.0
    reasons.release(0, 2000.0)
    assert reasons.away_ms(3000.0) == 6500.0


def test_only_absences_of_people_count_as_being_away() -> None:
    reasons = PauseReasons(LIMITS, 0)
    reasons.hold(0, "not_started", 0.0)
    reasons.hold(1, "lost", 0.0)
    assert [reasons.is_away(person) for person in (0, 1, 2)] == [False, True, False]


def test_absences_count_again_when_neither_the_researcher_nor_the_database_pauses_the_game() -> None:
    reasons = PauseReasons(LIMITS, 0)
    reasons.hold("researcher", "researcher", 0.0)
    reasons.hold("database", "database", 5.0)
    reasons.hold(0, "lost", 10.0)
    reasons.release("researcher", 100.0)
    assert reasons.left_s(200.0) is None
    reasons.release("database", 200.0)
    assert reasons.left_s(201.0) == pytest.approx(29.0)


def test_leaving_again_and_again_while_the_researcher_pauses_the_game_uses_no_time_up() -> None:
    reasons = PauseReasons(LIMITS, 0)
    reasons.hold("researcher", "researcher", 0.0)
    for now in range(1000):
        reasons.hold(0, "blur", float(now))
        reasons.release(0, now + 0.9)
    reasons.release("researcher", 1000.0)
    reasons.hold(0, "blur", 1000.0)
    assert reasons.left_s(1000.0) == pytest.approx(30.0)


def test_the_next_absence_may_take_what_earlier_ones_have_left() -> None:
    reasons = PauseReasons(LIMITS, 0)
    assert reasons.next_absence_s(0.0) == 30.0
    reasons.hold(0, "hidden", 0.0)
    reasons.release(0, 28.0)
    assert reasons.next_absence_s(30.0) == 30.0
    reasons.hold(0, "lost", 30.0)
    assert reasons.next_absence_s(50.0) == pytest.approx(12.0)
    reasons.release(0, 55.0)
    assert reasons.next_absence_s(60.0) == pytest.approx(7.0)
    reasons.extend(60.0)
    assert reasons.next_absence_s(60.0) == pytest.approx(67.0)
    reasons.hold(1, "lost", 60.0)
    assert reasons.next_absence_s(200.0) == 0.0


def test_the_time_in_which_two_people_are_away_counts_once() -> None:
    reasons = PauseReasons(LIMITS, 0)
    reasons.hold(0, "lost", 0.0)
    reasons.hold(1, "lost", 5.0)
    reasons.release(0, 20.0)
    reasons.release(1, 25.0)
    assert reasons.away_ms(100.0) == 25_000.0


def test_two_people_who_relieve_each_other_use_up_the_time_of_the_episode() -> None:
    reasons = PauseReasons(LIMITS, 0)
    reasons.hold(0, "lost", 0.0)
    reasons.hold(1, "lost", 25.0)
    reasons.release(0, 26.0)
    reasons.hold(0, "lost", 50.0)
    reasons.release(1, 51.0)
    assert reasons.left_s(51.0) == pytest.approx(9.0)
    assert reasons.away_ms(51.0) == 51_000.0


def test_after_a_pause_of_the_researcher_two_absences_begin_anew() -> None:
    reasons = PauseReasons(LIMITS, 0)
    reasons.hold(0, "lost", 0.0)
    reasons.hold(1, "lost", 0.0)
    reasons.hold("researcher", "researcher", 10.0)
    reasons.release(0, 500.0)
    reasons.release("researcher", 1000.0)
    assert reasons.left_s(1004.0) == pytest.approx(26.0)
    reasons.release(1, 1004.0)
    assert reasons.away_ms(1004.0) == 4_000.0


def test_more_time_is_what_was_given_in_all() -> None:
    reasons = PauseReasons(LIMITS, 0, more_time_s=60.0)
    assert reasons.next_absence_s(0.0) == 90.0
    reasons.extend(60.0)
    assert reasons.next_absence_s(0.0) == 90.0, "the database knew of it already"
    reasons.extend(180.0)
    reasons.extend(120.0)
    assert reasons.next_absence_s(0.0) == 210.0, "the newer number arrived first"
