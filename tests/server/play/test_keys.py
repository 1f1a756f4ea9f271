"""The actions of keys, tick by tick, for every possible order of messages."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from overcooked.constants import EAST, INTERACT, NORTH, STAY, WEST
from server.play.keys import Keys
from server.play.messages import Input


class Hands:
    """Presses and releases keys as a browser reports them."""

    def __init__(self) -> None:
        self.keys = Keys()
        self.seq = -1
        self.held: list[int] = []

    def down(self, action: int) -> None:
        if action == INTERACT:
            return self.send(INTERACT)
        self.held.append(action)
        self.send(action)

    def up(self, action: int) -> None:
        self.held.remove(action)
        self.send(None)

    def tap(self, action: int) -> None:
        self.down(action)
        if action != INTERACT:
            self.up(action)

    def send(self, tap: int | None) -> None:
        self.seq += 1
        self.keys.press(Input(self.seq, self.held[-1] if self.held else None, tap, float(self.seq)), float(self.seq))

    def ticks(self, count: int) -> list[int]:
        return [self.keys.take()[0] for _ in range(count)]


def test_held_move_key_moves_one_cell_every_tick() -> None:
    hands = Hands()
    hands.down(EAST)
    assert hands.ticks(4) == [EAST] * 4
    hands.up(EAST)
    assert hands.ticks(2) == [STAY, STAY]


def test_tap_shorter_than_a_tick_counts_exactly_once() -> None:
    hands = Hands()
    hands.tap(WEST)
    assert hands.ticks(3) == [WEST, STAY, STAY]


def test_tap_whose_key_is_still_held_counts_once_for_its_tick() -> None:
    hands = Hands()
    hands.down(EAST)
    assert hands.ticks(1) == [EAST]
    hands.up(EAST)
    assert hands.ticks(1) == [STAY]


def test_interact_never_repeats() -> None:
    hands = Hands()
    hands.down(INTERACT)
    assert hands.ticks(3) == [INTERACT, STAY, STAY]


def test_turn_and_use_within_one_tick_are_done_in_this_order() -> None:
    hands = Hands()
    hands.tap(NORTH)
    hands.tap(INTERACT)
    assert hands.ticks(3) == [NORTH, INTERACT, STAY]


def test_use_and_turn_within_one_tick_are_done_in_this_order() -> None:
    hands = Hands()
    hands.tap(INTERACT)
    hands.tap(NORTH)
    assert hands.ticks(3) == [INTERACT, NORTH, STAY]


def test_using_while_walking_continues_walking_afterwards() -> None:
    hands = Hands()
    hands.down(EAST)
    hands.ticks(1)
    hands.tap(INTERACT)
    assert hands.ticks(3) == [INTERACT, EAST, EAST]


def test_latest_of_several_taps_to_move_wins() -> None:
    hands = Hands()
    hands.tap(NORTH)
    hands.tap(WEST)
    assert hands.ticks(2) == [WEST, STAY]


def test_key_pressed_over_another_wins_until_released() -> None:
    hands = Hands()
    hands.down(NORTH)
    hands.ticks(1)
    hands.down(EAST)
    assert hands.ticks(2) == [EAST, EAST]
    hands.up(EAST)
    assert hands.ticks(1) == [NORTH]


def test_cleared_keys_do_nothing_until_pressed_again() -> None:
    hands = Hands()
    hands.down(EAST)
    hands.tap(INTERACT)
    hands.keys.clear()
    assert hands.ticks(2) == [STAY, STAY]


def test_press_that_decided_is_named() -> None:
    hands = Hands()
    hands.down(EAST)
    hands.ticks(1)
    hands.tap(INTERACT)
    action, press = hands.keys.take()
    assert action == INTERACT
    assert press is not None
    assert press.seq == 1
    _, press = hands.keys.take()
    assert press is not None
    assert press.seq == 0


def test_taps_during_a_pause_are_forgotten_but_held_keys_count_later() -> None:
    keys = Keys()
    keys.press(Input(0, EAST, INTERACT, 0.0), 0.0, taps_count=False)
    assert [keys.take()[0], keys.take()[0]] == [EAST, EAST]


@pytest.mark.parametrize("seq", [5, 4, 0])
def test_repeated_and_older_messages_change_nothing(seq: int) -> None:
    keys = Keys()
    assert keys.press(Input(5, None, EAST, 0.0), 0.0)
    keys.take()
    assert not keys.press(Input(seq, WEST, INTERACT, 1.0), 1.0)
    assert keys.take() == (STAY, None)


MESSAGES = st.lists(
    st.one_of(
        st.none(),  # a tick
        st.tuples(st.integers(0, 30), st.none() | st.integers(0, 3), st.none() | st.sampled_from([0, 1, 2, 3, 5])),
    ),
    max_size=60,
)


@given(MESSAGES)
def test_never_more_actions_than_presses_and_nothing_piles_up(
    events: list[tuple[int, int | None, int | None] | None],
) -> None:
    keys = Keys()
    taps_taken = uses = 0
    taps_sent = uses_sent = 0
    held = None
    newest = -1
    for event in events:
        if event is None:
            action, press = keys.take()
            assert (press is None) == (action == STAY)
            uses += action == INTERACT
            taps_taken += action != STAY and action != held
            continue
        seq, now_held, tap = event
        fresh = keys.press(Input(seq, now_held, tap, 0.0), 0.0)
        assert fresh == (seq > newest)
        if fresh:
            newest, held = seq, now_held
            taps_sent += tap not in (None, STAY)
            uses_sent += tap == INTERACT
    assert uses <= uses_sent
    assert taps_taken <= taps_sent
    waiting = [keys.take()[0] for _ in range(2)]
    assert waiting.count(INTERACT) <= 1
    assert keys.take()[0] == (STAY if held is None else held)


@given(MESSAGES, st.integers(1, 3))
def test_duplicated_messages_change_nothing(
    events: list[tuple[int, int | None, int | None] | None], copies: int
) -> None:
    once, often = Keys(), Keys()
    for event in events:
        if event is None:
            (action, press), (other_action, other) = once.take(), often.take()
            assert action == other_action
            assert (press and press.seq) == (other and other.seq)
            continue
        keys = Input(*event, 0.0)
        once.press(keys, 0.0)
        for _ in range(copies):
            often.press(keys, 0.0)
