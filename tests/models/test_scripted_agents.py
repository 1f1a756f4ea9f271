"""Agents without training: their observations and actions, and the predictability of the guide."""

import numpy as np
import pytest

from models.agents.catalogue import SCRIPTED, UnknownAgent, agent_names, agent_sha256, load_agent
from models.agents.observation_parser import parse_observation
from models.agents.predictors import load_predictor
from models.networks.checkpoint import CheckpointError
from models.networks.columns import varying_columns
from overcooked.constants import COOKING, EAST, FACING, HELD, ITEM_NAMES, NOTHING, ONION, SOUTH, STEP_X, STEP_Y
from overcooked.interactions import InteractionKind
from overcooked.layout import layout_names, load_layout
from overcooked.state import Kitchens
from tests.support.parameters import mostly_slow
from training.evaluate_agents import EvaluatedAgent, play, with_itself


def _played(name: str, timesteps: int, games: int = 6) -> Kitchens:
    kitchens = Kitchens.start(load_layout(name), games)
    random = np.random.default_rng(0)
    for _ in range(timesteps):
        kitchens.step(random.integers(6, size=(games, 2)), np.zeros((games, 2), np.int32))
    return kitchens


@pytest.mark.parametrize("name", layout_names())
def test_the_parsed_observation_equals_the_state(name: str) -> None:
    kitchens = _played(name, 150)
    seen = kitchens.encode()
    for game in range(kitchens.games):
        record = kitchens.record(game)
        for me in range(2):
            what = parse_observation(seen[game, me])
            for cell, held, player in ((what.me, what.held, me), (what.other, what.other_held, 1 - me)):
                x, y, _, item = record["p"][player]
                assert (cell, ITEM_NAMES[held]) == ((x, y), item)
            assert what.facing == kitchens.players[game, me, FACING]
            turned = kitchens.players[game, 1 - me, FACING]
            assert what.other_ahead == (what.other[0] + STEP_X[turned], what.other[1] + STEP_Y[turned])
            assert {(*cell, ITEM_NAMES[item]) for cell, item in what.items.items()} == {tuple(c) for c in record["c"]}
            for pot in what.pots:
                inside = int(kitchens.contents[game][pot.cell])
                assert pot.onions == (inside if inside < COOKING else 0)
                assert pot.left == (None if inside < COOKING else COOKING + 20 - inside)
            assert what.held in (NOTHING, *range(1, HELD + 1))


@pytest.mark.parametrize("name", layout_names())
def test_the_entries_that_networks_read_are_all_that_ever_change(name: str) -> None:
    kitchens = _played(name, 200)
    layout = kitchens.layout
    seen = kitchens.encode(horizon=220)[:, 0].reshape(kitchens.games, -1)
    start = Kitchens.start(layout, 1).encode()[0, 0].ravel()
    changed = np.flatnonzero((seen != start).any(axis=0))
    assert set(changed.tolist()) <= set(varying_columns(layout, distinct=False)[0].tolist())


@pytest.mark.parametrize("name", mostly_slow(layout_names()))
def test_two_planners_serve_soup_in_every_kitchen_and_never_jam_for_good(name: str) -> None:
    layout = load_layout(name)
    games = with_itself(layout, EvaluatedAgent(*load_agent("planner", layout)), episodes=4)
    assert games.scores.mean() >= 20
    assert games.longest_jam < 60


def test_planners_hand_things_over_where_no_chef_reaches_everything() -> None:
    layout = load_layout("forced_coordination")
    planner = EvaluatedAgent(*load_agent("planner", layout))
    assert with_itself(layout, planner, episodes=4).scores.min() >= 200


def test_a_planner_leaves_things_for_somebody_who_never_takes_them_and_stops() -> None:
    layout = load_layout("forced_coordination")
    planner, waiter = (EvaluatedAgent(*load_agent(name, layout)) for name in ("planner", "stay"))
    for seats in ((planner, waiter), (waiter, planner)):
        assert play(layout, seats, 2, seed=0).scores.max() == 0


def test_a_planner_cooks_with_a_partner_who_only_waits() -> None:
    layout = load_layout("double_rings")
    planner, waiter = (EvaluatedAgent(*load_agent(name, layout)) for name in ("planner", "stay"))
    assert play(layout, (planner, waiter), 2, seed=0).scores.min() >= 40


def test_the_guides_next_actions_are_as_predicted_while_nobody_blocks_it() -> None:
    layout = load_layout("practice")
    policy, _ = load_agent("guide", layout)
    predictor = load_predictor("guide", layout)
    kitchens = Kitchens.start(layout, 1)
    slots, last = np.zeros(1, np.intp), np.full((1, 2), -1, np.int8)
    taken, predicted = [], []
    for _ in range(40):
        seen = kitchens.encode()[:, 1].copy()
        answer = predictor.predict(slots, seen, last)
        assert answer.shape == (1, 3, 6)
        assert answer.max(axis=-1).min() > 0.98
        assert predictor.intentions(slots, seen, last)["kind"].tolist() == [[InteractionKind.NONE] * 2]
        predicted.append(answer[0].argmax(axis=-1))
        taken.append(int(policy.probabilities(seen).argmax()))
        kitchens.step(np.array([[4, taken[-1]]]), np.zeros((1, 2), np.int32))
    assert len(set(taken)) > 1
    for t in range(37):
        assert predicted[t].tolist() == taken[t : t + 3]


@pytest.mark.parametrize("name", ["guide", "carrier"])
def test_an_agent_of_the_practice_gives_way_to_somebody_who_keeps_walking_into_the_same_cell(name: str) -> None:
    layout = load_layout("practice")
    policy, _ = load_agent(name, layout)
    kitchens = Kitchens.start(layout, 1)
    kitchens.players[0] = [(4, 3, EAST, NOTHING), (5, 2, SOUTH, ONION if name == "carrier" else NOTHING)]
    for _ in range(4):  # the first time both want (5, 3), neither gets it
        action = int(policy.probabilities(kitchens.encode()[:, 1].copy()).argmax())
        kitchens.step(np.array([[EAST, action]]), np.zeros((1, 2), np.int32))
    assert tuple(kitchens.players[0, 0, :2]) == (5, 3)


def test_the_catalogue_loads_every_name_that_it_lists() -> None:
    for name in layout_names():
        layout = load_layout(name)
        for agent in agent_names(name):
            policy, _ = load_agent(agent, layout)
            action_distribution = policy.probabilities(Kitchens.start(layout, 3).encode()[:, 0].copy())
            assert action_distribution.shape == (3, 6)
            np.testing.assert_allclose(action_distribution.sum(axis=1), 1, atol=1e-3)
            assert len(agent_sha256(agent, layout)) == 64
    assert set(SCRIPTED) < set(agent_names("coordination_ring"))


def test_the_catalogue_refuses_a_strange_name_and_a_strange_kitchen() -> None:
    ring, rings = load_layout("coordination_ring"), load_layout("double_rings")
    with pytest.raises(UnknownAgent, match=r"no agent 'nobody' for coordination_ring\. Known: planner, "):
        load_agent("nobody", ring)
    folder = "models/weights/coordination_ring/sp"
    with pytest.raises(CheckpointError, match="another grid"):
        load_agent(folder, rings)
