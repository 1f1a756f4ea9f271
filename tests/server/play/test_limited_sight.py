"""Limited sight: a frame contains only what the participant sees and remembers."""

from dataclasses import replace

import pytest

from overcooked.constants import EAST, INTERACT, NORTH, SOUTH, STAY, WEST
from overcooked.layout import parse_layout
from server.play import messages
from server.play.limited_sight import Sight
from server.play.marks import NOTHING_SHOWN
from server.play.messages import KitchenState
from server.play.session import Session
from tests.support.live_fakes import RuleModels, make_spec, new_record

CORRIDOR = """
XXXXXXXXXXX
O1       2P
XXXXDXXXXSX
""".strip()
LAYOUT = parse_layout(CORRIDOR, "corridor")
OPACITIES = (95, 80, 60)


def state(own: int, other: int, **more: object) -> KitchenState:
    """Both chefs in the corridor, at these columns."""
    fields = {"counters": (), "pots": (), "score": 0, "soups": 0, **more}
    return KitchenState(t=1, players=((own, 1, EAST, 0), (other, 1, WEST, 1)), **fields)  # type: ignore[arg-type]


def looked(*states: KitchenState, radius: int = 2) -> Sight:
    sight = Sight(LAYOUT, 0, radius)
    for each in states:
        sight.look(each)
    return sight


@pytest.mark.parametrize(("column", "row", "seen"), [(3, 1, True), (3, 3, True), (4, 1, False), (1, 4, False)])
def test_the_view_is_a_square_around_the_own_chef(column: int, row: int, seen: bool) -> None:
    assert looked(state(1, 9)).sees(column, row) == seen


def test_a_chef_out_of_view_is_not_in_the_message() -> None:
    near, far = state(1, 3), state(1, 4)
    assert looked(near).masked(near) == near
    masked = looked(far).masked(far)
    assert masked.players == ((1, 1, EAST, 0), (1, 1, NORTH, 0))


def test_contents_stay_as_last_seen_and_those_never_seen_are_left_out() -> None:
    pot, counter = (10, 1, 2, -1), (8, 0, 1)
    first = state(1, 2, pots=(pot,), counters=(counter,))
    sight = looked(first)
    assert sight.masked(first).pots == sight.masked(first).counters == ()
    assert (10, 1) in sight.unknown
    close = state(8, 2, pots=(pot,), counters=(counter,))
    sight.look(close)
    assert (sight.masked(close).pots, sight.masked(close).counters) == ((pot,), (counter,))
    cooking = state(1, 2, pots=((10, 1, 3, 7),))
    sight.look(cooking)
    assert (sight.masked(cooking).pots, sight.masked(cooking).counters) == ((pot,), (counter,)), "as last seen"
    assert (10, 1) not in sight.unknown
    back = state(8, 2, pots=((10, 1, 3, 9),))
    sight.look(back)
    assert (sight.masked(back).pots, sight.masked(back).counters) == (((10, 1, 3, 9),), ())


def test_marks_are_cut_behind_the_step_that_leaves_the_view() -> None:
    sight = looked(state(1, 2))
    shown = tuple(zip((EAST, EAST, INTERACT), OPACITIES, strict=True))
    assert [action for action, _ in sight.cut(shown, state(1, 2))] == [EAST, EAST, NOTHING_SHOWN]
    against_a_wall = tuple(zip((NORTH, STAY, SOUTH), OPACITIES, strict=True))
    assert sight.cut(against_a_wall, state(1, 2)) == against_a_wall


def played(radius: int, timesteps: int = 12, **changes: object) -> tuple[Session, list[tuple[messages.Tick, str]]]:
    """A session in the corridor, with a scripted partner: each frame, and the whole state's hash."""
    fields = {"grid": CORRIDOR, "layout": "corridor", "view_radius": radius, **changes}
    session = Session(new_record(make_spec(**fields)), 0.0)
    frames = []
    questions = session.begin_start()
    for _ in range(timesteps):
        session.finish_tick([RuleModels().decide(one) for one in questions], 1.0)
        frames.append((session.tick_message(0), session.simulation.hash()))
        questions = session.begin_tick(0.0)
    return session, frames


def test_nothing_about_a_partner_out_of_view_reaches_the_browser() -> None:
    """Two games that differ in what the partner does out of view send the same bytes."""
    _, one = played(2, seed=1)
    _, other = played(2, seed=2)
    pairs = list(zip(one, other, strict=True))
    hidden = [(mine, its) for mine, its in pairs if not mine[0].partner_seen and not its[0].partner_seen]
    assert any(mine[1] != its[1] for mine, its in hidden), "the games differ"
    assert all(messages.encode(mine[0]) == messages.encode(its[0]) for mine, its in hidden)
    assert not any(action != NOTHING_SHOWN for mine, _ in hidden for action, _ in mine[0].prediction)


def test_marks_are_due_only_while_the_partner_is_in_view() -> None:
    session, frames = played(2)
    assert session.record is not None
    assert session.record.in_sight is False
    assert session.frames.violations == 0
    near, _ = played(9)
    assert near.record is not None
    assert near.record.in_sight is True
    whole, _ = played(0)
    assert whole.record is not None
    assert whole.record.in_sight is None
    assert {frame.partner_seen for frame, _ in frames} == {False}


def test_a_page_that_is_loaded_again_and_a_server_that_is_started_again_know_the_same() -> None:
    session, _ = played(2)
    welcome = session.welcome(0)
    assert (welcome.view_radius, welcome.partner_seen) == (2, False)
    actions = [frame.actions for frame, _ in played(0)[1]][1:]
    record = replace(new_record(session.spec), joint_actions=tuple(actions[:5]), last_hash=played(0, 6)[1][-1][1])
    restarted = Session(record, 0.0).welcome(0)
    frame = played(2, 6)[1][-1][0]
    assert (restarted.state, restarted.partner_seen, restarted.unknown) == (frame.state, False, frame.unknown)


def test_both_people_of_a_round_have_a_view_of_their_own() -> None:
    session = Session(
        new_record(make_spec(grid=CORRIDOR, layout="corridor", view_radius=2, agents=(None, None), predictor=None)), 0.0
    )
    assert session.welcome(0).state.players[0][:2] == (1, 1)
    assert session.welcome(1).state.players == ((9, 1, NORTH, 0), (9, 1, NORTH, 0))
