"""The end-of-game progress credit."""

import pytest

from overcooked.layout import load_layout
from overcooked.score import ProgressWeights, progress_credit
from overcooked.state import Kitchens

CHEFS = [[2, 1, 0, None], [1, 2, 0, None]]
FIRST_POT, SECOND_POT, COUNTER = (3, 0), (4, 1), (0, 0)


def credit(chefs: object = CHEFS, counters: object = (), pots: object = (), **weights: float) -> float:
    kitchen = Kitchens.start(load_layout("coordination_ring"))
    kitchen.restore({"t": 400, "p": chefs, "c": counters, "pots": pots})
    return progress_credit(kitchen.layout, kitchen.players[0], kitchen.contents[0], ProgressWeights(**weights))


def test_empty_kitchen_earns_nothing() -> None:
    assert credit() == 0


@pytest.mark.parametrize(("onions", "tick", "points"), [(1, -1, 3), (2, -1, 6), (3, 1, 9), (3, 20, 9)])
def test_each_onion_in_a_pot_earns_3_cooked_or_not(onions: int, tick: int, points: int) -> None:
    assert credit(pots=[[*FIRST_POT, onions, tick]]) == points


def test_pots_add_up() -> None:
    assert credit(pots=[[*FIRST_POT, 3, 7], [*SECOND_POT, 2, -1]]) == 15


def test_soup_on_a_dish_earns_17_held_or_on_a_counter() -> None:
    assert credit(chefs=[[2, 1, 0, "soup"], [1, 2, 0, None]]) == 17
    assert credit(counters=[[*COUNTER, "soup"]]) == 17
    assert credit(chefs=[[2, 1, 0, "soup"], [1, 2, 0, "soup"]], counters=[[*COUNTER, "soup"]]) == 51


def test_onions_and_dishes_outside_pots_earn_nothing() -> None:
    assert credit(chefs=[[2, 1, 0, "dish"], [1, 2, 0, "onion"]], counters=[[*COUNTER, "dish"]]) == 0


def test_weights_can_be_set() -> None:
    chefs = [[2, 1, 0, "soup"], [1, 2, 0, None]]
    assert credit(chefs=chefs, pots=[[*FIRST_POT, 2, -1]], onion_in_pot=1, soup_on_dish=10) == 12
