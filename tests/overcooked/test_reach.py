"""What the chefs of a kitchen can reach, and all problems of a grid at once."""

import pytest

from overcooked.layout import LayoutError, layout_names, layout_problems, load_layout, parse_layout
from overcooked.reach import kitchen_reach


def test_each_chef_of_an_open_kitchen_reaches_everything() -> None:
    found = kitchen_reach(load_layout("cramped_room"))
    assert found.stations[0] == found.stations[1]
    assert len(found.stations[0]) == 5
    assert (found.alone, found.together, found.unused) == ((True, True), True, frozenset())


def test_chefs_apart_hand_over_on_shared_counters() -> None:
    found = kitchen_reach(load_layout("forced_coordination"))
    assert (found.alone, found.together) == ((False, False), True)
    assert found.shared == {(2, 1), (2, 2), (2, 3)}
    assert not found.stations[0] & found.stations[1]


@pytest.mark.parametrize(
    ("grid", "together"),
    [
        ("XPXXX\nO1X2D\nX X X\nXXXSX", True),  # over the counters between them
        ("XPXXXXX\nO1XX2DX\nXXXXSXX", False),  # the pot is out of the other's reach
        ("XXXXX\nO1P2D\nXXXSX", True),  # through the pot that both stand next to
        ("XXXXXXX\nO1P2DXX\nXSXXXXX", False),  # the soup does not get to the exit
    ],
)
def test_a_soup_gets_from_hand_to_hand_only_where_both_can_stand(grid: str, together: bool) -> None:
    assert kitchen_reach(parse_layout(grid)).together is together


def test_unreachable_floor_is_reported() -> None:
    found = kitchen_reach(parse_layout("XXPXXXX\nO12DX X\nXXSXXXX"))
    assert found.unused == {(5, 1)}


def test_all_problems_of_a_grid_are_reported_at_once_and_the_first_is_raised() -> None:
    text = "XX X\nXT1X\nXXX"
    problems = layout_problems(text, "nook")
    assert [(one.row, one.column) for one in problems if one.row] == [(1, 3), (2, 2), (3, 4)]
    assert "there is no pot" in {one.reason for one in problems}
    with pytest.raises(LayoutError) as raised:
        parse_layout(text, "nook")
    assert str(raised.value) == str(problems[0])


def test_every_unreachable_station_is_reported() -> None:
    problems = layout_problems("XXPXX\nO1 2D\nXXXSX\nPXXXP")
    assert [(one.row, one.column) for one in problems] == [(4, 1), (4, 5)]
    assert all("nobody can reach this pot" in one.reason for one in problems)


@pytest.mark.parametrize("name", layout_names())
def test_bundled_layouts_have_no_problem_and_can_be_served_together(name: str) -> None:
    layout = load_layout(name)
    assert layout_problems(layout.text) == []
    assert kitchen_reach(layout).together
