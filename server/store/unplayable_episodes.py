"""End an episode that the server cannot continue, because what is stored of it cannot be simulated again."""

from datetime import UTC, datetime

from sqlalchemy import Connection, select, update

from overcooked.constants import SOUP_DELIVERY
from server.store.tables import episodes, ticks


def end(connection: Connection, episode_id: str) -> bool:
    """End the episode for a researcher; score and soups are those of the stored timesteps, and nothing is known of the
    progress. No process can store more of it. Return false if it was over."""
    t = ticks.c
    query = select(t.reward_0, t.reward_1, t.events_0, t.events_1, t.state_hash).where(t.episode_id == episode_id)
    stored = connection.execute(query.order_by(t.timestep)).all()
    deliveries = [events & SOUP_DELIVERY for row in stored for events in (row.events_0, row.events_1)]
    values = {
        "status": "aborted",
        "end_reason": "researcher",
        "score": sum(row.reward_0 + row.reward_1 for row in stored),
        "soups": sum(map(bool, deliveries)),
        "passed": False,
        "final_hash": stored[-1].state_hash.hex() if stored else None,
        "ended_at": datetime.now(UTC),
        "fence": episodes.c.fence + 1,
    }
    unfinished = (episodes.c.id == episode_id, episodes.c.status.in_(("new", "running")))
    return connection.execute(update(episodes).where(*unfinished).values(values)).rowcount == 1
