"""What is drawn of an intention in each condition: decided once, stored, and of the same length everywhere."""

from collections import Counter

import pytest

from models.protocols import Decision, Intention
from overcooked.interactions import InteractionKind, possible_interactions
from overcooked.layout import load_layout
from server.play.intentions import NO_INTENTION_SHOWN, display, wrong_intention
from server.play.marks import NOTHING_SHOWN
from server.play.messages import Input, encode
from server.play.session import Session
from tests.support.live_fakes import INTENTIONS, RuleModels, make_spec, new_record

LAYOUT = load_layout("coordination_ring")
LIKELIEST, RUNNER_UP = INTENTIONS
NOTHING = Intention(InteractionKind.NONE, -1, -1, 0, 0.6)


def played(timesteps: int = 3, **changes: object) -> list[tuple[Session, int]]:
    """A session after each of its first timesteps, with the length of its frame."""
    session = Session(new_record(make_spec(**changes)), 0.0)
    found, questions = [], session.begin_start()
    for _ in range(timesteps):
        decisions: list[Decision | None] = [RuleModels().decide(one) for one in questions]
        session.finish_tick(decisions, 1.0)
        found.append((session, len(encode(session.tick_message(0)))))
        questions = session.begin_tick(0.0)
    return found


@pytest.mark.parametrize("shown_as", ["intention", "both"])
def test_the_likeliest_intention_is_sent_as_it_is_stored(shown_as: str) -> None:
    session, _ = played(1, display=shown_as)[0]
    assert session.record is not None
    frame = session.tick_message(0)
    assert frame.intention == session.record.displayed_intention == (*LIKELIEST_PLACE, 95)
    assert session.record.intentions == INTENTIONS
    assert (frame.prediction[0][0] != NOTHING_SHOWN) == (shown_as == "both")
    assert session.frames.violations == 0


LIKELIEST_PLACE = (LIKELIEST.kind, LIKELIEST.x, LIKELIEST.y)


@pytest.mark.parametrize("shown_as", ["actions", "none"])
def test_other_displays_record_the_intentions_and_send_none(shown_as: str) -> None:
    session, _ = played(1, display=shown_as, shown="nothing" if shown_as == "none" else "predictor")[0]
    assert session.record is not None
    assert session.record.intentions == INTENTIONS
    assert session.record.displayed_intention is None
    assert session.tick_message(0).intention[0] == NO_INTENTION_SHOWN


def test_frames_of_all_conditions_are_equally_long() -> None:
    spans = {"grid": load_layout("clear_division").text, "layout": "clear_division"}  # columns of one and two digits
    lengths = [
        [length for _, length in played(12, shown=shown, display=drawn, confidence_opacity=fades, **spans)]
        for shown in ("nothing", "random", "predictor")
        for drawn in ("actions", "intention", "both")
        for fades in (True, False)
    ]
    assert all(each == lengths[0] for each in lengths)


def test_random_intentions_are_uniform_over_what_the_kitchen_allows_and_stay_for_two_seconds() -> None:
    spec = make_spec(shown="random", display="intention")
    drawn = [display(spec, LAYOUT, timestep, ())[:3] for timestep in range(0, 30_000, 10)]
    possible = possible_interactions(LAYOUT)
    counts = Counter(drawn)
    assert set(counts) == {(int(kind), x, y) for kind, x, y in possible}
    assert max(counts.values()) < 2 * len(drawn) / len(possible)
    assert len({display(spec, LAYOUT, timestep, INTENTIONS)[:3] for timestep in range(40, 50)}) == 1
    other = make_spec(shown="random", display="intention", seed=2)
    assert [display(other, LAYOUT, timestep, ())[:3] for timestep in range(0, 200, 10)] != drawn[:20]


def test_a_misleading_round_shows_the_runner_up() -> None:
    session, _ = played(1, display="intention", misleading=True)[0]
    assert session.tick_message(0).intention[:3] == (RUNNER_UP.kind, RUNNER_UP.x, RUNNER_UP.y)
    assert session.record is not None
    assert session.record.misleading is True


@pytest.mark.parametrize("said", [(), (LIKELIEST,), (LIKELIEST, LIKELIEST), (LIKELIEST, NOTHING)])
def test_without_a_wrong_station_nobody_is_misled(said: tuple[Intention, ...]) -> None:
    assert wrong_intention(said) is None


def test_a_station_is_a_wrong_intention_where_nothing_is_the_likeliest() -> None:
    assert wrong_intention((NOTHING, RUNNER_UP)) == RUNNER_UP


def test_confidence_makes_an_unsure_intention_paler() -> None:
    spec = make_spec(display="intention", confidence_opacity=True)
    assert display(spec, LAYOUT, 1, (LIKELIEST,))[3] == round(95 * LIKELIEST.probability)


def test_with_on_key_an_intention_is_sent_only_while_it_is_asked_for() -> None:
    session = Session(new_record(make_spec(display="intention", show="on_key")), 0.0)
    found = []
    for down in (False, True):
        session.release(0, 0.0)
        session.count_down(0.0, 0.0)
        session.key(0, Input(2 + down, None, None, 0.0, down), 1.0)
        questions = session.begin_tick(1.0)
        session.finish_tick([RuleModels().decide(one) for one in questions], 1.0)
        found.append(session.tick_message(0).intention[0] != NO_INTENTION_SHOWN)
    assert found == [False, True]
    assert session.frames.violations == 0


def test_a_missing_intention_is_a_violation() -> None:
    session = Session(new_record(make_spec(display="intention")), 0.0)
    session.finish_tick([None for _ in session.begin_start()], 1.0)
    assert session.frames.violations == 1


def test_nobody_sees_an_intention_about_themselves() -> None:
    spec = make_spec(agents=(None, None), display="both")
    session = Session(new_record(spec), 0.0)
    questions = session.begin_start()
    session.finish_tick([RuleModels().decide(one) for one in questions], 1.0)
    assert [session.tick_message(seat).intention[0] for seat in (0, 1)] == [LIKELIEST.kind, NO_INTENTION_SHOWN]
    assert [session.welcome(seat).display for seat in (0, 1)] == ["both", "none"]
