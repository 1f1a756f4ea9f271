"""How a simulated participant cooks: like somebody with a reaction time, and some of them read the arrows.

It sees its own chef at once and everything else some timesteps late. Who follows the arrows takes the partner to be
where the first of them leads. All chance comes from seed and timestep: a repeat with the same states acts alike.
"""

from collections import deque
from dataclasses import dataclass
from random import Random
from typing import Final

import numpy as np

from models.acting import distribution, draw
from models.agents.catalogue import WEIGHTS, LoadedAgent, load_agent
from overcooked.constants import FACING, PLAYERS, STAY, STEP_X, STEP_Y
from overcooked.layout import Layout
from overcooked.state import Kitchens
from server.play.randomness import uniform

CLONE: Final = "human_bc"
_IDLE, _DRAW = 101, 102  # purposes of `uniform`


@dataclass(frozen=True)
class Traits:
    """What one simulated participant is like, throughout the study."""

    seed: int
    delay: int  # timesteps until it notices what others do
    idle: float  # the share of timesteps in which it does nothing
    follows_arrows: bool
    cloned: bool  # plays like recorded people where there is a clone of them, else plans
    mood: float  # added to every rating

    @classmethod
    def drawn(cls, seed: int, follow: float = 0.7) -> "Traits":
        """`follow`: the share that reads the arrows."""
        chance = Random(f"traits {seed}")  # noqa: S311 - a seed makes a run repeatable
        return cls(
            seed=chance.getrandbits(62),
            delay=chance.choice((1, 1, 2, 3)),
            idle=chance.uniform(0.02, 0.12),
            follows_arrows=chance.random() < follow,
            cloned=chance.random() < 0.4,
            mood=chance.gauss(0, 0.7),
        )


@dataclass
class Impression:
    """What one episode was like for the participant: its answers follow from it."""

    timesteps: int = 0
    soups: int = 0
    tried: int = 0  # own moves
    blocked: int = 0  # of them, those that led nowhere because somebody stood there
    predicted: int = 0  # timesteps for which an arrow told what the partner would do
    right: int = 0  # of them, those that it did

    def share(self, part: int, whole: int) -> float:
        return part / whole if whole else 0.0

    @property
    def soups_in_80_s(self) -> float:
        return 400 * self.soups / self.timesteps if self.timesteps else 0.0


class Cook:
    """One participant in one kitchen."""

    def __init__(self, layout: Layout, seat: int, traits: Traits, episode_seed: int) -> None:
        self._layout, self._seat, self._traits = layout, seat, traits
        self._seed = traits.seed ^ episode_seed
        self._agent = _agent(layout, traits.cloned)
        self._seen: deque[Kitchens] = deque(maxlen=traits.delay + 1)
        self._before: Kitchens | None = None
        self._stuck = 0
        self._predicted: int | None = None
        self.impression = Impression()

    def act(self, now: Kitchens, soups: int, actions: tuple[int, int], arrow: int | None, horizon: int) -> int:
        """The action on this state. `actions`: what led to it; `arrow`: the first predicted action of the partner."""
        self._judge(now, soups, actions)
        self._predicted = arrow
        self._seen.append(now)
        timestep = int(now.timestep[0])
        if uniform(self._seed, timestep, _IDLE) < self._traits.idle:
            return STAY
        seen = self._view(now, arrow).encode(horizon=horizon)[:, self._seat]
        stuck = np.array([self._stuck])
        action_distribution = distribution(self._agent.policy.probabilities(seen), stuck, self._agent.mode)
        return int(draw(action_distribution, np.array([uniform(self._seed, timestep, _DRAW)]))[0])

    def _view(self, now: Kitchens, arrow: int | None) -> Kitchens:
        """The kitchen as the participant has it in mind."""
        view = self._seen[0].copy()
        me, other = self._seat, PLAYERS - 1 - self._seat
        view.players[0, me] = now.players[0, me]
        if self._traits.follows_arrows and arrow is not None:
            view.players[0, other] = now.players[0, other]
            if arrow < STAY:
                self._walk(view, other, arrow)
        if (view.players[0, me, :FACING] == view.players[0, other, :FACING]).all():
            view.players[0, other] = now.players[0, other]
        return view

    def _walk(self, view: Kitchens, seat: int, action: int) -> None:
        x, y = view.players[0, seat, :FACING].tolist()
        there = (x + int(STEP_X[action]), y + int(STEP_Y[action]))
        view.players[0, seat, FACING] = action
        if self._layout.tiles[there] == 0 and there != tuple(view.players[0, self._seat, :FACING].tolist()):
            view.players[0, seat, :FACING] = there

    def _judge(self, now: Kitchens, soups: int, actions: tuple[int, int]) -> None:
        """What the last timestep was like."""
        before, self._before = self._before, now
        if before is None or int(now.timestep[0]) != int(before.timestep[0]) + 1:
            return
        seen, other = self.impression, PLAYERS - 1 - self._seat
        own = now.players[0, self._seat]
        unchanged = bool((own == before.players[0, self._seat]).all())
        self._stuck = self._stuck + 1 if unchanged else 0
        seen.timesteps, seen.soups = seen.timesteps + 1, soups
        if actions[self._seat] < STAY:
            seen.tried += 1
            seen.blocked += unchanged and self._faced_a_chef(before, actions[self._seat])
        if self._predicted is not None:
            seen.predicted += 1
            seen.right += actions[other] == self._predicted

    def _faced_a_chef(self, before: Kitchens, action: int) -> bool:
        x, y = before.players[0, self._seat, :FACING].tolist()
        other: list[int] = before.players[0, 1 - self._seat, :FACING].tolist()
        return other == [x + int(STEP_X[action]), y + int(STEP_Y[action])]


_agents: dict[tuple[str, bool], LoadedAgent] = {}


def _agent(layout: Layout, cloned: bool) -> LoadedAgent:
    """Shared by all simulated participants: policies remember nothing."""
    is_there = cloned and (WEIGHTS / layout.name / CLONE / "config.json").is_file()
    key = (layout.sha256, is_there)
    if key not in _agents:
        _agents[key] = load_agent(CLONE if is_there else "planner", layout)
    return _agents[key]
