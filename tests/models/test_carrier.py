"""The carrier of practice games: it keeps moving onions, and its predictor is always right."""

import numpy as np
import pytest

from models.agents.catalogue import load_agent
from models.agents.predictors import load_predictor
from overcooked.constants import POTTING_ONION, STAY, STEP_X, STEP_Y
from overcooked.interactions import InteractionKind, interaction_kind
from overcooked.layout import load_layout
from overcooked.state import Kitchens

TIMESTEPS = 200
Done = list[tuple[int, int, int, int]]  # timestep, kind, x, y


@pytest.mark.parametrize("name", ["practice", "forced_coordination"])
def test_every_use_of_a_station_was_foreseen_and_no_pot_is_filled(name: str) -> None:
    layout = load_layout(name)
    agent, predictor = load_agent("carrier", layout), load_predictor("carrier", layout)
    kitchen, events = Kitchens.start(layout), np.zeros((1, 2), np.int32)
    slots, before = np.zeros(1, np.intp), np.full((1, 2), -1, np.int8)
    done: Done = []
    said = []
    for timestep in range(TIMESTEPS):
        seen = kitchen.encode()[:, 1]
        action = int(agent.policy.probabilities(seen)[0].argmax())
        assert predictor.predict(slots, seen, before)[0, 0].argmax() == action
        said.append(predictor.intentions(slots, seen, before)[0, 0])  # type: ignore[attr-defined]
        x, y, facing = (int(value) for value in kitchen.players[0, 1, :3])
        kitchen.step(np.array([[STAY, action]]), events)
        assert not events[0, 1] & POTTING_ONION
        kind = interaction_kind(int(events[0, 1]))
        if kind:
            done.append((timestep, kind, x + int(STEP_X[facing]), y + int(STEP_Y[facing])))
    assert len(done) >= TIMESTEPS // 20
    assert {kind for _, kind, _, _ in done} == {InteractionKind.TAKE_ONION, InteractionKind.PUT_DOWN}
    for at, what, x, y in done:
        assert tuple(said[at])[:4] == (what, x, y, 1)
        earlier = max((other[0] for other in done if other[0] < at), default=-1) + 1
        assert tuple(said[earlier])[:4] == (what, x, y, at - earlier + 1)
