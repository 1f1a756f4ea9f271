"""Many games at once for training: they are the same games, scored, counted and restarted automatically."""

import numpy as np
import pytest

from overcooked.constants import COOKING, FLOOR, ONIONS_PER_SOUP
from overcooked.layout import load_layout, parse_layout
from overcooked.score import shaped_reward, sparse_reward
from overcooked.state import Kitchens
from overcooked.vector_env import Starts, VectorEnv

GAMES, HORIZON = 16, 30


class Driven:
    """An environment driven by random joint actions, with the caller's buffers."""

    def __init__(self, env: VectorEnv, seed: int = 3) -> None:
        self.env, self.random = env, np.random.default_rng(seed)
        self.sparse = np.zeros((env.games, 2), np.float32)
        self.shaped = np.zeros((env.games, 2), np.float32)
        self.dones = np.zeros(env.games, bool)
        self.observations = np.full((env.games, *env.observation_shape), -1, np.int8)

    def step(self, encode: bool = True) -> np.ndarray:
        actions = self.random.integers(0, 6, (self.env.games, 2), dtype=np.int8)
        self.env.step(actions, self.sparse, self.shaped, self.dones, self.observations if encode else None)
        return actions


def ring(games: int = GAMES, horizon: int = HORIZON, starts: Starts | None = None, seed: int = 0) -> Driven:
    return Driven(VectorEnv(load_layout("coordination_ring"), games, horizon, starts, seed))


def test_games_are_those_of_the_rules() -> None:
    driven = ring(horizon=400)
    reference, events = Kitchens.start(driven.env.layout, GAMES), np.zeros((GAMES, 2), np.int32)
    shaping = 0
    for _ in range(300):
        reference.step(driven.step(), events)
        assert driven.sparse.tolist() == [[sparse_reward(int(bits)) for bits in game] for game in events]
        assert driven.shaped.tolist() == [[shaped_reward(int(bits)) for bits in game] for game in events]
        shaping += driven.shaped.sum()
    assert (driven.observations == reference.encode()).all()
    assert shaping > 0


def test_finished_episode_restarts_at_once() -> None:
    driven = ring()
    for timestep in range(1, HORIZON + 1):
        driven.step()
        assert driven.dones.all() == (timestep == HORIZON)
    start = Kitchens.start(driven.env.layout, GAMES)
    assert (driven.env.kitchens.players == start.players).all()
    assert (driven.observations == start.encode(horizon=HORIZON)).all()


def test_finished_episodes_carry_the_sums_of_their_rewards() -> None:
    driven, sparse, shaped = ring(horizon=400), 0.0, np.zeros((GAMES, 2))
    driven.env.kitchens.players[:, 0] = (3, 3, 3, 3)  # each first chef starts with a soup, two cells from the exit
    for _ in range(400):
        driven.step(encode=False)
        sparse += driven.sparse.sum()
        shaped += driven.shaped
    finished = driven.env.take_finished()
    assert finished.sparse.sum() == sparse > 0
    assert finished.shaped.tolist() == shaped.tolist()
    assert finished.timesteps.tolist() == [400] * GAMES
    assert finished.standard.all()


def test_finished_episodes_are_taken_once() -> None:
    driven = ring()
    for _ in range(2 * HORIZON):
        driven.step()
    assert len(driven.env.take_finished().sparse) == 2 * GAMES
    assert len(driven.env.take_finished().sparse) == 0


def test_oldest_finished_episodes_give_way_when_nobody_takes_them() -> None:
    driven = ring(horizon=1)
    for _ in range(1024 // GAMES + 5):
        driven.step(encode=False)
    assert len(driven.env.take_finished().sparse) == 1024


def test_skipped_encoding_leaves_observations_alone() -> None:
    driven = ring()
    driven.step(encode=False)
    assert (driven.observations == -1).all()


def test_reset_shows_the_start() -> None:
    driven = ring()
    driven.step()
    driven.env.reset(driven.observations)
    assert (driven.observations == Kitchens.start(driven.env.layout, GAMES).encode(horizon=HORIZON)).all()


def test_desynchronised_games_end_at_different_timesteps() -> None:
    driven = ring(starts=Starts(desynchronised=True))
    ends = []
    for _ in range(HORIZON):
        driven.step()
        ends.append(int(driven.dones.sum()))
    assert sum(ends) == GAMES
    assert max(ends) < GAMES
    first = driven.env.take_finished()
    assert (first.timesteps <= HORIZON).all()
    assert (first.standard == (first.timesteps == HORIZON)).all()


def test_random_starts_are_playable_states() -> None:
    env = ring(games=512, starts=Starts(random_share=1.0)).env
    cells = env.kitchens.players[:, :, :2].astype(int)
    assert (env.layout.tiles[cells[..., 0], cells[..., 1]] == FLOOR).all()
    assert (cells[:, 0] != cells[:, 1]).any(axis=1).all()
    pots = env.kitchens.contents[:, env.layout.pots[:, 0], env.layout.pots[:, 1]]
    assert set(np.unique(pots)) == {*range(ONIONS_PER_SOUP), *range(COOKING + 1, COOKING + 21)}
    assert set(np.unique(env.kitchens.players[..., 2])) == set(np.unique(env.kitchens.players[..., 3])) == {0, 1, 2, 3}


def test_share_of_random_starts_is_as_asked() -> None:
    driven = ring(games=4096, horizon=1, starts=Starts(random_share=0.25))
    driven.step(encode=False)
    assert 0.22 < 1 - driven.env.take_finished().standard.mean() < 0.28


def test_same_seed_gives_the_same_games() -> None:
    twins = [ring(starts=Starts(True, 0.5), seed=seed) for seed in (5, 5, 6)]
    for _ in range(HORIZON * 2):
        for driven in twins:
            driven.step()
    first, second, other = (driven.observations for driven in twins)
    assert (first == second).all()
    assert (first != other).any()


def test_restored_state_continues_identically() -> None:
    driven, resumed = ring(starts=Starts(True, 0.5)), ring(starts=Starts(True, 0.5), seed=99)
    for _ in range(7):
        driven.step()
    resumed.env.restore({name: array.copy() for name, array in driven.env.state().items()})
    resumed.random = np.random.default_rng(8)
    driven.random = np.random.default_rng(8)
    for _ in range(HORIZON):
        driven.step()
        resumed.step()
    assert (driven.observations == resumed.observations).all()


def test_chefs_of_a_divided_kitchen_start_on_their_own_side() -> None:
    divided = parse_layout("XPXSX\nO1X2X\nX X X\nXDXXX")
    env = VectorEnv(divided, 200, starts=Starts(random_share=1.0))
    assert (env.kitchens.players[:, 0, 0] == 1).all()
    assert (env.kitchens.players[:, 1, 0] == 3).all()


@pytest.mark.parametrize("name", ["actions", "sparse", "shaped", "dones", "observations"])
def test_buffer_of_a_wrong_size_is_refused(name: str) -> None:
    driven = ring()
    buffers = {
        "actions": np.zeros((GAMES, 2), np.int8),
        "sparse": driven.sparse,
        "shaped": driven.shaped,
        "dones": driven.dones,
        "observations": driven.observations,
    }
    buffers[name] = buffers[name][:-1]
    with pytest.raises(ValueError, match="must"):
        driven.env.step(**buffers)


def test_no_games_and_no_time_are_refused() -> None:
    with pytest.raises(ValueError, match="at least 1"):
        VectorEnv(load_layout("matrix"), 0)
    with pytest.raises(ValueError, match="at least 1"):
        VectorEnv(load_layout("matrix"), 1, horizon=0)
