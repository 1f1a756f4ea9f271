"""Re-simulate stored episodes and compare everything that the rules determine."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

from sqlalchemy import Connection

from overcooked.layout import Layout, LayoutError, parse_layout
from overcooked.score import progress_credit
from server.export.rows import Selection, episode_ids
from server.play.recorder import EpisodeRecord, TickRecord
from server.play.simulation import Simulation
from server.store import episodes, ticks
from server.store.episodes import BrokenEpisode, StoredEpisode


@dataclass(frozen=True)
class VerificationResult:
    """The result for one episode: what was compared and the first difference, if any."""

    episode: str
    layout: str
    timesteps: int
    difference: str | None = None
    timestep: int | None = None  # of the difference


def verify_all(connection: Connection, study_ids: tuple[int, ...] | None = None) -> Iterator[VerificationResult]:
    """Return the result for every episode of these study versions (None: on all that there are), oldest first."""
    for episode_id in list(episode_ids(Selection(connection, study_ids))):
        yield verify(connection, episode_id)


def verify(connection: Connection, episode_id: str) -> VerificationResult:
    """Play one episode again: every state's hash, rewards and events, then score, soups, progress and final hash."""
    ended = episodes.get(connection, episode_id)
    try:
        record = episodes.load(connection, episode_id)
    except BrokenEpisode as error:
        return VerificationResult(episode_id, ended.layout if ended else "?", 0, str(error))
    if record is None or ended is None:
        return VerificationResult(episode_id, "?", 0, "there is no such episode")
    stored = ticks.of_episode(connection, episode_id)
    if not stored:  # of an episode that ended before its start, nothing is
        lost = "it was played to its end, but no timestep is stored" if ended.status == "done" else None
        return VerificationResult(episode_id, ended.layout, 0, lost, None if lost is None else 0)
    try:
        layout = _layout(record.spec.grid, record.spec.layout)
    except LayoutError as error:
        return VerificationResult(episode_id, ended.layout, 0, f"the stored grid is not a kitchen: {error}")
    simulation = Simulation(layout, record.spec.horizon)
    found = _compare_ticks(simulation, stored) or _compare_end(simulation, record, ended)
    return VerificationResult(episode_id, ended.layout, len(stored) - 1, *(found or (None, None)))


@lru_cache(maxsize=64)
def _layout(grid: str, name: str) -> Layout:
    return parse_layout(grid, name)


def _compare_ticks(simulation: Simulation, stored: list[TickRecord]) -> tuple[str, int] | None:
    for tick in stored:
        if tick.timestep:
            if tick.actions is None:
                return "no joint action is stored", tick.timestep
            step = simulation.step(tick.actions)
            for name in ("rewards", "shaped", "events"):
                if getattr(step, name) != getattr(tick, name):
                    return f"{name} are {getattr(step, name)}, stored is {getattr(tick, name)}", tick.timestep
        if simulation.hash() != tick.state_hash:
            return f"state hash is {simulation.hash()}, stored is {tick.state_hash}", tick.timestep
    return None


def _compare_end(simulation: Simulation, record: EpisodeRecord, ended: StoredEpisode) -> tuple[str, int] | None:
    """Compare the end, if there is one: a running episode has no score yet."""
    if ended.status not in ("done", "aborted"):
        return None
    simulated = {
        "score": simulation.score,
        "soups": simulation.soups,
        "progress": progress_credit(
            simulation.layout, simulation.players(), simulation.contents(), record.spec.progress
        ),
        "final_hash": simulation.hash(),
    }
    for name, value in simulated.items():
        if value != getattr(ended, name):
            return f"{name} is {value}, stored is {getattr(ended, name)}", simulation.timestep
    return None
