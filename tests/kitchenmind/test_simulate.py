"""`kitchenmind.simulate` plays whole episodes by the rules, with agents as a study has them."""

import numpy as np
import pytest

import kitchenmind
from models.agents.catalogue import load_agent
from models.agents.check import points_with_itself
from models.protocols import BlackBoxError, Mode, Observations, Probabilities
from overcooked.layout import Layout, load_layout

RING = "coordination_ring"


class Resting:
    """Stays where it is."""

    mode = Mode(temperature=0.0, stuck_mix=0.0)

    def __init__(self, layout: Layout) -> None:
        self.layout = layout

    def probabilities(self, observations: Observations) -> Probabilities:
        return np.eye(6, dtype=np.float32)[np.full(len(observations), 4)]


class Unsure(Resting):
    def probabilities(self, observations: Observations) -> Probabilities:
        return np.full((len(observations), 6), 0.5, np.float32)


def test_a_row_per_episode_with_points_that_fit_the_soups() -> None:
    played = kitchenmind.simulate(RING, ["planner", "sp"], episodes=3, seed=5)
    assert played["episode"].to_list() == [1, 2, 3]
    assert set(played["layout"]) == {RING}
    assert set(zip(played["agent_0"], played["agent_1"], strict=True)) == {("planner", "sp")}
    assert played["soups"].min() > 0  # type: ignore[operator]
    assert (played["score"] == 20 * played["soups"]).all()
    assert (played["soups"] == played["soups_0"] + played["soups_1"]).all()


def test_the_same_seed_gives_the_same_rows_also_in_a_longer_run() -> None:
    first = kitchenmind.simulate(RING, "random", episodes=4, seed=1, horizon=60)
    assert kitchenmind.simulate(RING, "random", episodes=2, seed=1, horizon=60).equals(first.head(2))
    assert not kitchenmind.simulate(RING, "random", episodes=4, seed=2, horizon=60).equals(first)


def test_more_episodes_than_a_batch_are_the_same_episodes(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = kitchenmind.simulate(RING, "random", episodes=5, horizon=40)
    monkeypatch.setattr("kitchenmind.simulated_episodes.AT_ONCE", 2)
    assert kitchenmind.simulate(RING, "random", episodes=5, horizon=40).equals(whole)


def test_a_deterministic_agent_earns_the_points_that_agent_check_reports() -> None:
    layout = load_layout(RING)
    agent = load_agent("sp@greedy", layout)
    still = Mode(temperature=0.0, stuck_mix=0.0)
    points = points_with_itself(agent.policy, still, layout)

    class Wrapped:
        mode = still
        probabilities = staticmethod(agent.policy.probabilities)

    assert kitchenmind.simulate(layout, Wrapped())["score"].to_list() == [points]


def test_agents_may_be_classes_objects_and_module_names() -> None:
    resting = Resting(load_layout(RING))
    played = kitchenmind.simulate(RING, (Resting, resting), horizon=5)
    assert played.row(0, named=True) | {"episode": 1} == {
        "episode": 1, "layout": RING, "agent_0": "Resting", "agent_1": "Resting", "horizon": 5,
        "score": 0, "soups": 0, "soups_0": 0, "soups_1": 0, "progress": 0.0,
    }  # fmt: skip
    named = kitchenmind.simulate(RING, "tests.kitchenmind.test_simulate:Resting", horizon=5)
    assert named["score"].to_list() == [0]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"episodes": 0}, "episodes=0: give a whole number of at least 1"),
        ({"episodes": 1.5}, r"episodes=1\.5: give a whole number"),
        ({"horizon": 0}, "horizon=0"),
        ({"seed": -1}, "seed=-1: give a whole number of at least 0"),
        ({"agents": ["planner"]}, "agents has 1 entries"),
        ({"agents": "planer"}, "no agent 'planer' for coordination_ring. Known: planner"),
        ({"agents": Unsure}, "Unsure gave probabilities that do not sum to 1"),
    ],
)
def test_wrong_input_is_explained(given: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        kitchenmind.simulate(**({"layout": RING, "agents": "stay", "horizon": 3} | given))  # type: ignore[arg-type]


def test_something_that_is_not_an_agent_is_refused() -> None:
    with pytest.raises(TypeError, match="5 is not an agent"):
        kitchenmind.simulate(RING, 5)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="has no method probabilities"):
        kitchenmind.simulate(RING, lambda layout: {})  # type: ignore[arg-type, return-value]
    with pytest.raises(FileNotFoundError, match=r"there is no layout 'nowhere'. Known:"):
        kitchenmind.simulate("nowhere", "stay")
    assert issubclass(BlackBoxError, ValueError)
