"""`kitchenmind.simulate(...)`: agents play whole episodes with each other, as they do in a study."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl
from numpy.typing import NDArray

from models.acting import Stuck, distribution, draw
from models.agents.catalogue import LoadedAgent
from models.agents.given_agents import GivenAgent, loader_of, name_of
from models.inference.checked_output import WrongOutput, checked_probabilities
from models.protocols import BlackBoxError, Policy
from overcooked.constants import HORIZON, PLAYERS, SOUP_DELIVERY
from overcooked.layout import Layout, load_layout
from overcooked.score import progress_credit, sparse_reward
from overcooked.state import Kitchens

AT_ONCE: Final = 256  # episodes in one batch
_MAX_SEED: Final = 2**63 - 1


def simulate(
    layout: str | Path | Layout,
    agents: GivenAgent | Sequence[GivenAgent],
    episodes: int = 1,
    *,
    seed: int = 0,
    horizon: int = HORIZON,
) -> pl.DataFrame:
    """Return one row per episode: episode, layout, agent_0, agent_1, horizon, score, soups, soups_0, soups_1, progress.

    `agents`: one agent for both chefs, or one for each (chef 0 first): a name as in a study file or in `kitchenmind
    agent check`, a class that is made with the layout, or an object with `probabilities(observations)`. Agents act as
    in a study (`Mode`). The same seed gives the same rows, also if there are more episodes after them. `progress` is
    the credit for unfinished soups. Raises ValueError or TypeError that says what is wrong, LayoutError, UnknownAgent,
    CheckpointError or BlackBoxError.
    """
    _check_number("episodes", episodes, 1)
    _check_number("horizon", horizon, 1)
    _check_number("seed", seed, 0)
    kitchen = layout if isinstance(layout, Layout) else load_layout(layout)
    pair = _pair(agents)
    names = [name_of(agent) for agent in pair]
    loaded = [loader_of(agent)(kitchen) for agent in pair]
    rows: list[dict[str, Any]] = []
    for first in range(0, episodes, AT_ONCE):
        numbers = range(first, min(first + AT_ONCE, episodes))
        uniforms = np.stack([np.random.default_rng((seed, number)).random((horizon, PLAYERS)) for number in numbers])
        rows += _play(kitchen, loaded, names, uniforms)
    about = {"layout": kitchen.name, "agent_0": names[0], "agent_1": names[1], "horizon": horizon}
    return pl.DataFrame([{"episode": number + 1} | about | row for number, row in enumerate(rows)])


def _play(
    kitchen: Layout, agents: list[LoadedAgent], names: list[str], uniforms: NDArray[np.float64]
) -> Iterator[dict[str, Any]]:
    """Yield how each episode ended. `uniforms` (episodes, horizon, 2) draw the actions."""
    games, horizon, _ = uniforms.shape
    kitchens, events = Kitchens.start(kitchen, games), np.zeros((games, PLAYERS), np.int32)
    stuck = [Stuck(kitchens.players[:, seat]) for seat in range(PLAYERS)]
    delivered = np.zeros((games, PLAYERS), np.int64)
    score = np.zeros(games, np.int64)
    for timestep in range(horizon):
        seen = kitchens.encode(horizon=horizon)  # (games, 2, width, height, 26)
        actions = np.empty((games, PLAYERS), np.int8)
        for seat, (agent, name) in enumerate(zip(agents, names, strict=True)):
            probabilities = _asked(agent.policy, name, seen[:, seat].copy())
            chances = distribution(probabilities, stuck[seat].counts, agent.mode)
            actions[:, seat] = draw(chances, uniforms[:, timestep, seat])
        kitchens.step(actions, events)
        for seat in range(PLAYERS):
            stuck[seat].update(kitchens.players[:, seat])
        delivered += (events & SOUP_DELIVERY) != 0
        score += [sum(sparse_reward(int(bits)) for bits in both) for both in events]
    for game in range(games):
        yield {
            "score": int(score[game]),
            "soups": int(delivered[game].sum()),
            **{f"soups_{seat}": int(delivered[game, seat]) for seat in range(PLAYERS)},
            "progress": float(progress_credit(kitchen, kitchens.players[game], kitchens.contents[game])),
        }


def _asked(policy: Policy, name: str, seen: NDArray[np.int8]) -> NDArray[np.float32]:
    try:
        return checked_probabilities(policy.probabilities(seen), len(seen))
    except WrongOutput as error:
        raise BlackBoxError(f"{name} {error}. See docs/guides/bring_your_own_agent.md.") from None


def _pair(agents: GivenAgent | Sequence[GivenAgent]) -> tuple[GivenAgent, GivenAgent]:
    given: list[Any] = list(agents) if isinstance(agents, list | tuple) else [agents, agents]
    if len(given) != PLAYERS:
        raise ValueError(f"agents has {len(given)} entries: give one agent for both chefs, or one for each of the two.")
    return given[0], given[1]


def _check_number(name: str, value: int, smallest: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not smallest <= value <= _MAX_SEED:
        raise ValueError(f"{name}={value!r}: give a whole number of at least {smallest}.")
