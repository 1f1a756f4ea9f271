"""The kitchen as a PettingZoo ParallelEnv, for trainers outside this project. Ours use `vector_env`."""

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from overcooked.constants import ACTIONS, EVENT_NAMES, FACING, FLOOR, HELD, HORIZON, PLAYERS, TILE_CHARACTERS, X, Y
from overcooked.layout import Layout, load_layout
from overcooked.planes import PLANES
from overcooked.score import shaped_reward, sparse_reward
from overcooked.state import Kitchens

AGENTS = ("chef_0", "chef_1")
_FACINGS = "^v><"
_HELD_LETTERS = " odS"

Observations = dict[str, NDArray[np.int8]]


class KitchenEnv(ParallelEnv[str, NDArray[np.int8], int]):  # type: ignore[misc]  # pettingzoo is not typed
    """One game of two chefs.

    Observations: the encoding as the chef sees it, (width, height, 26) int8. Actions: 0 N, 1 S, 2 E, 3 W, 4 stay,
    5 interact. Rewards: the team's sparse reward, to both. `infos[agent]`: the chef's shaped reward and its events by
    name. The episode is truncated at the horizon; nothing else ends it.
    """

    metadata = {"name": "kitchenmind", "render_modes": ["ansi"], "is_parallelizable": True}  # noqa: RUF012 their contract

    def __init__(self, layout: str | Layout, horizon: int = HORIZON, render_mode: str | None = None) -> None:
        self.layout = load_layout(layout) if isinstance(layout, str) else layout
        self.horizon, self.render_mode = horizon, render_mode
        self.possible_agents = list(AGENTS)
        self.agents: list[str] = []
        shape = (self.layout.width, self.layout.height, PLANES)
        self.observation_spaces = {agent: gymnasium.spaces.Box(0, 127, shape, np.int8) for agent in AGENTS}
        self.action_spaces = {agent: gymnasium.spaces.Discrete(ACTIONS) for agent in AGENTS}
        self._kitchen = Kitchens.start(self.layout)
        self._events = np.zeros((1, PLAYERS), np.int32)

    def observation_space(self, agent: str) -> gymnasium.spaces.Box:
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> gymnasium.spaces.Discrete:
        return self.action_spaces[agent]

    def reset(
        self,
        seed: int | None = None,  # noqa: ARG002 the standard start is always the same
        options: dict[str, Any] | None = None,  # noqa: ARG002
    ) -> tuple[Observations, dict[str, dict[str, Any]]]:
        """Return to the standard start state: observations and empty infos by agent."""
        self._kitchen = Kitchens.start(self.layout)
        self.agents = list(AGENTS)
        return self._observations(), {agent: {} for agent in AGENTS}

    def step(
        self, actions: dict[str, int]
    ) -> tuple[Observations, dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Play one timestep: observations, rewards, terminations, truncations and infos by agent."""
        if not self.agents:
            raise RuntimeError("the episode is over: call reset() first")
        joint_action = [int(actions[agent]) for agent in AGENTS]
        if not all(0 <= action < ACTIONS for action in joint_action):
            raise ValueError(f"actions must be 0-{ACTIONS - 1}, not {joint_action}")
        self._kitchen.step(np.array([joint_action]), self._events)
        bits = self._events[0].tolist()
        team = float(sum(sparse_reward(chef) for chef in bits))
        over = bool(self._kitchen.timestep[0] >= self.horizon)
        infos = {
            agent: {
                "shaped_reward": shaped_reward(chef),
                "events": [name for k, name in enumerate(EVENT_NAMES) if chef >> k & 1],
            }
            for agent, chef in zip(AGENTS, bits, strict=True)
        }
        if over:
            self.agents = []
        return (
            self._observations(),
            dict.fromkeys(AGENTS, team),
            dict.fromkeys(AGENTS, False),
            dict.fromkeys(AGENTS, over),
            infos,
        )

    def state(self) -> NDArray[np.int8]:
        """Return both chefs' views, (2, width, height, 26): the whole state."""
        views: NDArray[np.int8] = self._kitchen.encode(horizon=self.horizon)[0]
        return views

    def render(self) -> str:
        """Draw the kitchen as text: chefs as ^ v > <, and what they hold after their rows."""
        rows = [[TILE_CHARACTERS[tile] for tile in row] for row in self.layout.tiles.T]
        hands = []
        for chef in self._kitchen.players[0].tolist():
            rows[chef[Y]][chef[X]] = _FACINGS[chef[FACING]]
            hands.append(_HELD_LETTERS[chef[HELD]])
        for x, y in np.argwhere((self._kitchen.contents[0] > 0) & (self.layout.tiles != FLOOR)).tolist():
            rows[y][x] = rows[y][x].lower()
        return "\n".join("".join(row) for row in rows) + f"\nhands: [{']['.join(hands)}]"

    def close(self) -> None:
        """Do nothing: no resource is open."""

    def _observations(self) -> Observations:
        return dict(zip(AGENTS, self.state(), strict=True))
