"""Recorded games that a researcher opens from a file: simulated again by the rules, shown, and never stored.

A separate process reads the file, so that no running game waits for it. `python -m server.monitoring.opened_games
NAME` with the file at its input prints the records.
"""

import asyncio
import gzip
import io
import json
import os
import subprocess
import sys
import zlib
from typing import Any, Final

from overcooked.constants import STAY
from overcooked.replay import RecordedEpisode, ReplayError, episodes_in
from overcooked.trajectory import TrajectoryError
from server.monitoring.low_priority import start_module
from server.play.simulation import SimulatedStep, Simulation

MAX_BYTES: Final = 32 * 1024 * 1024  # of a file, packed or not
MAX_TIMESTEPS: Final = 30_000
TICK_MS: Final = 200  # how fast they are shown; files do not say how fast they were played
_TIMEOUT_S: Final = 60.0
_NICE: Final = 10
_PROGRAM: Final = "server.monitoring.opened_games"
_MAX_MESSAGE: Final = 2000


class UnreadableGamesError(ValueError):
    """The file has no games that follow these rules; the message says where and what to do."""


async def opened(data: bytes, name: str) -> bytes:
    """Return the records of the file's episodes as a JSON list. Raises UnreadableGamesError."""
    pipe = subprocess.PIPE
    process = await asyncio.to_thread(start_module, _PROGRAM, name, standard_input=pipe, output=pipe, errors=pipe)
    try:
        records, words = await asyncio.to_thread(process.communicate, data, _TIMEOUT_S)
    except subprocess.TimeoutExpired:
        raise UnreadableGamesError(f"{name}: this takes too long. Open a file with fewer games.") from None
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()
    if process.returncode:
        message = words.decode(errors="replace").strip()[-_MAX_MESSAGE:]
        raise UnreadableGamesError(message or f"{name}: it cannot be read. Open a file with recorded games.")
    return records


def records_of(data: bytes, name: str) -> list[dict[str, Any]]:
    """Return what the replay page needs of each episode. Raises UnreadableGamesError."""
    try:
        episodes = list(episodes_in(io.BytesIO(_unpacked(data, name)), name))
    except (ReplayError, TrajectoryError) as error:
        raise UnreadableGamesError(str(error)) from None
    if not episodes:
        raise UnreadableGamesError(f"{name}: there is no episode in this file. Open a file with recorded games.")
    timesteps = sum(len(episode.joint_actions) for episode in episodes)
    if timesteps > MAX_TIMESTEPS:
        raise UnreadableGamesError(
            f"{name}: {timesteps} timesteps are more than a page can show ({MAX_TIMESTEPS}). Open a part of the file."
        )
    return [_record(episode, number) for number, episode in enumerate(episodes, start=1)]


def _unpacked(data: bytes, name: str) -> bytes:
    if not name.endswith(".gz"):
        return data
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(data)) as file:
            plain = file.read(MAX_BYTES + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise UnreadableGamesError(f"{name}: this .gz file is incomplete ({error}). Copy it again.") from None
    if len(plain) > MAX_BYTES:
        raise UnreadableGamesError(f"{name}: unpacked, it has more than {MAX_BYTES} bytes. Open a part of it.")
    return plain


def _record(episode: RecordedEpisode, number: int) -> dict[str, Any]:
    length = len(episode.joint_actions)
    simulation = Simulation(episode.layout, length)
    rows = [_row(simulation, None)]
    for first, second in episode.joint_actions:
        rows.append(_row(simulation, simulation.step((first, second))))
    game = {"episode": str(number), "kind": "episode", "grid": episode.layout.grid, "title": episode.layout.name}
    shown = {"seat": -1, "watched_seat": 1, "horizon": length, "tick_ms": TICK_MS, "deadline_ms": 0}
    return {
        "game": game | shown | {"show": "always", "display": "none", "view_radius": 0},
        "status": "done",
        "rows": rows,
        "pauses": [],
        "inputs": [],
        "checked": {"states": len(rows), "equal": True, "difference": None},
        "accuracy": [],
        "intention_accuracy": None,
    }


def _row(simulation: Simulation, step: SimulatedStep | None) -> dict[str, Any]:
    kitchen = simulation.kitchen()
    return {
        "t": simulation.timestep,
        "state": {name: getattr(kitchen, name) for name in kitchen.__struct_fields__},
        "actions": step.actions if step else (STAY, STAY),
        "rewards": step.rewards if step else (0, 0),
        "prediction": [],
        "displayed": [],
        "intentions": [],
        "displayed_intention": None,
        "asked": None,
        "misleading": None,
        "keys": [],
        "late": False,
        "late_ms": 0,
        "models_ms": 0,
    }


def main() -> int:
    """Return exit status 2 with the reason for a file that cannot be shown."""
    os.nice(_NICE)
    try:
        records = records_of(sys.stdin.buffer.read(), sys.argv[1])
    except UnreadableGamesError as error:
        print(error, file=sys.stderr)
        return 2
    sys.stdout.write(json.dumps(records, separators=(",", ":")))
    return 0


if __name__ == "__main__":
    sys.exit(main())
