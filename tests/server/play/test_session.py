"""One episode without clock or socket: actions, questions to models, records, messages and pauses."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from msgspec import structs

from overcooked.constants import EAST, INTERACT, NORTH, SOUTH, STAY, WEST
from overcooked.layout import load_layout
from overcooked.state import Kitchens
from server.play.episode_spec import EpisodeSpec, PauseLimits
from server.play.messages import Input, encode
from server.play.recorder import TickRecord
from server.play.session import ReplayMismatch, Session
from tests.support.live_fakes import MemoryRecorder, RuleModels, make_spec, new_record

AT = datetime(2026, 1, 1, tzinfo=UTC)
MODELS = RuleModels()


def start(spec: EpisodeSpec | None = None, now: float = 100.0) -> tuple[Session, TickRecord]:
    """A session whose start state is stored and whose clock runs from `now`."""
    session = Session(new_record(spec or make_spec()), now)
    assert session.release(0, now)
    session.count_down(now, now)
    record = session.finish_tick([MODELS.decide(question) for question in session.begin_start()], 1.0)
    session.stored = True
    return session, record


def tick(session: Session, now: float | None = None, models_ms: float = 1.0) -> TickRecord:
    questions = session.begin_tick(session.next_deadline if now is None else now)
    is_late = models_ms > session.spec.deadline_ms
    record = session.finish_tick([None if is_late else MODELS.decide(question) for question in questions], models_ms)
    session.stored = True
    return record


def press(session: Session, seq: int, held: int | None, tap: int | None, now: float | None = None) -> None:
    session.key(0, Input(seq, held, tap, float(seq)), session.next_deadline - 0.1 if now is None else now)


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
