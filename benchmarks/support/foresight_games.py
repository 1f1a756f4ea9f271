"""Play games of simulated participants with the bundled agents in batches, for benchmarks/foresight.py. Each episode
has the same person, seat and random numbers whatever is shown. The agent's third action ahead depends on what the
participant does in between; "true" takes it from a game that is played ahead.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.acting import Stuck, distribution, draw
from models.agents.catalogue import LoadedAgent, load_agent
from models.agents.predictors import load_predictor
from models.protocols import Predictor
from overcooked.constants import ACTIONS, FLOOR, HORIZON, PLAYERS, SOUP_DELIVERY, STAY, STEP_X, STEP_Y
from overcooked.layout import Layout, load_layout
from overcooked.state import Kitchens
from server.bots.foresight.participants import NO_ARROW, SimulatedParticipants
from server.bots.foresight.people import ARROWS, Variant, person

NONE, RANDOM, TOM, TRUE = "none", "random", "tom", "true"
VARIANTS: dict[str, Variant] = {
    "all": Variant(),
    "delay 1": Variant(delay=1),
    "delay 2": Variant(delay=2),
    "delay 3": Variant(delay=3),
    "guess: repeats": Variant(repeats=True),
    "guess: station": Variant(repeats=False),
    "credulous": Variant(credulous=True),
}
FIRST_SEED, FRESH_SEED = 20_261_126, 20_271_126  # only version 2 of the participants played the fresh one
AT_ONCE = 50  # episodes in a batch; batches alternate the participant's seat
POINTS = 20


@dataclass(frozen=True)
class Cell:
    """Some episodes in one kitchen with one agent and one kind of arrows. `right`: with `true`, the share of arrows
    that stay true; each of the others shows another action."""

    layout: str
    agent: str
    shown: str
    variant: str = "all"
    right: float = 1.0
    seed: int = FIRST_SEED

    @property
    def name(self) -> str:
        words = (self.layout, self.agent, self.shown, self.variant.replace(": ", "_").replace(" ", "_"))
        return "-".join((*words, f"{round(100 * self.right)}"))


@dataclass
class _Batch:
    """Games that are played together, and everything that determines their course."""

    kitchens: Kitchens
    seat: int  # of the participants
    participants: SimulatedParticipants
    agent: LoadedAgent
    stuck: Stuck
    uniforms: NDArray[np.float64]  # (HORIZON + ARROWS, games): the agent's chance
    actions: NDArray[np.int64]  # (games, 2): what led to the state

    def agent_actions(self, timestep: int) -> NDArray[np.int8]:
        seen = self.kitchens.encode(horizon=HORIZON)[:, 1 - self.seat].copy()
        chances = distribution(self.agent.policy.probabilities(seen), self.stuck.counts, self.agent.mode)
        return draw(chances, self.uniforms[timestep])

    def step(self, own: NDArray[np.int64], agents: NDArray[np.int8], events: NDArray[np.int32]) -> None:
        self.actions = np.stack([own, agents] if self.seat == 0 else [agents, own], 1).astype(np.int64)
        self.kitchens.step(self.actions, events)
        self.stuck.update(self.kitchens.players[:, 1 - self.seat])

    def fork(self) -> "_Batch":
        stuck = Stuck(self.kitchens.players[:, 1 - self.seat])
        stuck.counts[:] = self.stuck.counts
        return _Batch(
            self.kitchens.copy(), self.seat, self.participants.copy(), self.agent, stuck, self.uniforms, self.actions
        )


def played(cell: Cell, episodes: int, horizon: int = HORIZON) -> dict[str, list[float]]:
    """Return points, collisions and accuracy (NaN without arrows) of each episode."""
    layout = load_layout(cell.layout)
    found: dict[str, list[float]] = {"points": [], "collisions": [], "accuracy": []}
    for number, first in enumerate(range(0, episodes, AT_ONCE)):
        games = range(first, min(first + AT_ONCE, episodes))
        for name, values in _play(layout, cell, games, number % PLAYERS, horizon).items():
            found[name] += values.tolist()
    return found


def _play(layout: Layout, cell: Cell, games: range, seat: int, horizon: int) -> dict[str, NDArray[np.float64]]:
    batch = _begun(layout, cell, games, seat)
    predictor = load_predictor(f"{cell.agent}_predictor_stream", layout) if cell.shown == TOM else None
    if predictor is not None:
        predictor.begin(np.arange(len(games)))
    chance = np.random.default_rng((cell.seed, games[0], round(1000 * cell.right)))
    events = np.zeros((len(games), PLAYERS), np.int32)
    points, collisions = np.zeros(len(games)), np.zeros(len(games))
    shown, done = [], []
    for timestep in range(horizon):
        arrows = _arrows(batch, cell, predictor, timestep, chance)
        own = batch.participants.act(batch.kitchens, batch.actions, arrows)
        agents = batch.agent_actions(timestep)
        before = batch.kitchens.players.copy()
        batch.step(own, agents, events)
        points += POINTS * ((events & SOUP_DELIVERY) != 0).sum(1)
        collisions += _collided(layout, before, batch.kitchens.players, batch.actions)
        shown.append(arrows)
        done.append(agents)
    return {"points": points, "collisions": collisions, "accuracy": _accuracy(np.array(shown), np.array(done))}


def _begun(layout: Layout, cell: Cell, games: range, seat: int) -> _Batch:
    variant = VARIANTS[cell.variant]
    kitchens = Kitchens.start(layout, len(games))
    uniforms = np.stack([np.random.default_rng((cell.seed, game)).random(HORIZON + ARROWS) for game in games], 1)
    people = [person(cell.seed + game, seat, variant) for game in games]
    still = np.full((len(games), PLAYERS), STAY, np.int64)
    stuck = Stuck(kitchens.players[:, 1 - seat])
    agent = load_agent(cell.agent, layout)
    return _Batch(kitchens, seat, SimulatedParticipants(layout, people), agent, stuck, uniforms, still)


def _arrows(
    batch: _Batch, cell: Cell, predictor: Predictor | None, timestep: int, chance: np.random.Generator
) -> NDArray[np.int64]:
    """Return the arrows shown on this state, (games, 3)."""
    games = len(batch.actions)
    if cell.shown == NONE:
        return np.full((games, ARROWS), NO_ARROW)
    if cell.shown == RANDOM:
        return chance.integers(ACTIONS, size=(games, ARROWS))
    if predictor is not None:
        seen = batch.kitchens.encode(horizon=HORIZON)[:, 1 - batch.seat].copy()
        last = batch.actions[:, ::-1] if batch.seat == 0 else batch.actions
        last = np.full_like(last, -1) if timestep == 0 else last
        probabilities = predictor.predict(np.arange(games), seen, np.ascontiguousarray(last, np.int8))
        return probabilities.argmax(2).astype(np.int64)
    return _true_arrows(batch, timestep, _errors(cell.right, games, chance))


def _errors(right: float, games: int, chance: np.random.Generator) -> NDArray[np.int64]:
    """Return what is added to the true actions, modulo 6: 0 where the arrow stays true."""
    wrong = chance.integers(1, ACTIONS, size=(games, ARROWS))
    return np.where(chance.random((games, ARROWS)) < right, 0, wrong)


def _true_arrows(batch: _Batch, timestep: int, errors: NDArray[np.int64]) -> NDArray[np.int64]:
    """Play ahead: a participant sees a frame at least a timestep late, so nothing that is shown now changes the next
    two actions of the agent; the third one is asked with the first two shown."""
    games, ahead = len(batch.actions), batch.fork()
    arrows, events = np.full((games, ARROWS), NO_ARROW), np.zeros((games, PLAYERS), np.int32)
    for step in range(ARROWS):
        agents = ahead.agent_actions(timestep + step)
        arrows[:, step] = (agents + errors[:, step]) % ACTIONS
        if step == ARROWS - 1:
            return arrows
        if step > 0:
            ahead.participants.show(timestep, arrows)
        own = ahead.participants.act(ahead.kitchens, ahead.actions, arrows)
        ahead.step(own, agents, events)
    raise AssertionError


def _collided(
    layout: Layout, before: NDArray[np.int8], after: NDArray[np.int8], actions: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Return (games,): whether a chef walked into the other."""
    x, y = np.array([*STEP_X, 0, 0])[actions], np.array([*STEP_Y, 0, 0])[actions]
    free = layout.tiles[before[..., 0] + x, before[..., 1] + y] == FLOOR
    stood = (before[..., :2] == after[..., :2]).all(-1)
    return np.asarray(((actions < STAY) & free & stood).any(-1))


def _accuracy(shown: NDArray[np.int64], done: NDArray[np.int8]) -> NDArray[np.float64]:
    """Return (games,): the share of correct arrows over all three steps."""
    if (shown == NO_ARROW).all():
        return np.full(shown.shape[1], np.nan)
    last = len(done) - ARROWS + 1
    right = [shown[:last, :, step] == done[step : last + step] for step in range(ARROWS)]
    return np.asarray(np.mean(right, axis=(0, 1)), np.float64)
