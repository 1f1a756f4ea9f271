"""The entries of the encoding that can change: found by enumeration, equal ones kept once."""

import numpy as np
import pytest

from models.networks.columns import varying_columns
from overcooked.layout import load_layout
from overcooked.state import Kitchens


@pytest.mark.parametrize("name", ["coordination_ring", "clear_division"])
def test_what_random_games_change_is_among_the_columns_and_equal_columns_are_kept_once(name):
    layout, draws = load_layout(name), np.random.default_rng(3)
    kitchens = Kitchens.start(layout, 64)
    start = kitchens.encode()[:, 0].reshape(64, -1)
    seen = [start]
    for _ in range(300):
        kitchens.step(draws.integers(0, 6, (64, 2)).astype(np.int8), np.zeros((64, 2), np.int32))
        seen.append(kitchens.encode()[:, 0].reshape(64, -1))
    games = np.concatenate(seen)
    changed = np.flatnonzero((games != games[0]).any(axis=0))
    every, _ = varying_columns(layout, distinct=False)
    kept, largest = varying_columns(layout)
    assert set(changed.tolist()) <= set(every.tolist())
    assert (games[:, kept] <= largest).all()
    assert set(kept.tolist()) < set(every.tolist())
    for column in set(changed.tolist()) - set(kept.tolist()):
        assert (games[:, kept] == games[:, [column]]).all(axis=0).any()
    assert (np.diff(kept) > 0).all()


def test_changing_a_returned_record_does_not_affect_the_next_one():
    layout = load_layout("matrix")
    columns, largest = varying_columns(layout)
    columns[:], largest[:] = 0, 0
    assert varying_columns(layout)[0].any()
    assert varying_columns(layout)[1].all()
