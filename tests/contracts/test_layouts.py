"""Every bundled layout is a playable kitchen, whatever the chefs do."""

import numpy as np
import pytest

from overcooked.constants import COOKING, COUNTER, FLOOR, NOTHING, ONIONS_PER_SOUP, POT, READY
from overcooked.layout import Layout, layout_names, load_layout
from overcooked.planes import PLANES
from overcooked.state import Kitchens

GAMES, TIMESTEPS = 64, 400


@pytest.fixture(params=layout_names())
def layout(request: pytest.FixtureRequest) -> Layout:
    return load_layout(request.param)


@pytest.fixture
def played(layout: Layout) -> Kitchens:
    """Many games after a long time of random joint actions."""
    kitchens, random = Kitchens.start(layout, GAMES), np.random.default_rng(7)
    events = np.zeros((GAMES, 2), np.int32)
    for _ in range(TIMESTEPS):
        kitchens.step(random.integers(0, 6, (GAMES, 2)), events)
    return kitchens


def test_grid_can_be_drawn_and_read_again(layout: Layout) -> None:
    text = "\n".join(
        "".join(
            str(layout.starts.tolist().index([x, y]) + 1)
            if [x, y] in layout.starts.tolist()
            else " XODPS"[layout.tiles[x, y]]
            for x in range(layout.width)
        )
        for y in range(layout.height)
    )
    assert text == layout.text


def test_chefs_start_apart_facing_north_with_empty_hands(layout: Layout) -> None:
    first, second = Kitchens.start(layout).record()["p"]
    assert first[:2] != second[:2]
    assert first[2:] == second[2:] == [0, None]


def test_chefs_stay_on_the_floor_and_apart(played: Kitchens) -> None:
    cells = played.players[:, :, :2].astype(int)
    assert (played.layout.tiles[cells[..., 0], cells[..., 1]] == FLOOR).all()
    assert (cells[:, 0] != cells[:, 1]).any(axis=1).all()


def test_objects_lie_only_on_counters_and_in_pots(played: Kitchens) -> None:
    tiles = played.layout.tiles
    assert (played.contents[:, (tiles != COUNTER) & (tiles != POT)] == NOTHING).all()
    pots = played.contents[:, tiles == POT]
    assert ((pots < ONIONS_PER_SOUP) | ((pots > COOKING) & (pots <= READY))).all()


def test_record_and_restore_keep_the_hash(played: Kitchens) -> None:
    twin = Kitchens.start(played.layout, GAMES)
    for game in range(GAMES):
        twin.restore(played.record(game), game)
    assert [twin.hash(game) for game in range(GAMES)] == [played.hash(game) for game in range(GAMES)]


def test_the_two_views_are_one_kitchen_seen_from_both_sides(played: Kitchens) -> None:
    views = played.encode()
    assert views.shape == (GAMES, 2, played.layout.width, played.layout.height, PLANES)
    first, second = views[:, 0], views[:, 1]
    exchanged = [1, 0, 6, 7, 8, 9, 2, 3, 4, 5, *range(10, PLANES)]
    assert (first[..., exchanged] == second).all()
    assert (first[..., :2].sum(axis=(1, 2)) == 1).all()


def test_chefs_that_only_wait_change_nothing_but_the_clock(layout: Layout) -> None:
    kitchen, events = Kitchens.start(layout), np.zeros((1, 2), np.int32)
    before = kitchen.record()
    kitchen.step(np.array([[4, 4]]), events)
    assert kitchen.record() == {**before, "t": 1}
    assert not events.any()
