"""The kinds of interaction, and which of them a kitchen allows."""

import numpy as np

from overcooked.constants import EVENT_NAMES, INTERACT, STEP_X, STEP_Y
from overcooked.interactions import NO_INTERACTION, InteractionKind, interaction_kind, possible_interactions
from overcooked.layout import load_layout, parse_layout
from overcooked.state import Kitchens


def test_a_small_kitchen_allows_exactly_what_its_stations_offer() -> None:
    layout = parse_layout("XPX\nO1S\nX2D\nXXX")
    kinds = InteractionKind
    assert possible_interactions(layout) == (
        NO_INTERACTION,
        (kinds.TAKE_ONION, 0, 1),
        (kinds.TAKE_ONION, 0, 2),
        (kinds.TAKE_ONION, 1, 3),
        (kinds.TAKE_DISH, 0, 2),
        (kinds.TAKE_DISH, 1, 3),
        (kinds.TAKE_DISH, 2, 2),
        (kinds.TAKE_SOUP, 0, 2),
        (kinds.TAKE_SOUP, 1, 3),
        (kinds.FILL, 1, 0),
        (kinds.PLATE, 1, 0),
        (kinds.SERVE, 2, 1),
        (kinds.PUT_DOWN, 0, 2),
        (kinds.PUT_DOWN, 1, 3),
    )


def test_corners_that_nobody_can_face_are_left_out() -> None:
    cells = {(x, y) for _, x, y in possible_interactions(load_layout("coordination_ring"))}
    assert (0, 0) not in cells
    assert (0, 1) in cells


def test_every_event_of_the_engine_has_a_kind() -> None:
    kinds = {name: interaction_kind(1 << bit) for bit, name in enumerate(EVENT_NAMES)}
    assert kinds["onion_pickup"] is InteractionKind.TAKE_ONION
    assert kinds["soup_delivery"] is InteractionKind.SERVE
    assert kinds["soup_drop"] is kinds["onion_drop"] is kinds["dish_drop"] is InteractionKind.PUT_DOWN
    assert interaction_kind(0) is InteractionKind.NONE


def test_a_soup_off_a_counter_is_taken_and_one_off_a_pot_is_plated() -> None:
    soup_pickup, from_pot = 1 << EVENT_NAMES.index("soup_pickup"), 1 << len(EVENT_NAMES)
    assert interaction_kind(soup_pickup) is InteractionKind.TAKE_SOUP
    assert interaction_kind(soup_pickup | from_pot) is InteractionKind.PLATE


def test_random_play_never_does_what_the_list_does_not_have() -> None:
    layout = load_layout("coordination_ring")
    possible, rng = set(possible_interactions(layout)), np.random.default_rng(0)
    kitchens, events = Kitchens.start(layout, 64), np.zeros((64, 2), np.int32)
    done = 0
    for _ in range(400):
        before = kitchens.players.copy()
        kitchens.step(rng.integers(0, INTERACT + 1, (64, 2)), events)
        for game, chef in np.argwhere(events != 0):
            x, y, facing = (int(value) for value in before[game, chef, :3])
            cell = (x + STEP_X[facing], y + STEP_Y[facing])
            assert (interaction_kind(int(events[game, chef])), *cell) in possible
            done += 1
    assert done > 100
