"""A model worker encodes a game's states like the game itself."""

import numpy as np

from models.inference.wire import Load, ModelRequest, Row
from models.inference.worker import Worker
from models.protocols import ENDLESS
from overcooked.layout import load_layout
from overcooked.state import Kitchens

LAYOUT, HORIZON = "coordination_ring", 60


def test_rows_with_several_states_seats_and_horizons_are_seen_as_in_their_games():
    draws, kitchens = np.random.default_rng(3), Kitchens.start(load_layout(LAYOUT))
    states = []
    for _ in range(HORIZON):
        states.append(kitchens.copy())
        kitchens.step(draws.integers(0, 6, (1, 2)), np.zeros((1, 2), np.int32))
    # (seat, states, newest timestep, horizon): the last 40 timesteps before a horizon look different
    games = [(0, 1, 10, HORIZON), (1, 3, 21, HORIZON), (0, 4, 58, 0), (1, 1, 59, HORIZON)]
    rows, shown, wanted = [], [], []
    for seat, count, newest, horizon in games:
        left = horizon - newest if horizon else ENDLESS
        rows.append(Row(f"{newest}/{seat}", "stay", None, newest, count, True, 0, 0.5, seat, left))
        mine = states[newest + 1 - count : newest + 1]
        shown += mine
        wanted += [one.encode(horizon=horizon)[0, seat] for one in mine]
    players, contents = (b"".join(getattr(one, name).tobytes() for one in shown) for name in ("players", "contents"))
    asked = ModelRequest(1, LAYOUT, rows, players, contents, bytes(2 * len(shown)))
    worker = Worker(Load(((LAYOUT, "stay"),), ()))
    assert np.array_equal(worker._observations(asked), np.array(wanted))
