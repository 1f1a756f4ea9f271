"""`kitchenmind replay`: re-simulate action logs to states. It needs the rules only, not the agents."""

import argparse
import gzip
import json
import sys
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from io import BufferedIOBase
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from overcooked.constants import ACTIONS, PLAYERS
from overcooked.layout import Layout, bundled_layout, parse_layout
from overcooked.recorded_games import RecordedGames
from overcooked.score import shaped_reward, sparse_reward
from overcooked.state import Kitchens, Record
from overcooked.trajectory import TrajectoryError, trajectories_in, write_trajectories

JointActions = list[list[int]]
_ACTION_MEANINGS = "an action is 0 N, 1 S, 2 E, 3 W, 4 stay or 5 interact"


class ReplayError(ValueError):
    """An action log that cannot be replayed; the message says where and why."""


@dataclass(frozen=True)
class RecordedEpisode:
    """What determines an episode: its layout and the joint actions."""

    layout: Layout
    joint_actions: JointActions


@dataclass(frozen=True)
class Replay:
    """The result of an episode: one state more than joint actions, and the rewards by chef."""

    states: list[Record]
    rewards: list[list[int]]
    shaped: list[list[int]]


def simulate(episode: RecordedEpisode) -> Replay:
    """Simulate an episode from the standard start. States: `Kitchens.record` and `crc`, zlib.crc32 of each chef's
    view."""
    kitchen, events = Kitchens.start(episode.layout), np.zeros((1, PLAYERS), np.int32)
    replay = Replay([_seen(kitchen)], [], [])
    for joint_action in episode.joint_actions:
        kitchen.step(np.array([joint_action]), events)
        replay.states.append(_seen(kitchen))
        replay.rewards.append([sparse_reward(bits) for bits in events[0].tolist()])
        replay.shaped.append([shaped_reward(bits) for bits in events[0].tolist()])
    return replay


def _seen(kitchen: Kitchens) -> Record:
    return {**kitchen.record(), "crc": [zlib.crc32(view.tobytes()) for view in kitchen.encode()[0]]}


def read_episodes(path: Path) -> Iterator[RecordedEpisode]:
    """Read the episodes of a file, one at a time: JSON lines, or (`.json`) trajectories of overcooked_ai; `.gz` or not.

    A line is {"layout": grid with newlines, or a name, "joint_actions": [[a0, a1], ...]}, or belongs to a recorded game
    (`overcooked.recorded_games`), whose states are compared. Raises ReplayError, TrajectoryError, OSError.
    """
    is_packed, count = path.suffix == ".gz", 0
    with gzip.open(path, "rb") if is_packed else path.open("rb") as file:
        try:
            for episode in episodes_in(file, str(path)):
                yield episode
                count += 1
        except (EOFError, zlib.error) as error:
            raise ReplayError(f"{path}: the file is incomplete or damaged ({error}). Copy it again.") from None
    if not count:
        raise ReplayError(f"{path}: the file has no episodes. Give a file with recorded games.")


def episodes_in(file: BufferedIOBase, name: str) -> Iterator[RecordedEpisode]:
    """Read the episodes of an open file, as `read_episodes`; `name` decides the format and is used in errors."""
    if Path(name.removesuffix(".gz")).suffix == ".json":
        for layout, joint_actions in trajectories_in(file.read(), name):
            yield RecordedEpisode(layout, joint_actions)
        return
    recorded = RecordedGames()
    for number, line in enumerate(file, start=1):
        try:
            fields = _fields_of(line)
            if "k" not in fields:
                yield _episode_of(fields)
            elif ended := recorded.add(fields):
                yield RecordedEpisode(*ended)
        except (ValueError, OSError) as error:
            raise ReplayError(f"{name}, line {number}: {error}") from None
    if ended := recorded.end():
        yield RecordedEpisode(*ended)


def _fields_of(line: bytes) -> dict[str, Any]:
    try:
        fields = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise ReplayError(f"this is not JSON ({error}). Write one JSON object per line.") from None
    if not isinstance(fields, dict):
        raise ReplayError('a line is an object with "layout" and "joint_actions"')
    return fields


def _episode_of(fields: dict[str, Any]) -> RecordedEpisode:
    layout, joint_actions = fields.get("layout"), fields.get("joint_actions")
    if not isinstance(layout, str):
        raise ReplayError('"layout" must be a text: a grid with newlines, or the name of a layout')
    if not isinstance(joint_actions, list):
        raise ReplayError('"joint_actions" must be a list of pairs of actions')
    for timestep, joint_action in enumerate(joint_actions):
        if not _is_joint_action(joint_action):
            raise ReplayError(
                f"joint action {timestep} is {json.dumps(joint_action)[:80]}; {_ACTION_MEANINGS}, two a timestep"
            )
    return RecordedEpisode(parse_layout(layout) if "\n" in layout else bundled_layout(layout), joint_actions)


def _is_joint_action(value: object) -> bool:
    return (
        isinstance(value, list)
        and len(value) == PLAYERS
        and all(type(action) is int and 0 <= action < ACTIONS for action in value)
    )


def write_replays(source: Path, target: Path) -> int:
    """Replay every episode of `source` to a line of `target`; return how many. `target` is written completely or not at
    all."""
    count = 0
    with _whole_or_nothing(target) as lines:
        for episode in read_episodes(source):
            lines.write(json.dumps(asdict(simulate(episode)), separators=(",", ":")) + "\n")
            count += 1
    return count


@contextmanager
def _whole_or_nothing(target: Path) -> Iterator[TextIO]:
    """Open a file that gets its name only when everything has been written."""
    partial = target.with_name(target.name + ".partial")
    try:
        with partial.open("w", encoding="utf-8") as file:
            yield file
        partial.replace(target)
    finally:
        partial.unlink(missing_ok=True)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "source",
        type=Path,
        metavar="IN",
        help="one episode per line, or a recorded game with a state per line (.jsonl), or overcooked_ai's trajectories "
        "of any generation (.json); also packed (.gz)",
    )
    parser.add_argument(
        "--states", type=Path, metavar="OUT.jsonl", help="write states and rewards, one episode per line"
    )
    parser.add_argument(
        "--trajectories", type=Path, metavar="OUT.json", help="write overcooked_ai's trajectory format to this file"
    )


def run(arguments: argparse.Namespace) -> int:
    """Return the exit status: 0 written, 2 wrong input (then nothing is written)."""
    source, states, trajectories = arguments.source, arguments.states, arguments.trajectories
    try:
        if states is None and trajectories is None:
            raise ReplayError("nothing to write: give --states OUT.jsonl or --trajectories OUT.json")
        if source.resolve() in [target.resolve() for target in (states, trajectories) if target]:
            raise ReplayError(f"{source} would be overwritten: give another name to write to")
        if states and trajectories and states.resolve() == trajectories.resolve():
            raise ReplayError(f"{states} is given for both --states and --trajectories: give two names")
        if states is not None:
            print(f"{write_replays(source, states)} episodes replayed to {states}")
        if trajectories is not None:
            played = ((episode.layout, episode.joint_actions) for episode in read_episodes(source))
            with _whole_or_nothing(trajectories) as file:
                print(f"{write_trajectories(played, file)} episodes written to {trajectories}")
    except (ReplayError, TrajectoryError, OSError) as error:
        print(f"kitchenmind replay: {error}", file=sys.stderr)
        return 2
    return 0
