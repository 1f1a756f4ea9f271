"""The simulated participants: repeatable, limited to what a page shows, and trusting only arrows that prove right."""

import inspect
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import kitchenmind
from overcooked.constants import (
    DISH,
    FACING,
    INTERACT,
    NOTHING,
    ONION,
    ONION_DROP,
    PLAYERS,
    POTTING_ONION,
    READY,
    STAY,
    STEP_X,
    STEP_Y,
)
from overcooked.layout import Layout, layout_names, load_layout, parse_layout
from overcooked.state import Kitchens
from server.bots.cook import COOKS, Cook, Traits, layouts_without_human_bc
from server.bots.foresight import mind as mind_module
from server.bots.foresight.beliefs import FRAMES
from server.bots.foresight.cook import ForesightCook, cook
from server.bots.foresight.kitchen_map import FAR, kitchen_map
from server.bots.foresight.mind import chance
from server.bots.foresight.participants import NO_ARROW, SimulatedParticipants
from server.bots.foresight.people import ARROWS, FITTED, MIND, Variant, person
from server.bots.game_client import BotGame, Journal
from server.play.randomness import uniform
from tests.support.browser.fake_game_server import welcome

STUDY = Path(__file__).parents[3] / "studies" / "external_predictor.yaml"
RING = load_layout("coordination_ring")
CRAMPED = load_layout("cramped_room")
STILL = (STAY, STAY)
# A participant who never rests, slips or hesitates, so that actions reveal beliefs.
SHARP = replace(
    FITTED, act_after_action=99, act_after_rest=99, spread=0, pause=0, slip=(0, 0), temperature=0.01, yields=1.0
)


def alone(layout: Layout, seed: int = 1, seat: int = 0, variant: Variant | None = None) -> SimulatedParticipants:
    return SimulatedParticipants(layout, [person(seed, seat, variant or Variant(parameters=SHARP, delay=1))])


def moved(kitchens: Kitchens, first: int, second: int = STAY) -> NDArray[np.int64]:
    """Play a timestep; the actions as `act` takes them."""
    actions = np.array([[first, second]])
    kitchens.step(actions, np.zeros((1, PLAYERS), np.int32))
    return actions.astype(np.int64)


def played(layout: Layout, traits: Traits, timesteps: int = 120, arrows: tuple[int, ...] = ()) -> list[int]:
    """The actions of one cook next to a chef who stands still."""
    kitchens, one, done = Kitchens.start(layout), cook(layout, 0, traits, 5), []
    actions = STILL
    for _ in range(timesteps):
        action = one.act(kitchens.copy(), 0, actions, arrows, 400)
        moved(kitchens, action)
        actions = (action, STAY)
        done.append(action)
    return done


def test_chance_is_the_chance_of_the_game() -> None:
    for seed, timestep, purpose in ((0, 0, 0), (2**63 - 1, 399, 201), (12345, 7, 202)):
        assert chance(seed, timestep, purpose) == uniform(seed, timestep, purpose)


@pytest.mark.parametrize("name", COOKS)
def test_every_cook_acts_alike_when_repeated_and_others_act_otherwise(name: str) -> None:
    traits = Traits.drawn(4, name)  # type: ignore[arg-type]
    assert played(RING, traits) == played(RING, traits)
    assert played(RING, traits) != played(RING, Traits.drawn(5, name))  # type: ignore[arg-type]


def test_a_participant_is_the_same_person_in_every_condition() -> None:
    """Arrows only change beliefs: before the first one is seen, all act alike."""
    with_arrows, without = (played(RING, Traits.drawn(9), 2, arrows) for arrows in ((1, 1, 1), ()))
    assert with_arrows[:1] == without[:1]
    assert person(9, 0, Variant()) == person(9, 0, Variant())


def test_traits_name_the_cook() -> None:
    kinds = {name: type(cook(RING, 0, Traits.drawn(1, name), 0)) for name in COOKS}
    assert kinds == {"foresight": ForesightCook, "credulous": ForesightCook, "planner": Cook, "clone": Cook}


def test_a_person_notices_as_late_at_any_length_of_a_timestep() -> None:
    for seed in range(20):
        delays = {tick_ms: int(person(seed, 0, Variant(), tick_ms)["delay"][0]) for tick_ms in (20, 100, 200, 600)}
        assert delays[100] in (2 * delays[200] - 1, 2 * delays[200], 2 * delays[200] + 1)
        assert delays[600] == 1
        assert delays[20] <= FRAMES - 2, "no later than what is remembered"
    fast, slow = (cook(RING, 0, Traits.drawn(7, tick_ms=tick_ms), 1) for tick_ms in (50, 200))
    assert isinstance(fast, ForesightCook)
    assert isinstance(slow, ForesightCook)
    assert fast._participant.minds["delay"][0] > slow._participant.minds["delay"][0]


def test_a_state_that_is_shown_again_gets_the_same_action_and_is_counted_once() -> None:
    kitchens = Kitchens.start(RING)
    one, two = (cook(RING, 0, Traits.drawn(3), 1) for _ in range(2))
    actions = STILL
    for _ in range(60):
        first = one.act(kitchens.copy(), 0, actions, (0, 0, 0), 400)
        assert one.act(kitchens.copy(), 0, actions, (0, 0, 0), 400) == first
        assert two.act(kitchens.copy(), 0, actions, (0, 0, 0), 400) == first
        moved(kitchens, first)
        actions = (first, STAY)


def test_a_lost_connection_loses_only_what_was_not_seen() -> None:
    kitchens, one = Kitchens.start(RING), cook(RING, 0, Traits.drawn(3), 1)
    one.act(kitchens.copy(), 0, STILL, (), 400)
    kitchens.timestep += 57
    assert 0 <= one.act(kitchens.copy(), 0, STILL, (), 400) <= INTERACT


@pytest.mark.parametrize("name", layout_names())
def test_somebody_alone_cooks_in_every_kitchen(name: str) -> None:
    """Onions get into pots; in Forced Coordination, where there is no way to one, onto counters within reach."""
    layout, seat = load_layout(name), int(name == "forced_coordination")
    kitchens, events = Kitchens.start(layout), np.zeros((1, PLAYERS), np.int32)
    if seat == 0:
        kitchens.players[0, 1, :2] = (0, 0)  # out of the way
    one, actions, used = alone(layout, seat=seat), np.array([STILL]), 0
    for _ in range(200):
        action = int(one.act(kitchens, actions, np.full((1, ARROWS), NO_ARROW))[0])
        actions = np.array([[action, STAY] if seat == 0 else [STAY, action]])
        kitchens.step(actions, events)
        used += bool(events[0, seat] & (ONION_DROP if seat else POTTING_ONION))
    assert used >= 3


def test_the_map_counts_the_ticks_that_the_rules_need() -> None:
    """Following the first actions, a chef faces the station after as many ticks as the map says."""
    for name in ("matrix", "double_rings", "counter_circuit"):
        layout = load_layout(name)
        known = kitchen_map(layout)
        for station in range(len(known.kind)):
            kitchens = Kitchens.start(layout)
            kitchens.players[0, 1, :2] = (0, 0)  # out of the way
            cell = int(kitchens.players[0, 0, 0]) * layout.height + int(kitchens.players[0, 0, 1])
            ticks = int(known.reach[station, cell, 0])
            assert 0 <= ticks < FAR
            for left in range(ticks, 0, -1):
                x, y, facing, _ = kitchens.players[0, 0].tolist()
                assert known.reach[station, x * layout.height + y, facing] == left
                moved(kitchens, int(known.first[station, x * layout.height + y, facing]))
            x, y, facing, _ = kitchens.players[0, 0].tolist()
            assert (x + STEP_X[facing]) * layout.height + y + STEP_Y[facing] == known.cell[station]


def trust(shown_right: bool, timesteps: int = 60) -> tuple[float, float]:
    """(how far arrows are trusted, how far the own guess) after a game in which the partner walks back and forth."""
    kitchens, one = Kitchens.start(RING), alone(RING)
    actions = np.array([STILL])
    for timestep in range(timesteps):
        steps = [(2, 3)[(timestep + k) % 2] for k in range(ARROWS)]
        shown = steps if shown_right else [STAY] * ARROWS
        one.act(kitchens, actions, np.array([shown]))
        actions = moved(kitchens, STAY, steps[0])
    mind = one.minds[0]
    return (mind["arrow_hits"] + 3) / (mind["arrow_count"] + 4), (mind["guess_hits"] + 1) / (mind["guess_count"] + 2)


def test_arrows_that_come_true_are_trusted_and_others_are_not() -> None:
    right, _ = trust(True)
    wrong, guess = trust(False)
    assert right > 0.95
    assert wrong < 0.15
    assert wrong <= guess + 0.15


def walks_up(arrow: int) -> float:
    """The probability of walking up into the corner (3, 1), towards the pots, while the partner next to it at (2, 1) is
    said to walk there (2, east) or away from it (3, west)."""
    kitchens = Kitchens.start(RING)
    kitchens.players[0, 0] = (3, 2, 0, ONION)
    kitchens.players[0, 1] = (2, 1, 2, NOTHING)
    one = alone(RING, 2, variant=Variant(parameters=SHARP, delay=1, credulous=True))
    for _ in range(3):
        one.act(kitchens, np.array([STILL]), np.array([[arrow] * ARROWS]))
        kitchens.timestep += 1
    return float(one.probabilities[0, 0])


def test_an_arrow_into_the_next_cell_keeps_a_participant_from_walking_into_it() -> None:
    assert walks_up(2) < 0.1
    assert walks_up(3) > 0.9


def test_a_participant_who_blocks_the_partner_makes_room() -> None:
    kitchens = Kitchens.start(RING)
    kitchens.players[0, 0] = (1, 1, 0, NOTHING)
    kitchens.players[0, 1] = (2, 1, 3, NOTHING)
    kitchens.contents[0, 3, 0] = kitchens.contents[0, 4, 1] = READY - 10
    stays = []
    for arrow in (3, 4):
        one = SimulatedParticipants(RING, [person(2, 0, Variant(parameters=SHARP, delay=1, credulous=True))])
        now = kitchens.copy()
        for _ in range(3):
            one.act(now, np.array([STILL]), np.array([[arrow] * ARROWS]))
            now.timestep += 1
        stays.append(float(one.probabilities[0, STAY]))
    assert stays[0] <= stays[1]


def probabilities(layout: Layout, own: tuple[int, ...], partner: tuple[int, ...], pots: int) -> NDArray[np.float64]:
    """What somebody does in this place (x, y, facing, held) after the partner stood there for some timesteps."""
    kitchens = Kitchens.start(layout)
    one = alone(layout, variant=Variant(parameters=SHARP, delay=1, repeats=True))
    kitchens.players[0] = (own, partner)
    for x, y in layout.pots:
        kitchens.contents[0, x, y] = pots
    for _ in range(3):
        one.act(kitchens, np.array([STILL]), np.full((1, ARROWS), NO_ARROW))
        kitchens.timestep += 1
    return one.probabilities[0]


def test_a_participant_who_waits_for_a_soup_does_not_move() -> None:
    own, away = (2, 1, 0, DISH), (1, 2, 1, NOTHING)
    waits, lifts = (probabilities(CRAMPED, own, away, inside) for inside in (READY - 10, READY))
    assert waits[STAY] > 0.8
    assert lifts[INTERACT] > 0.8


@pytest.mark.parametrize(("partner", "goes"), [((1, 1, 2, ONION), False), ((1, 1, 2, DISH), True)])
def test_somebody_lets_a_partner_who_is_as_near_use_the_only_cell_first(partner: tuple[int, ...], goes: bool) -> None:
    """The partner stands still, and carries an onion to the same pot, or a dish, for which there is no soup yet."""
    west = probabilities(CRAMPED, (3, 1, 3, ONION), partner, 0)[3]
    assert (west > 0.8) if goes else (west < 0.2)


def test_nobody_sees_the_partner_earlier_than_its_delay() -> None:
    """Two games that differ in the last two timesteps of the partner only: somebody with a delay of 3 acts alike."""
    chances = []
    for late in (STAY, 1):
        kitchens, one = Kitchens.start(RING), alone(RING, variant=Variant(parameters=SHARP, delay=3))
        actions = np.array([STILL])
        for timestep in range(6):
            one.act(kitchens, actions, np.full((1, ARROWS), NO_ARROW))
            actions = moved(kitchens, STAY, late if timestep >= 4 else STAY)
        one.act(kitchens, actions, np.full((1, ARROWS), NO_ARROW))
        chances.append(one.probabilities.copy())
    assert kitchens.players[0, 1, FACING] == 1
    np.testing.assert_array_equal(*chances)


def test_probabilities_are_probabilities() -> None:
    kitchens = Kitchens.start(RING, 8)
    everybody = SimulatedParticipants(RING, [person(seed, seed % 2, Variant()) for seed in range(8)])
    actions, draws = np.full((8, PLAYERS), STAY, np.int64), np.random.default_rng(1)
    for _ in range(100):
        done = everybody.act(kitchens, actions, draws.integers(6, size=(8, ARROWS)))
        np.testing.assert_allclose(everybody.probabilities.sum(1), 1)
        assert (everybody.probabilities >= 0).all()
        others = draws.integers(6, size=8)
        actions = np.where(np.arange(8)[:, None] % 2 == np.arange(2), done[:, None], others[:, None]).astype(np.int64)
        kitchens.step(actions, np.zeros((8, PLAYERS), np.int32))


def test_many_at_once_act_as_each_alone() -> None:
    people = [person(seed, 0, Variant()) for seed in range(4)]
    together, single = SimulatedParticipants(RING, people), [SimulatedParticipants(RING, [one]) for one in people]
    kitchens, none = Kitchens.start(RING, 4), np.full((4, ARROWS), NO_ARROW)
    actions = np.full((4, PLAYERS), STAY, np.int64)
    for _ in range(50):
        done = together.act(kitchens, actions, none)
        for k, one in enumerate(single):
            now = Kitchens(RING, kitchens.players[[k]], kitchens.contents[[k]], kitchens.timestep[[k]])
            assert one.act(now, actions[[k]], none[[k]])[0] == done[k]
        actions = np.stack([done, np.full(4, STAY)], 1)
        kitchens.step(actions, np.zeros((4, PLAYERS), np.int32))


def test_a_simulated_participant_does_not_know_its_condition() -> None:
    """The input of a participant is that of its page: state, actions, arrows."""
    assert [*inspect.signature(mind_module.think.py_func).parameters] == [
        "kitchen", "mind", "memory", "players", "contents", "now", "actions", "arrows", "out",
    ]  # fmt: skip
    assert not {"condition", "agent"} & set(MIND.names or ())


CLASSIC = ("cramped_room", "asymmetric_advantages", "coordination_ring", "forced_coordination", "counter_circuit")


@pytest.mark.parametrize("layout", CLASSIC)
def test_a_behaviour_cloned_human_plays_like_recorded_people_in_each_classic_kitchen(layout: str) -> None:
    kitchen = load_layout(layout)
    assert not layouts_without_human_bc([kitchen])
    assert layouts_without_human_bc([parse_layout(load_layout("matrix").text, layout)]) == [layout], "another grid"
    acts = {name: played(kitchen, Traits.drawn(4, name), 40, ()) for name in ("clone", "planner")}
    assert acts["clone"] != acts["planner"]


def test_bots_report_a_kitchen_without_a_behaviour_cloned_human() -> None:
    """For a server whose study file is not here, this cannot be checked before."""
    journal = Journal()
    game = BotGame("ws://nowhere/s/x/socket", "", journal, Traits.drawn(1, "clone"))
    for layout in ("coordination_ring", "double_rings"):
        message = welcome(layout=layout, grid=load_layout(layout).grid, episode=layout)
        game._take_in(message)
        game._begin(message)
    assert journal.violations == [
        "--cook clone: there is no behaviour-cloned human for double_rings. Use --cook foresight."
    ]


def test_a_missing_behaviour_cloned_human_is_an_error_with_the_remedy(capsys: pytest.CaptureFixture[str]) -> None:
    """Double Rings has no recorded games of people."""
    assert kitchenmind.main(["bots", "2", "--cook", "clone", "--study", str(STUDY)]) == 2
    said = capsys.readouterr().err
    assert "no behaviour-cloned human for double_rings, double_counters, matrix, clear_division" in said
    assert "--cook foresight" in said
