"""Marks on demand: drawn in exactly the timesteps in which the participant asked for them, and stored so."""

import pytest

from models.protocols import Decision
from server.play.keys import MAX_SETTLED, Keys
from server.play.marks import NOTHING_SHOWN
from server.play.marks_key import MarksKey
from server.play.messages import Input
from server.play.session import Session
from tests.support.live_fakes import RuleModels, make_spec, new_record


class MarksPlayer:
    """A session that is played timestep by timestep, with a person who presses the marks key."""

    def __init__(self, **changes: object) -> None:
        self.session = Session(new_record(make_spec(**changes)), 0.0)
        self.seq = 0
        self.answer(self.session.begin_start())
        self.session.release(0, 0.0)
        self.session.count_down(0.0, 3.0)
        self.now = 3.0

    def answer(self, questions: list[object]) -> None:
        decisions: list[Decision | None] = [RuleModels().decide(one) for one in questions]  # type: ignore[arg-type]
        self.record = self.session.finish_tick(decisions, 1.0)
        self.session.stored = True

    def press(self, down: bool) -> None:
        self.seq += 1
        assert self.session.key(0, Input(self.seq, None, None, 0.0, down), self.now)

    def tick(self) -> bool:
        """Play a timestep; whether its frame shows marks, the same in the record and in the message."""
        self.now += 0.2
        self.answer(list(self.session.begin_tick(self.now)))
        assert self.session.tick_message(0).prediction == self.record.displayed
        return any(action != NOTHING_SHOWN for action, _ in self.record.displayed)


def test_with_on_key_a_frame_shows_the_marks_while_the_key_is_down() -> None:
    player = MarksPlayer(show="on_key")
    assert player.record.asked is False
    assert not player.tick()
    player.press(True)
    assert [player.tick(), player.tick()] == [True, True]
    assert player.record.asked is True
    player.press(False)
    assert [player.tick(), player.tick()] == [False, False]
    assert player.record.asked is False
    assert player.session.frames.violations == 0


def test_a_press_shorter_than_a_timestep_shows_one_frame() -> None:
    player = MarksPlayer(show="on_key")
    player.press(True)
    player.press(False)
    assert [player.tick(), player.tick()] == [True, False]


def test_with_toggle_each_press_turns_the_marks_on_or_off() -> None:
    player = MarksPlayer(show="toggle")
    shown = []
    for down in (True, False, True, False):
        player.press(down)
        shown += [player.tick(), player.tick()]
    assert shown == [True, True, True, True, False, False, False, False]


def test_a_page_that_connects_again_is_told_whether_the_toggle_is_on() -> None:
    player = MarksPlayer(show="toggle")
    said = []
    for down in (True, False, True):
        player.press(down)
        player.tick()
        said.append((player.session.tick_message(0).asked, player.session.welcome(0).asked))
    assert said == [(True, True), (True, True), (False, False)]
    assert MarksPlayer(show="toggle").session.welcome(0).asked is False


def test_where_marks_are_always_shown_nobody_need_ask() -> None:
    player = MarksPlayer(show="always")
    assert player.session.welcome(0).asked
    assert player.session.tick_message(0).asked


@pytest.mark.parametrize(("show", "after"), [("on_key", False), ("toggle", True)])
def test_after_a_pause_the_key_is_up_and_a_toggle_stays(show: str, after: bool) -> None:
    player = MarksPlayer(show=show)
    player.press(True)
    assert player.tick()
    player.session.keys[0].clear()
    assert player.tick() == after


def test_what_a_toggle_was_is_known_after_a_restart() -> None:
    key = MarksKey("toggle", is_on=True)
    assert key.take()
    assert not MarksKey("on_key", is_on=True).take()


def test_a_client_without_a_marks_key_plays_without_marks() -> None:
    player = MarksPlayer(show="on_key")
    assert player.session.key(0, Input(1, None, 2, 0.0), player.now)
    assert not player.tick()
    assert player.record.actions is not None
    assert player.record.actions[0] == 2
    assert player.session.frames.violations == 0


def test_marks_that_are_asked_for_and_missing_are_a_violation() -> None:
    player = MarksPlayer(show="on_key")
    player.press(True)
    player.session.begin_tick(player.now)
    record = player.session.finish_tick([None], 1.0)
    assert record.asked is True
    assert player.session.frames.violations == 1


def test_without_the_setting_nothing_is_asked() -> None:
    player = MarksPlayer()
    assert player.tick()
    assert player.record.asked is None


def test_each_use_of_the_key_is_an_input_with_its_timestep() -> None:
    keys = Keys(None, MarksKey("on_key"))
    for number, (held, marks) in enumerate([(None, True), (2, True), (2, False), (2, False)], start=1):
        keys.press(Input(number, held, None, 0.0, marks), 0.0)
        keys.take(number)
    found = [(one.number, one.marks, one.outcome, one.timestep) for one in keys.take_settled("e1", 0)]
    assert found == [
        (1, True, "marks", 1),
        (2, True, "applied", 2),
        (3, False, "marks", 3),
        (4, False, "unchanged", None),
    ]


def test_a_use_that_the_pause_forgets_is_stored_as_forgotten() -> None:
    keys = Keys(None, MarksKey("on_key"))
    keys.press(Input(1, None, None, 0.0, True), 0.0)
    keys.clear()
    keys.take(1)
    assert [(one.marks, one.outcome) for one in keys.take_settled("e1", 0)] == [(True, "forgotten")]


def test_presses_of_the_marks_key_do_not_pile_up_while_the_game_stands_still() -> None:
    keys = Keys(marks_key=MarksKey("toggle"))
    for seq in range(MAX_SETTLED + 10):
        keys.press(Input(seq, None, None, 0.0, seq % 2 == 0), 0.0, taps_count=False)
    assert {one.outcome for one in keys.take_settled("e1", 0)} == {"replaced"}
    keys.take(1)
    assert {one.outcome for one in keys.take_settled("e1", 0)} == {"marks"}
