"""The kitchen's standard ParallelEnv interface."""

import numpy as np
import pytest
from pettingzoo.test import parallel_api_test, parallel_seed_test

from overcooked.layout import layout_names, load_layout
from overcooked.pettingzoo_env import KitchenEnv
from overcooked.state import Kitchens


@pytest.mark.parametrize("layout", layout_names())
def test_environment_passes_the_api_test(layout: str) -> None:
    parallel_api_test(KitchenEnv(layout, horizon=50), num_cycles=200)


def test_environment_passes_the_seed_test() -> None:
    parallel_seed_test(lambda: KitchenEnv("coordination_ring", horizon=30), num_cycles=10)


def test_episode_is_truncated_at_the_horizon_and_not_before() -> None:
    env = KitchenEnv("coordination_ring", horizon=3)
    env.reset()
    ends = [env.step({"chef_0": 4, "chef_1": 4})[3]["chef_0"] for _ in range(3)]
    assert ends == [False, False, True]
    assert env.agents == []
    with pytest.raises(RuntimeError, match="reset"):
        env.step({"chef_0": 4, "chef_1": 4})


def test_both_chefs_earn_what_one_delivers() -> None:
    env = KitchenEnv("coordination_ring")
    env.reset()
    env._kitchen.players[0] = [[2, 3, 1, 3], [1, 2, 0, 0]]  # a soup in hand before the exit
    _, rewards, _, _, infos = env.step({"chef_0": 5, "chef_1": 4})
    assert rewards == {"chef_0": 20, "chef_1": 20}
    assert infos["chef_0"]["events"] == ["soup_delivery"]
    assert infos["chef_1"]["events"] == []


def test_agents_see_their_own_view_and_the_state_has_both() -> None:
    layout = load_layout("matrix")
    env = KitchenEnv(layout)
    observations, _ = env.reset()
    views = Kitchens.start(layout).encode()[0]
    assert (observations["chef_0"] == views[0]).all()
    assert (observations["chef_1"] == views[1]).all()
    assert (env.state() == views).all()
    assert env.observation_space("chef_0").contains(np.ascontiguousarray(observations["chef_0"]))


def test_unknown_actions_are_refused() -> None:
    env = KitchenEnv("matrix")
    env.reset()
    with pytest.raises(ValueError, match="0-5"):
        env.step({"chef_0": 6, "chef_1": 0})


def test_kitchen_is_drawn_as_text() -> None:
    env = KitchenEnv("coordination_ring", render_mode="ansi")
    env.reset()
    assert env.render() == "XXXPX\nX ^ P\nD^X X\nO   X\nXOSXX\nhands: [ ][ ]"
