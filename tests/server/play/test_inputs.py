"""The outcome of every input: it counts in one timestep, or the reason why not is stored."""

from collections.abc import Sequence

from hypothesis import given
from hypothesis import strategies as st

from overcooked.constants import EAST, INTERACT, NORTH, STAY
from server.play.keys import Keys
from server.play.messages import Input
from server.play.recorder import INPUT_OUTCOMES, InputRecord, StoredInputs
from server.play.session import Session
from tests.support.live_fakes import make_spec, new_record
from tests.support.played_session import AT, press, start, tick


def outcomes(records: Sequence[InputRecord]) -> list[tuple[int, int | None, str]]:
    return [(record.seq, record.timestep, record.outcome) for record in records]


def test_a_tick_has_every_input_that_came_before_it() -> None:
    session, _ = start()
    press(session, 0, None, NORTH)
    press(session, 1, None, EAST)  # a later tap to move takes the place of the first
    press(session, 2, None, None)
    press(session, 2, None, INTERACT)
    press(session, 3, EAST, None)
    record = tick(session)
    assert outcomes(record.inputs) == [
        (0, None, "replaced"),
        (1, 1, "applied"),
        (2, None, "unchanged"),
        (2, None, "repeated"),
    ]
    press(session, 4, None, None)
    assert outcomes(tick(session).inputs) == [(3, None, "replaced"), (4, 2, "released")]
    assert [one.number for one in record.inputs] == [1, 2, 3, 4]


def test_a_held_key_is_reported_once_with_the_first_timestep() -> None:
    session, _ = start()
    press(session, 0, EAST, EAST)
    assert outcomes(tick(session).inputs) == [(0, 1, "applied")]
    assert tick(session).inputs == ()
    assert [one.seq for one in tick(session).keys] == [0]


def test_inputs_discarded_by_a_pause_are_stored_with_the_pause() -> None:
    session, _ = start()
    press(session, 0, None, EAST)
    pause = session.pause(0, "blur", 101.0, AT)
    assert pause is not None
    assert outcomes(pause.inputs) == [(0, None, "forgotten")]
    session.key(0, Input(1, None, EAST, 1.0), 102.0)
    session.release(0, 103.0)
    over = session.count_down(103.0, 106.0)
    assert over is not None
    assert outcomes(over.inputs) == [(1, None, "stood_still")]
    assert over.inputs[0].received_ms is None


def test_late_inputs_are_reported_at_the_end() -> None:
    session, _ = start(make_spec(horizon=1))
    tick(session)
    press(session, 0, EAST, EAST)
    assert outcomes(session.result().inputs) == [(0, None, "ended")]


def test_a_move_held_before_the_start_counts_from_the_first_timestep() -> None:
    session = Session(new_record(make_spec()), 0.0)
    session.key(0, Input(0, EAST, EAST, 0.0), 0.5)
    session.release(0, 1.0)
    session.count_down(1.0, 4.0)
    session.finish_tick([None] * len(session.begin_start()), 1.0)
    session.stored = True
    actions = tick(session, 4.2).actions
    assert actions is not None
    assert actions[0] == EAST


def test_a_move_held_during_a_pause_counts_and_one_held_before_it_does_not() -> None:
    for held, wanted in ((None, STAY), (NORTH, NORTH)):
        session, _ = start()
        press(session, 0, EAST, None)
        session.pause(0, "blur", 101.0, AT)
        if held is not None:
            session.key(0, Input(1, held, held, 1.0), 102.0)
        session.release(0, 103.0)
        session.count_down(103.0, 106.0)
        first, second = tick(session).actions, tick(session).actions
        assert first is not None
        assert second is not None
        assert (first[0], second[0]) == (wanted, wanted)


def test_a_returning_page_continues_its_count_and_a_new_page_starts_at_zero() -> None:
    keys = Keys()
    keys.page("tab-0001", is_new=True)
    assert keys.press(Input(7, None, EAST, 0.0), 0.0)
    keys.page("tab-0001", is_new=False)
    assert not keys.press(Input(7, None, EAST, 0.0), 0.0), "a repeat after a lost connection"
    assert keys.take() == (STAY, None)
    keys.page("tab-0002", is_new=True)
    assert keys.press(Input(0, None, EAST, 0.0), 0.0)
    keys.page("tab-0001", is_new=False)  # takes the game back
    assert not keys.press(Input(7, None, EAST, 0.0), 0.0)
    keys.page("tab-0001", is_new=True)  # was loaded again
    assert keys.press(Input(0, None, EAST, 0.0), 0.0)


def test_a_repeat_after_a_restart_of_the_server_is_not_done_either() -> None:
    keys = Keys(StoredInputs(12, {"tab-0001": 7}))
    keys.page("tab-0001", is_new=False)
    assert not keys.press(Input(7, None, EAST, 0.0), 0.0)
    assert keys.press(Input(8, None, EAST, 0.0), 0.0)
    assert [one.number for one in (*keys.take_settled("e1", 0),)] == [13]


@given(
    st.lists(
        st.none()
        | st.just("pause")
        | st.tuples(st.integers(0, 9), st.none() | st.integers(0, 3), st.none() | st.sampled_from([0, 1, 2, 3, 5]))
    )
)
def test_every_input_is_reported_exactly_once_whatever_comes(events: list[object]) -> None:
    keys, told, sent, timestep = Keys(), [], 0, 0
    for event in events:
        if event is None:
            timestep += 1
            _, press_ = keys.take(timestep)
            assert press_ is None or press_.outcome == "applied"
        elif event == "pause":
            keys.clear()
        else:
            seq, held, tap = event  # type: ignore[misc]
            keys.press(Input(seq, held, tap, 0.0), 0.0)
            sent += 1
        told += keys.take_settled("e1", 0)
    keys.clear("ended")
    told += keys.take_settled("e1", 0)
    assert sorted(record.number for record in told) == list(range(1, sent + 1))
    assert {record.outcome for record in told} <= INPUT_OUTCOMES.keys()
    for record in told:
        assert (record.timestep is not None) == (record.outcome in ("applied", "released"))
