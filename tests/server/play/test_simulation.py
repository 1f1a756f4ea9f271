"""The states of an episode by the rules alone: several games at once, and what can be looked back at."""

import numpy as np

from overcooked.constants import ACTIONS
from overcooked.layout import load_layout
from overcooked.state import Kitchens
from server.play.simulation import Simulation, step_together

RING = load_layout("coordination_ring")
JOINT_ACTIONS = np.random.default_rng(7).integers(0, ACTIONS, (3, 60, 2)).tolist()  # of three games


def test_games_stepped_together_equal_games_stepped_alone() -> None:
    together, alone = ([Simulation(RING, horizon=60) for _ in JOINT_ACTIONS] for _ in range(2))
    for timestep in range(60):
        actions = [tuple(game[timestep]) for game in JOINT_ACTIONS]
        steps = step_together(together, actions)
        assert steps == [one.step(pair) for one, pair in zip(alone, actions, strict=True)]
    assert [one.hash() for one in together] == [one.hash() for one in alone]
    assert len({one.hash() for one in together}) == len(together)


def test_looking_back_shows_the_last_states_as_the_chef_saw_them_whatever_came_after() -> None:
    simulation, kitchen = Simulation(RING, horizon=60), Kitchens.start(RING)
    events, states, done = np.zeros((1, 2), np.int32), [], []
    for first, second in JOINT_ACTIONS[0][:5]:
        simulation.step((first, second))
        kitchen.step(np.array([(first, second)], np.int8), events)
        states.append((kitchen.players.tobytes(), kitchen.contents.tobytes()))
        done.append(bytes((second, first)))
    look_back = simulation.history(1)
    simulation.step((0, 0))
    for count in (1, 3):
        seen = look_back(count)
        assert seen.players == b"".join(players for players, _ in states[-count:])
        assert seen.contents == b"".join(contents for _, contents in states[-count:])
        assert seen.actions == b"".join(done[-count:])
    assert look_back(100).actions == b"\xff\xff" + b"".join(done)  # from the start on
