"""One episode without clock or socket: actions, questions to models, records, messages and pauses."""

import numpy as np
import pytest
from msgspec import structs

from overcooked.constants import EAST, INTERACT, NORTH, SOUTH, STAY, WEST
from overcooked.layout import load_layout
from overcooked.state import Kitchens
from server.play.episode_spec import EpisodeSpec
from server.play.messages import Input, encode
from server.play.recorder import TickRecord
from server.play.session import ReplayMismatch, Session
from tests.support.live_fakes import MemoryRecorder, make_spec, new_record
from tests.support.played_session import MODELS, press, start, tick


def test_start_state_is_tick_0_and_carries_no_action() -> None:
    session, record = start()
    assert record.timestep == 0
    assert record.actions is None
    assert record.state_hash == Kitchens.start(load_layout("coordination_ring")).hash()
    assert len(record.prediction) == 3
    assert session.simulation.timestep == 0


def test_episode_of_40_timesteps_makes_ticks_0_to_40_that_replay_to_their_hashes() -> None:
    session, first = start()
    records = [first]
    while not session.over:
        press(session, len(records), None, (NORTH, EAST, INTERACT)[len(records) % 3])
        records.append(tick(session))
    assert [record.timestep for record in records] == list(range(41))
    again = Kitchens.start(load_layout("coordination_ring"))
    for record in records:
        if record.actions is not None:
            again.step(np.array([record.actions], np.int8), np.zeros((1, 2), np.int32))
        assert again.hash() == record.state_hash


def test_partner_does_what_was_decided_on_the_state_before() -> None:
    session, before = start()
    for _ in range(10):
        record = tick(session)
        assert record.actions is not None
        assert record.actions[1] == before.next_actions[1]
        before = record


def test_question_sees_the_state_and_the_joint_action_that_led_to_it_but_not_the_next_action() -> None:
    session, _ = start()
    press(session, 0, None, EAST)
    questions = session.begin_tick(session.next_deadline)
    (question,) = questions
    assert (question.seat, question.timestep, question.agent) == (1, 1, "sp")
    history = question.history(10)
    assert len(history.contents) == 2 * 5 * 5
    actions = np.frombuffer(history.actions, np.int8).reshape(-1, 2).tolist()
    assert actions[0] == [-1, -1]
    assert actions[1][1] == EAST  # own action of the watched agent first
    assert question.left == session.spec.horizon - 1


def test_late_partner_waits_and_the_tick_records_it() -> None:
    session, _ = start()
    record = tick(session, models_ms=500.0)
    assert record.late
    assert record.next_actions == (None, None)
    assert record.prediction == ()
    following = tick(session)
    assert following.actions is not None
    assert following.actions[1] == STAY


@pytest.mark.parametrize(("shown", "broken"), [("predictor", 2), ("random", 0), ("nothing", 0)])
def test_timesteps_whose_display_is_not_what_the_condition_requires_are_counted(shown: str, broken: int) -> None:
    session, _ = start(make_spec(shown=shown))
    for late in (False, True, True, False):
        tick(session, models_ms=1000.0 if late else 1.0)
    assert session.frames.violations == session.frames.late_violations == broken


def test_a_missing_prediction_of_models_that_were_in_time_is_not_called_lateness() -> None:
    session, _ = start(make_spec(shown="predictor"))
    tick(session)
    (question,) = session.begin_tick(session.next_deadline)
    session.finish_tick([structs.replace(MODELS.decide(question), prediction=())], 1.0)
    assert (session.frames.violations, session.frames.late_violations) == (1, 0)


def test_the_last_state_shows_nothing_and_is_no_violation() -> None:
    session, _ = start(make_spec(horizon=3))
    while not session.over:
        tick(session)
    assert session.frames.violations == 0


def test_nonsense_action_of_a_model_counts_as_no_answer() -> None:
    session, _ = start()
    questions = session.begin_tick(session.next_deadline)
    good = MODELS.decide(questions[0])
    record = session.finish_tick([type(good)(9, good.probabilities, good.prediction)], 1.0)
    assert record.late
    assert record.next_actions == (None, None)


def test_key_record_names_the_input_that_decided_and_when_it_came() -> None:
    session, _ = start(now=50.0)
    tick(session)
    press(session, 7, None, EAST, now=50.25)
    record = tick(session)
    (key,) = record.keys
    assert (key.seat, key.seq, key.client_ms) == (0, 7, 7.0)
    assert key.received_ms == pytest.approx(250.0)
    assert record.scheduled_ms == 400.0


def test_lateness_is_measured_and_the_next_deadline_does_not_move() -> None:
    session, _ = start(now=0.0)
    record = tick(session, now=0.35)
    assert record.late_ms == pytest.approx(150.0)
    assert session.next_deadline == pytest.approx(0.4)


def test_400_timesteps_end_exactly_80_s_after_the_countdown() -> None:
    session, _ = start(make_spec(horizon=400), now=1000.0)
    while True:
        deadline = session.next_deadline
        tick(session)
        if session.over:
            break
    assert deadline == pytest.approx(1080.0, abs=1e-6)


def stored_half() -> tuple[MemoryRecorder, EpisodeSpec, list[TickRecord]]:
    spec = make_spec()
    session, first = start(spec)
    records = [first]
    for number in range(20):
        press(session, number, None, (WEST, INTERACT, SOUTH, EAST)[number % 4])
        records.append(tick(session))
    recorder = MemoryRecorder()
    recorder.ticks_of["e1"] = {record.timestep: record for record in records}
    return recorder, spec, records


def test_restarted_episode_stands_where_it_stood_and_its_partner_does_what_was_decided() -> None:
    recorder, spec, records = stored_half()
    session = Session(recorder.load(spec), 0.0)
    assert session.phase == "paused"
    assert session.simulation.timestep == 20
    assert session.simulation.hash() == records[-1].state_hash
    assert session.frames.displayed == records[-1].displayed
    assert session.welcome(0).resumed
    assert session.pause_reasons.left_s(1e6) is None
    session.release(0, 1.0)
    session.count_down(1.0, 4.0)
    record = tick(session)
    assert record.timestep == 21
    assert record.actions is not None
    assert record.actions[1] == records[-1].next_actions[1]


def test_restart_does_not_change_what_is_decided_afterwards() -> None:
    recorder, spec, _ = stored_half()
    through, _ = start(spec)
    for number in range(20):
        press(through, number, None, (WEST, INTERACT, SOUTH, EAST)[number % 4])
        tick(through)
    restarted = Session(recorder.load(spec), 0.0)
    restarted.release(0, 1.0)
    restarted.count_down(1.0, 4.0)
    for _ in range(20):
        one, other = tick(through), tick(restarted)
        assert (one.actions, one.state_hash, one.displayed) == (other.actions, other.state_hash, other.displayed)


def test_damaged_record_is_not_played_on() -> None:
    recorder, spec, _ = stored_half()
    record = recorder.load(spec)
    wrong = type(record)(**{**record.__dict__, "joint_actions": ((STAY, STAY), *record.joint_actions[1:])})
    with pytest.raises(ReplayMismatch, match="timestep 20"):
        Session(wrong, 0.0)


def test_conditions_cost_the_same_bytes_and_record_the_same_predictions() -> None:
    frames: dict[str, list[int]] = {}
    predictions = {}
    for shown in ("nothing", "random", "predictor"):
        session, record = start(make_spec(shown=shown))
        predictions[shown] = record.prediction
        frames[shown] = [len(encode(session.tick_message(0)))]
        for _ in range(20):
            tick(session)
            frames[shown].append(len(encode(session.tick_message(0))))
    assert frames["nothing"] == frames["random"] == frames["predictor"]
    assert predictions["nothing"] == predictions["random"] == predictions["predictor"]


def test_last_state_calls_no_model_and_shows_nothing() -> None:
    session, _ = start(make_spec(horizon=3))
    asked = len(MODELS.asked)
    records = [tick(session) for _ in range(3)]
    assert session.over
    assert len(MODELS.asked) == asked
    assert records[-1].prediction == ()
    assert {action for action, _ in records[-1].displayed} == {6}
    result = session.result()
    assert (result.status, result.reason, result.passed) == ("done", "horizon", True)
    assert result.final_hash == records[-1].state_hash


def test_frame_counts_inputs_that_had_arrived() -> None:
    session, _ = start()
    assert session.tick_message(0).applied == -1
    press(session, 4, None, EAST)
    tick(session)
    assert session.tick_message(0).applied == 4


def test_two_people_each_move_their_chef_and_a_predictor_may_watch_one() -> None:
    session = Session(new_record(make_spec(agents=(None, None))), 0.0)
    assert session.people == (0, 1)
    assert not session.release(0, 0.0)
    assert session.release(1, 0.0)
    session.count_down(0.0, 0.0)
    (question,) = session.begin_start()
    assert (question.seat, question.agent, question.predictor) == (1, None, "sp_predictor_window")
    session.finish_tick([MODELS.decide(question)], 1.0)
    session.stored = True
    session.key(0, Input(0, None, EAST, 0.0), 0.1)
    session.key(1, Input(0, None, SOUTH, 0.0), 0.1)
    assert tick(session).actions == (EAST, SOUTH)


def test_two_agents_play_before_a_viewer() -> None:
    session = Session(new_record(make_spec(kind="watch", agents=("sp", "sp"))), 0.0)
    assert session.people == (-1,)
    assert session.release(-1, 0.0)
    session.count_down(0.0, 0.0)
    assert [question.seat for question in session.begin_start()] == [0, 1]
    record = session.finish_tick([MODELS.decide(question) for question in session._asked], 1.0)
    assert None not in record.next_actions
    assert session.welcome(-1).seat == -1
