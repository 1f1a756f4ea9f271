"""The rules one by one, in small cases that are easy to get wrong."""

import numpy as np

from overcooked.constants import EAST, EVENT_NAMES, INTERACT, NORTH, SOUTH, STAY, WEST
from overcooked.layout import parse_layout
from overcooked.score import shaped_reward, sparse_reward
from overcooked.state import Kitchens, Record

# Column and row from the top left corner; both chefs stand in the middle row, side by side.
KITCHEN = parse_layout("XXPPXX\nO 12 O\nX    X\nXDDSXX")
POT, SECOND_POT = (2, 0), (3, 0)
AT_POT, AT_SECOND_POT = [2, 1, NORTH], [3, 1, NORTH]
AT_ONIONS, AT_DISHES, AT_EXIT, AT_COUNTER = [1, 1, WEST], [1, 2, SOUTH], [3, 2, SOUTH], [1, 1, NORTH]
AWAY = [4, 2, EAST]


class PlayedEpisode:
    """A kitchen put into a state; `step` plays joint actions and keeps what the last one gave."""

    def __init__(self, first: list[object], second: list[object], counters: object = (), pots: object = ()) -> None:
        self.kitchen = Kitchens.start(KITCHEN)
        self.kitchen.restore({"t": 0, "p": [first, second], "c": counters, "pots": pots})

    def step(self, first: int, second: int = STAY) -> "PlayedEpisode":
        bits = np.zeros((1, 2), np.int32)
        self.kitchen.step(np.array([[first, second]]), bits)
        self.events = [{name for k, name in enumerate(EVENT_NAMES) if chef >> k & 1} for chef in bits[0].tolist()]
        self.points = [sparse_reward(chef) for chef in bits[0].tolist()]
        self.shaping = [shaped_reward(chef) for chef in bits[0].tolist()]
        return self

    @property
    def state(self) -> Record:
        return self.kitchen.record()

    @property
    def hands(self) -> list[str | None]:
        return [chef[3] for chef in self.state["p"]]

    @property
    def cells(self) -> list[list[int]]:
        return [chef[:2] for chef in self.state["p"]]

    @property
    def pots(self) -> list[list[int]]:
        return self.state["pots"]


# Dispensers, counters, hands


def test_empty_hand_takes_an_onion() -> None:
    played = PlayedEpisode([*AT_ONIONS, None], [*AWAY, None]).step(INTERACT)
    assert played.hands == ["onion", None]
    assert played.events[0] == {"onion_pickup", "useful_onion_pickup"}


def test_empty_hand_takes_a_dish() -> None:
    assert PlayedEpisode([*AT_DISHES, None], [*AWAY, None]).step(INTERACT).hands == ["dish", None]


def test_full_hand_takes_nothing_from_a_dispenser() -> None:
    for item in ("onion", "dish", "soup"):
        assert PlayedEpisode([*AT_ONIONS, item], [*AWAY, None]).step(INTERACT).hands == [item, None]
        assert PlayedEpisode([*AT_DISHES, item], [*AWAY, None]).step(INTERACT).hands == [item, None]


def test_any_object_is_put_on_an_empty_counter_and_taken_back() -> None:
    for item in ("onion", "dish", "soup"):
        played = PlayedEpisode([*AT_COUNTER, item], [*AWAY, None]).step(INTERACT)
        assert played.hands == [None, None]
        assert played.state["c"] == [[1, 0, item]]
        assert played.step(INTERACT).hands == [item, None]
        assert played.state["c"] == []


def test_full_hand_at_a_full_counter_does_not_swap() -> None:
    played = PlayedEpisode([*AT_COUNTER, "dish"], [*AWAY, None], counters=[[1, 0, "onion"]]).step(INTERACT)
    assert played.hands == ["dish", None]
    assert played.state["c"] == [[1, 0, "onion"]]


def test_second_chef_takes_in_the_same_timestep_what_the_first_puts_down() -> None:
    first, second = [1, 1, NORTH, "onion"], [1, 1, NORTH, None]
    played = PlayedEpisode(first, second)  # both in one cell: only to face one counter
    assert played.step(INTERACT, INTERACT).hands == [None, "onion"]


def test_first_chef_does_not_take_in_the_same_timestep_what_the_second_puts_down() -> None:
    played = PlayedEpisode([1, 1, NORTH, None], [1, 1, NORTH, "onion"]).step(INTERACT, INTERACT)
    assert played.hands == [None, None]
    assert played.state["c"] == [[1, 0, "onion"]]


def test_interacting_with_the_other_chef_does_nothing() -> None:
    played = PlayedEpisode([2, 1, EAST, "onion"], [3, 1, WEST, None]).step(INTERACT, INTERACT)
    assert played.hands == ["onion", None]
    assert played.events == [set(), set()]


def test_interact_uses_the_facing_from_before_the_timestep() -> None:
    played = PlayedEpisode([1, 1, SOUTH, None], [*AWAY, None]).step(WEST)
    assert played.hands == [None, None]
    assert played.step(INTERACT).hands == ["onion", None]


# Pots and soups


def test_soup_starts_cooking_when_third_onion_is_added() -> None:
    played = PlayedEpisode([*AT_POT, "onion"], [*AWAY, None], pots=[[*POT, 2, -1]]).step(INTERACT)
    assert played.pots == [[*POT, 3, 1]]
    assert played.shaping == [3, 0]


def test_two_onions_wait_for_the_third() -> None:
    played = PlayedEpisode([*AT_POT, "onion"], [*AWAY, None], pots=[[*POT, 1, -1]]).step(INTERACT).step(STAY)
    assert played.pots == [[*POT, 2, -1]]


def test_soup_is_ready_twenty_timesteps_after_its_third_onion() -> None:
    played = PlayedEpisode([*AT_POT, "onion"], [*AT_SECOND_POT, "dish"], pots=[[*POT, 2, -1]]).step(INTERACT)
    for _ in range(18):
        played.step(STAY)
    assert played.pots == [[*POT, 3, 19]]
    assert played.step(STAY).pots == [[*POT, 3, 20]]


def test_dish_lifts_nothing_from_a_cooking_pot() -> None:
    played = PlayedEpisode([*AT_POT, "dish"], [*AWAY, None], pots=[[*POT, 3, 19]]).step(INTERACT)
    assert played.hands == ["dish", None]
    assert played.step(INTERACT).hands == ["soup", None]


def test_dish_lifts_nothing_from_an_empty_or_filling_pot() -> None:
    for pots in ([], [[*POT, 1, -1]], [[*POT, 2, -1]]):
        assert PlayedEpisode([*AT_POT, "dish"], [*AWAY, None], pots=pots).step(INTERACT).hands == ["dish", None]


def test_dish_lifts_a_ready_soup_and_is_shaped_with_5() -> None:
    played = PlayedEpisode([*AT_POT, "dish"], [*AWAY, None], pots=[[*POT, 3, 20]]).step(INTERACT)
    assert (played.hands, played.pots, played.shaping) == (["soup", None], [], [5, 0])


def test_empty_hand_at_a_pot_does_nothing() -> None:
    for tick in (-1, 5, 20):
        pots = [[*POT, 3 if tick >= 0 else 2, tick]]
        played = PlayedEpisode([*AT_POT, None], [*AWAY, None], pots=pots).step(INTERACT)
        assert played.hands == [None, None]
        assert played.events == [set(), set()]


def test_soup_never_burns() -> None:
    played = PlayedEpisode([*AWAY, None], [*AT_ONIONS, None], pots=[[*POT, 3, 20]])
    for _ in range(50):
        played.step(STAY)
    assert played.pots == [[*POT, 3, 20]]


def test_no_onion_is_added_to_a_full_pot() -> None:
    for tick in (0, 7, 20):
        played = PlayedEpisode([*AT_POT, "onion"], [*AWAY, None], pots=[[*POT, 3, tick]]).step(INTERACT)
        assert played.hands == ["onion", None]


def test_fourth_onion_of_one_timestep_stays_in_the_hand() -> None:
    played = PlayedEpisode([*AT_POT, "onion"], [*AT_POT, "onion"], pots=[[*POT, 2, -1]]).step(INTERACT, INTERACT)
    assert played.hands == [None, "onion"]
    assert played.pots == [[*POT, 3, 1]]


def test_soup_is_not_poured_back_into_a_pot() -> None:
    assert PlayedEpisode([*AT_POT, "soup"], [*AWAY, None]).step(INTERACT).hands == ["soup", None]


def test_delivered_soup_pays_20_and_no_shaping() -> None:
    played = PlayedEpisode([*AT_EXIT, "soup"], [*AWAY, None]).step(INTERACT)
    assert (played.hands, played.points, played.shaping) == ([None, None], [20, 0], [0, 0])
    assert played.events[0] == {"soup_delivery"}


def test_exit_takes_nothing_but_soup() -> None:
    for item in ("onion", "dish"):
        played = PlayedEpisode([*AT_EXIT, item], [*AWAY, None]).step(INTERACT)
        assert (played.hands, played.points) == ([item, None], [0, 0])


def test_soup_leaves_a_counter_by_an_empty_hand_without_shaping() -> None:
    played = PlayedEpisode([*AT_COUNTER, None], [*AWAY, None], counters=[[1, 0, "soup"]]).step(INTERACT)
    assert (played.hands, played.shaping) == (["soup", None], [0, 0])
    assert played.events[0] == {"soup_pickup"}


# The useful dish


def take_a_dish(**kitchen: object) -> int:
    """The shaping of the first chef who takes a dish from the dispenser."""
    other = kitchen.pop("other", None)
    return PlayedEpisode([*AT_DISHES, None], [*AWAY, other], **kitchen).step(INTERACT).shaping[0]


def test_dish_is_useful_while_a_pot_is_filling_cooking_or_ready() -> None:
    for pot in ([*POT, 1, -1], [*POT, 2, -1], [*POT, 3, 9], [*POT, 3, 20]):
        assert take_a_dish(pots=[pot]) == 3
    assert take_a_dish() == 0


def test_dish_is_not_useful_while_another_lies_on_a_counter() -> None:
    assert take_a_dish(pots=[[*POT, 1, -1]], counters=[[0, 0, "dish"]]) == 0
    assert take_a_dish(pots=[[*POT, 1, -1]], counters=[[0, 0, "onion"]]) == 3


def test_dish_in_the_other_hand_counts_against_the_pots() -> None:
    assert take_a_dish(pots=[[*POT, 1, -1]], other="dish") == 0
    assert take_a_dish(pots=[[*POT, 1, -1], [*SECOND_POT, 3, 4]], other="dish") == 3


def test_onion_potted_in_the_same_timestep_does_not_make_a_dish_useful() -> None:
    played = PlayedEpisode([*AT_POT, "onion"], [*AT_DISHES, None]).step(INTERACT, INTERACT)
    assert played.shaping == [3, 0]


def test_dish_is_still_useful_in_the_timestep_in_which_the_only_soup_is_lifted() -> None:
    played = PlayedEpisode([*AT_POT, "dish"], [*AT_DISHES, None], pots=[[*POT, 3, 20]]).step(INTERACT, INTERACT)
    assert played.shaping == [5, 3]


def test_dish_put_down_by_the_first_chef_makes_the_second_ones_useless() -> None:
    played = PlayedEpisode([*AT_COUNTER, "dish"], [*AT_DISHES, None], pots=[[*POT, 3, 20]]).step(INTERACT, INTERACT)
    assert played.shaping == [0, 0]


def test_dish_from_a_counter_is_never_useful() -> None:
    played = PlayedEpisode([*AT_COUNTER, None], [*AWAY, None], counters=[[1, 0, "dish"]], pots=[[*POT, 3, 20]]).step(
        INTERACT
    )
    assert played.events[0] == {"dish_pickup"}
    assert played.shaping == [0, 0]


# Walking


def test_chef_walks_into_a_free_cell_and_faces_it() -> None:
    assert PlayedEpisode([1, 1, NORTH, None], [*AWAY, None]).step(SOUTH).state["p"][0] == [1, 2, SOUTH, None]


def test_blocked_chef_turns_and_stays() -> None:
    assert PlayedEpisode([1, 1, NORTH, None], [*AWAY, None]).step(WEST).state["p"][0] == [1, 1, WEST, None]


def test_staying_and_interacting_keep_the_facing() -> None:
    assert PlayedEpisode([1, 1, EAST, None], [*AWAY, None]).step(STAY).step(INTERACT).state["p"][0] == [
        1,
        1,
        EAST,
        None,
    ]


def test_walking_into_a_standing_chef_fails_but_turns() -> None:
    played = PlayedEpisode([2, 1, NORTH, None], [3, 1, NORTH, None]).step(EAST, STAY)
    assert played.state["p"] == [[2, 1, EAST, None], [3, 1, NORTH, None]]


def test_two_chefs_into_one_cell_both_stay() -> None:
    assert PlayedEpisode([1, 1, NORTH, None], [3, 1, NORTH, None]).step(EAST, WEST).cells == [[1, 1], [3, 1]]


def test_two_chefs_do_not_swap_cells() -> None:
    played = PlayedEpisode([2, 1, NORTH, None], [3, 1, NORTH, None]).step(EAST, WEST)
    assert played.state["p"] == [[2, 1, EAST, None], [3, 1, WEST, None]]


def test_chef_follows_into_the_cell_that_the_other_leaves() -> None:
    assert PlayedEpisode([2, 1, NORTH, None], [3, 1, NORTH, None]).step(EAST, EAST).cells == [[3, 1], [4, 1]]


def test_following_a_blocked_chef_fails() -> None:
    assert PlayedEpisode([3, 1, NORTH, None], [4, 1, NORTH, None]).step(EAST, EAST).cells == [[3, 1], [4, 1]]
