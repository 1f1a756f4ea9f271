"""`kitchenmind agent check NAME --layout L`: check an agent (or predictor) before a study uses it. `kitchenmind agent
serve` is in `agent_server.py`.
"""

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from models.acting import Stuck, distribution, draw
from models.agents import agent_server
from models.agents.catalogue import UnknownAgent, load_agent
from models.agents.checked_policy import explained
from models.agents.predictors import UnknownPredictor, load_predictor
from models.inference.checked_output import (
    WrongOutput,
    checked_intentions,
    checked_predictions,
    checked_probabilities,
)
from models.networks.checkpoint import CheckpointError
from models.protocols import BlackBoxError, Mode, Observations, Policy, Predictor
from overcooked.constants import ACTIONS, HORIZON, PLAYERS
from overcooked.layout import Layout, LayoutError, load_layout
from overcooked.score import sparse_reward
from overcooked.state import Kitchens

Checked = TypeVar("Checked")
DEADLINE_MS = 120.0  # of a tick, unless the study says otherwise
# Errors of our own: they name place and remedy.
_SAY_WHAT_TO_DO = (
    BlackBoxError,
    CheckpointError,
    UnknownAgent,
    UnknownPredictor,
)


class NotFit(ValueError):
    """The model loads, but its output cannot be used; the message says what was expected."""


@dataclass(frozen=True)
class AgentFinding:
    """What was measured on states of random games."""

    median_ms: float  # for one game
    slowest_ms: float
    batch_ms: float  # for 32 games at once
    deterministic: bool  # the same question has the same answer
    certain: float  # share of answers that are one single action


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the actions `check` and `serve`."""
    kinds = parser.add_subparsers(dest="what", metavar="COMMAND", required=True)
    check = kinds.add_parser(
        "check", help="check that an agent loads and fits, how long it takes, and whether it is deterministic"
    )
    check.add_argument("name", help="bundled agent, checkpoint folder, ONNX file, module:Class or URL")
    check.add_argument("--layout", required=True, help="a bundled layout or a .layout file")
    check.add_argument("--predictor", action="store_true", help="NAME is a predictor, not an agent")
    check.add_argument(
        "--deadline-ms", type=float, default=DEADLINE_MS, help="longest time for an answer (default: 120)"
    )
    agent_server.add_arguments(kinds)


def run(arguments: argparse.Namespace) -> int:
    """Return 0 if it can be used, 1 if not (standard error says why), 2 if it does not load or the layout is not
    valid."""
    if arguments.what == "serve":
        return agent_server.run(arguments)
    try:
        layout = load_layout(arguments.layout)
    except (LayoutError, OSError) as error:
        print(f"kitchenmind agent check: {error}", file=sys.stderr)
        return 2
    print(f"{arguments.name} on {layout.name} ({layout.width} x {layout.height})")
    try:
        finding = _found(arguments, layout)
    except NotFit as wrong:
        print(f"kitchenmind agent check: {arguments.name} does not fit {arguments.layout}: {wrong}", file=sys.stderr)
        return 1
    except Exception as error:  # noqa: BLE001 somebody else's model may raise anything
        reason = str(error) if isinstance(error, _SAY_WHAT_TO_DO) else f"{explained(error)}. Correct its code."
        print(f"kitchenmind agent check: {arguments.name} cannot be used: {reason}", file=sys.stderr)
        return 2
    return _reported(arguments, finding)


def _found(arguments: argparse.Namespace, layout: Layout) -> AgentFinding:
    """Load the model and try it, an agent also with itself. Raises NotFit, and whatever the model raises."""
    if arguments.predictor:
        return check_predictor(load_predictor(arguments.name, layout), layout)
    policy, mode = load_agent(arguments.name, layout)
    finding = check_policy(policy, mode, layout)
    _say("acts", f"temperature {mode.temperature:g}, {mode.stuck_mix:.0%} moves after {mode.stuck_after} stuck")
    points = points_with_itself(policy, mode, layout)
    _say("with itself", f"{points} points in {HORIZON} timesteps")
    if points == 0:
        _warn(f"it delivers no soup in self-play in {HORIZON} timesteps. Was it trained for {layout.name}?")
    return finding


def _reported(arguments: argparse.Namespace, finding: AgentFinding) -> int:
    """Print what was measured; return the exit status."""
    _say("one game", f"{finding.median_ms:.2f} ms, at most {finding.slowest_ms:.2f} ms")
    _say("32 games", f"{finding.batch_ms:.2f} ms")
    _say("deterministic", "yes" if finding.deterministic else "no: the same question has different answers")
    _say("certain", f"in {finding.certain:.0%} of the states")
    if max(finding.slowest_ms, finding.batch_ms) > arguments.deadline_ms:
        wanted = f"{arguments.deadline_ms:g} ms are allowed. Make it quicker, or give the study a longer deadline."
        print(f"kitchenmind agent check: {arguments.name} is too slow: {wanted}", file=sys.stderr)
        return 1
    print("it can be used")
    return 0


def check_policy(policy: Policy, mode: Mode, layout: Layout) -> AgentFinding:
    """Run an agent on states of random games. Raises NotFit, and whatever the agent raises."""
    states, _ = random_games(layout)

    def ask(games: int, timestep: int) -> NDArray[np.float32]:
        answer = _of_chef(policy, states[:games, timestep].copy())
        return distribution(answer, np.zeros(games, np.int32), mode)

    return _finding(ask, states.shape[1])


def check_predictor(predictor: Predictor, layout: Layout) -> AgentFinding:
    """Run a predictor on random games. Raises NotFit, and whatever the predictor raises."""
    states, actions = random_games(layout)

    def ask(games: int, timestep: int) -> NDArray[np.float32]:
        slots = np.arange(games, dtype=np.intp)
        if timestep == 0:
            predictor.begin(slots)
        asked = slots, states[:games, timestep].copy(), actions[:games, timestep]
        answer = _fitting(lambda: checked_predictions(predictor.predict(*asked), games))
        _fitting(lambda: checked_intentions(predictor, *asked))
        return answer

    return _finding(ask, states.shape[1])


def points_with_itself(policy: Policy, mode: Mode, layout: Layout) -> int:
    """Return the points of one episode of self-play, in the agent's mode. Raises NotFit, and whatever the agent
    raises."""
    kitchens, events, draws = Kitchens.start(layout), np.zeros((1, PLAYERS), np.int32), np.random.default_rng(0)
    stuck = [Stuck(kitchens.players[:, seat]) for seat in range(PLAYERS)]
    points = 0
    for _ in range(HORIZON):
        seen = kitchens.encode()
        given = [_of_chef(policy, seen[:, k].copy()) for k in range(PLAYERS)]
        actions = [draw(distribution(given[k], stuck[k].counts, mode), draws.random(1)) for k in range(PLAYERS)]
        kitchens.step(np.stack(actions, 1), events)
        for seat in range(PLAYERS):
            stuck[seat].update(kitchens.players[:, seat])
        points += sum(sparse_reward(int(event)) for event in events[0])
    return points


def random_games(layout: Layout, games: int = 32, timesteps: int = 40) -> tuple[Observations, NDArray[np.int8]]:
    """Return states (games, timesteps, width, height, 26) as the first chef sees them, and the joint actions that led
    there."""
    draws, kitchens = np.random.default_rng(0), Kitchens.start(layout, games)
    events = np.zeros((games, PLAYERS), np.int32)
    actions = draws.integers(0, ACTIONS, (timesteps, games, PLAYERS)).astype(np.int8)
    states = []
    for joint in actions:
        states.append(kitchens.encode()[:, 0])
        kitchens.step(joint, events)
    before = np.concatenate([np.full((1, games, PLAYERS), -1, np.int8), actions[:-1]])
    return np.stack(states, 1), np.ascontiguousarray(before.swapaxes(0, 1))


def _finding(ask: Callable[[int, int], NDArray[np.float32]], timesteps: int) -> AgentFinding:
    rounds: list[list[NDArray[np.float32]]] = []
    times = []
    for _ in range(2):
        answers = []
        for timestep in range(timesteps):
            began = time.perf_counter()
            answers.append(ask(1, timestep))
            times.append(1000 * (time.perf_counter() - began))
        rounds.append(answers)
    ask(32, 0)
    began = time.perf_counter()
    ask(32, 1)
    batch_ms = 1000 * (time.perf_counter() - began)
    same = all(np.array_equal(one, other) for one, other in zip(*rounds, strict=True))
    certain = np.mean([answer.max(-1) > 0.999 for answer in rounds[0]])
    warm = times[timesteps // 2 :]  # the first calls of a network are slow; the server also warms it up
    return AgentFinding(float(np.median(warm)), max(warm), batch_ms, same, float(certain))


def _of_chef(policy: Policy, seen: Observations) -> NDArray[np.float32]:
    return _fitting(lambda: checked_probabilities(policy.probabilities(seen), len(seen)))


def _fitting(checked: Callable[[], Checked]) -> Checked:
    """Return an answer that the server would accept, too. Raises NotFit."""
    try:
        return checked()
    except WrongOutput as error:
        raise NotFit(f"it {error}. See docs/guides/bring_your_own_agent.md.") from None


def _warn(words: str) -> None:
    print(f"warning: {words}", file=sys.stderr)


def _say(what: str, value: str) -> None:
    print(f"  {what:14} {value}")
