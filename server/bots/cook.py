"""The cook of a simulated participant: a planner or a behaviour-cloned human, with a reaction time; some use the
arrows. It sees its own chef at once and everything else some timesteps late. A participant who follows the arrows
assumes that the partner goes where the first of them leads. All randomness comes from seed and timestep: the same
states lead to the same actions. `server.bots.foresight` has the cook that bots use by default.
"""

import json
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from random import Random
from typing import Final, Literal, get_args

import numpy as np

from models.acting import distribution, draw
from models.agents.catalogue import WEIGHTS, LoadedAgent, load_agent
from overcooked.constants import FACING, PLAYERS, STAY, STEP_X, STEP_Y
from overcooked.layout import Layout
from overcooked.state import Kitchens
from server.play.randomness import uniform

CookName = Literal["foresight", "credulous", "planner", "clone"]
COOKS: Final[tuple[CookName, ...]] = get_args(CookName)
HUMAN_BC: Final = "human_bc"
_IDLE, _DRAW = 101, 102  # purposes of `uniform`


@dataclass(frozen=True)
class Traits:
    """The traits of one simulated participant, fixed for the study."""

    seed: int
    delay: int  # timesteps until it notices what others do
    idle: float  # the share of timesteps in which it does nothing
    follows_arrows: bool
    cook: CookName  # how it plays
    mood: float  # added to every rating
    tick_ms: float = 200.0  # how long a timestep of the study lasts for a person, also where bots play it faster

    @classmethod
    def drawn(cls, seed: int, cook: CookName = "foresight", follow: float = 0.7, tick_ms: float = 200.0) -> "Traits":
        """Draw the traits of a participant. `follow`: the share of planners and behaviour-cloned humans that uses the
        arrows; the others use them as far as they have proved right."""
        chance = Random(f"traits {seed}")  # noqa: S311 - a seed makes a run repeatable
        return cls(
            seed=chance.getrandbits(62),
            delay=chance.choice((1, 1, 2, 3)),
            idle=chance.uniform(0.02, 0.12),
            follows_arrows=chance.random() < follow,
            cook=cook,
            mood=chance.gauss(0, 0.7),
            tick_ms=tick_ms,
        )


@dataclass
class Impression:
    """The participant's impression of one episode, on which its answers depend."""

    timesteps: int = 0
    soups: int = 0
    tried: int = 0  # own moves
    blocked: int = 0  # of them, those that led nowhere because somebody stood there
    predicted: int = 0  # timesteps for which an arrow showed what the partner would do
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
        self._seen: deque[Kitchens] = deque(maxlen=traits.delay + 1)
        self._before: Kitchens | None = None
        self._stuck = 0
        self._predicted: int | None = None
        self.impression = Impression()

    def act(self, now: Kitchens, soups: int, actions: tuple[int, int], arrows: Sequence[int], horizon: int) -> int:
        """Return the action on this state. `actions`: the joint action that led to it; `arrows`: the predicted actions
        of the partner, empty if none are shown."""
        self._update_impression(now, soups, actions)
        self._predicted = arrows[0] if arrows else None
        return self.choose(now, actions, arrows, horizon)

    def choose(self, now: Kitchens, actions: tuple[int, int], arrows: Sequence[int], horizon: int) -> int:  # noqa: ARG002
        """Plan on the delayed observation, or act like the behaviour-cloned human."""
        self._seen.append(now)
        arrow = arrows[0] if arrows else None
        timestep = int(now.timestep[0])
        if uniform(self._seed, timestep, _IDLE) < self._traits.idle:
            return STAY
        seen = self._view(now, arrow).encode(horizon=horizon)[:, self._seat]
        stuck = np.array([self._stuck])
        agent = _agent(self._layout, self._traits.cook)
        action_distribution = distribution(agent.policy.probabilities(seen), stuck, agent.mode)
        return int(draw(action_distribution, np.array([uniform(self._seed, timestep, _DRAW)]))[0])

    def _view(self, now: Kitchens, arrow: int | None) -> Kitchens:
        """Return the kitchen as the participant perceives it."""
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

    def _update_impression(self, now: Kitchens, soups: int, actions: tuple[int, int]) -> None:
        """Update the impression with the last timestep."""
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


def layouts_without_human_bc(layouts: Iterable[Layout]) -> list[str]:
    """Return the names of the layouts that have no behaviour-cloned human: not bundled, or of another grid."""
    return [layout.name for layout in layouts if not _has_human_bc(layout)]


def _has_human_bc(layout: Layout) -> bool:
    config = WEIGHTS / layout.name / HUMAN_BC / "config.json"
    return config.is_file() and json.loads(config.read_text("utf-8"))["grid"] == layout.text


_agents: dict[tuple[str, str], LoadedAgent] = {}


def _agent(layout: Layout, cook: CookName) -> LoadedAgent:
    """Load the policy, shared by all simulated participants because policies are stateless. In a layout without a
    behaviour-cloned human (the tutorial's), the planner is used."""
    name = HUMAN_BC if cook == "clone" and not layouts_without_human_bc([layout]) else "planner"
    key = (layout.sha256, name)
    if key not in _agents:
        _agents[key] = load_agent(name, layout)
    return _agents[key]
