"""The state as data and its hash, which identifies it in every stored episode."""

import numpy as np
import pytest

from overcooked.layout import layout_names, load_layout
from overcooked.state import Kitchens

# Literals on purpose: stored episodes carry such hashes, so a change of the hash needs a migration, not a new literal.
START_HASHES = {
    "asymmetric_advantages": "fcc7b89d9bb56ef0",
    "clear_division": "ac2bff05217cbbf8",
    "coordination_ring": "4b9a750f01eef36c",
    "counter_circuit": "10a1bf04dd7d3e7b",
    "cramped_room": "92b256112eeda1e4",
    "double_counters": "864545d740a5ee5f",
    "double_rings": "46201ded4003f212",
    "forced_coordination": "22f76ab8122ee78e",
    "matrix": "3222586deb40ac31",
    "practice": "2cc455e7b4884d5a",
}
HASH_OF_A_FULL_KITCHEN = "84a813c0a8aa8654"
FULL_KITCHEN = {
    "t": 123,
    "p": [[1, 1, 3, "soup"], [3, 2, 2, "dish"]],
    "c": [[0, 0, "onion"], [2, 2, "soup"]],
    "pots": [[3, 0, 2, -1], [4, 1, 3, 20]],
}


@pytest.fixture
def kitchen() -> Kitchens:
    return Kitchens.start(load_layout("coordination_ring"))


@pytest.mark.parametrize("name", layout_names())
def test_hash_of_the_start_is_the_same_on_every_machine(name: str) -> None:
    assert Kitchens.start(load_layout(name)).hash() == START_HASHES[name]


def test_hash_of_a_full_kitchen_is_the_same_on_every_machine(kitchen: Kitchens) -> None:
    kitchen.restore(FULL_KITCHEN)
    assert kitchen.hash() == HASH_OF_A_FULL_KITCHEN


def test_hashes_of_layouts_and_timesteps_differ(kitchen: Kitchens) -> None:
    later = kitchen.copy()
    later.timestep += 1
    assert len({*START_HASHES.values(), later.hash()}) == len(START_HASHES) + 1


def test_record_and_restore_are_inverse(kitchen: Kitchens) -> None:
    kitchen.restore(FULL_KITCHEN)
    assert kitchen.record() == FULL_KITCHEN


def test_restored_pot_cooks_on(kitchen: Kitchens) -> None:
    kitchen.restore({**FULL_KITCHEN, "pots": [[3, 0, 3, 4]]})
    kitchen.step(np.array([[4, 4]]), np.zeros((1, 2), np.int32))
    assert kitchen.record()["pots"] == [[3, 0, 3, 5]]


def test_copy_shares_nothing(kitchen: Kitchens) -> None:
    twin = kitchen.copy()
    kitchen.step(np.array([[3, 0]]), np.zeros((1, 2), np.int32))
    assert twin.hash() == START_HASHES["coordination_ring"]


@pytest.mark.parametrize(
    "broken",
    [
        {"t": 1, "p": [[1, 1, 3, "pizza"], [3, 2, 2, None]], "c": [], "pots": []},
        {"t": 1, "p": [[0, 0, 3, None], [3, 2, 2, None]], "c": [], "pots": []},
        {"t": 1, "p": [[1, 1, 4, None], [3, 2, 2, None]], "c": [], "pots": []},
        {"t": 1, "p": [[1, 1, 3, None]], "c": [], "pots": []},
        {"t": 1, "p": [[1, 1, 3, None], [3, 2, 2, None]], "c": [[1, 1, "onion"]], "pots": []},
        {"t": 1, "p": [[1, 1, 3, None], [3, 2, 2, None]], "c": [[40, 1, "onion"]], "pots": []},
        {"t": 1, "p": [[1, 1, 3, None], [3, 2, 2, None]], "c": [], "pots": [[3, 0, 3, 21]]},
        {"t": 1, "p": [[1, 1, 3, None], [3, 2, 2, None]], "c": [], "pots": [[3, 0, 2, 5]]},
        {"t": 1, "p": [[1, 1, 3, None], [3, 2, 2, None]], "c": [], "pots": [[0, 0, 1, -1]]},
        {"t": 1, "p": [[1, 1, 3, None], [3, 2, 2, None]], "c": []},
    ],
)
def test_an_invalid_record_is_refused_and_changes_nothing(kitchen: Kitchens, broken: dict[str, object]) -> None:
    before = kitchen.hash()
    with pytest.raises((ValueError, KeyError)):
        kitchen.restore(broken)
    assert kitchen.hash() == before


def test_observations_of_a_wrong_shape_are_refused(kitchen: Kitchens) -> None:
    with pytest.raises(ValueError, match="contiguous"):
        kitchen.encode(np.zeros((1, 2, 5, 5, 25), np.int8))


def test_urgency_shows_in_the_last_39_timesteps_and_never_in_an_endless_game(kitchen: Kitchens) -> None:
    kitchen.timestep[:] = 360
    assert kitchen.encode()[..., 25].sum() == 0
    kitchen.timestep[:] = 361
    assert kitchen.encode()[..., 25].all()
    assert kitchen.encode(horizon=0)[..., 25].sum() == 0
