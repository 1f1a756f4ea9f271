"""Episodes of an export as trajectories in overcooked_ai's own format, one file an episode: its tools load them."""

from functools import lru_cache
from pathlib import Path

from sqlalchemy import select

from overcooked.layout import Layout, parse_layout
from overcooked.trajectory import write_trajectories
from server.export.import_checks import plain_name
from server.export.rows import Selection, episode_ids
from server.store.tables import episodes, ticks

FOLDER = "trajectories"


def write(chosen: Selection, folder: Path) -> int:
    """Write every episode that has a timestep; return how many."""
    (folder / FOLDER).mkdir()
    written = 0
    for episode in episode_ids(chosen):
        here = select(episodes.c.grid, episodes.c.layout).where(episodes.c.id == episode)
        row = chosen.connection.execute(here).one()
        actions = select(ticks.c.action_0, ticks.c.action_1).where(ticks.c.episode_id == episode, ticks.c.timestep > 0)
        played = [list(pair) for pair in chosen.connection.execute(actions.order_by(ticks.c.timestep))]
        if played:
            with (folder / FOLDER / f"{plain_name(episode, 'the episode')}.json").open("w", encoding="utf-8") as file:
                write_trajectories([(_layout(row.grid, row.layout), played)], file)
            written += 1
    return written


@lru_cache(maxsize=64)
def _layout(grid: str, name: str) -> Layout:
    return parse_layout(grid, name)
