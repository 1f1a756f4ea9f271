"""The result of a kitchen's trial: points of two planners, and how often they block each other."""

from models.agents.kitchen_trial import try_kitchen
from overcooked.layout import load_layout, parse_layout


def test_a_narrow_kitchen_blocks_more_than_chefs_apart() -> None:
    apart = try_kitchen(load_layout("forced_coordination"), 2, horizon=200)
    narrow = try_kitchen(load_layout("cramped_room"), 2, horizon=200)
    assert apart.blocked == 0
    assert narrow.blocked > 0.1
    assert all(points > 0 and points % 20 == 0 for points in (*apart.points, *narrow.points))


def test_the_same_seed_gives_the_same_result() -> None:
    layout = load_layout("cramped_room")
    assert try_kitchen(layout, 2, seed=4, horizon=100) == try_kitchen(layout, 2, seed=4, horizon=100)


def test_a_kitchen_in_which_nothing_can_be_served_gives_no_points() -> None:
    found = try_kitchen(parse_layout("XXXXXXX\nO1P2DXX\nXSXXXXX"), 1, horizon=50)
    assert (found.points, found.blocked) == ((0,), 0.0)
