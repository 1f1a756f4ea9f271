"""History for two charts: the lateness of ticks, sampled here, and the number of people, from the database."""

import asyncio
import time
from collections import deque
from collections.abc import Sequence
from datetime import datetime
from typing import Any, Final

from sqlalchemy import Connection, select

from server.monitoring.live_games import LiveGames
from server.store import overview
from server.store.tables import participants

SAMPLE_S: Final = 5.0
KEPT: Final = 720  # samples: an hour
MAX_POINTS: Final = 300


class LatencyHistory:
    """Samples for as long as the server runs; made once in server.main."""

    def __init__(self, live: LiveGames) -> None:
        self._live = live
        self._rows: deque[tuple[float, int, float | None, float | None]] = deque(maxlen=KEPT)

    async def run(self) -> None:
        """Sample every few seconds, until this is cancelled."""
        while True:
            self.sample(time.time())
            await asyncio.sleep(SAMPLE_S)

    def sample(self, now: float) -> None:
        """Sample the lateness of ticks since the last sample: median and 99th percentile."""
        loop = self._live.games.loop
        late = loop.lateness.last(SAMPLE_S) if loop.moving else []
        p50, p99 = (late[int(part * len(late))] for part in (0.5, 0.99)) if late else (None, None)
        self._rows.append((now, loop.moving, p50, p99))

    def to_columns(self) -> dict[str, list[Any]]:
        """Return columns of the same length, oldest first; null if no game was running."""
        columns = list(zip(*self._rows, strict=True)) or [(), (), (), ()]
        at, games, p50, p99 = columns
        return {"at": [round(x) for x in at], "games": list(games), "p50_ms": _rounded(p50), "p99_ms": _rounded(p99)}


def _rounded(values: Sequence[float | None]) -> list[float | None]:
    return [None if value is None else round(value, 2) for value in values]


def people(connection: Connection, study_ids: Sequence[int]) -> dict[str, list[int]]:
    """Return how many people (in a rehearsal: bots) had consented and completed at each moment, as columns; at most
    MAX_POINTS moments."""
    p = participants.c
    group = overview.group_to_show(connection, study_ids)
    rows = connection.execute(select(p.started_at, p.completed_at).where(group.members())).all()
    moments = [(row.started_at, 0) for row in rows] + [(row.completed_at, 1) for row in rows if row.completed_at]
    counts, points = [0, 0], []
    for moment, kind in sorted(moments):
        counts[kind] += 1
        points.append((_seconds(moment), *counts))
    step = max(1, -(-len(points) // MAX_POINTS))
    kept = points[::-1][::step][::-1]  # the last one is always kept
    return {name: [point[place] for point in kept] for place, name in enumerate(("at", "consented", "completed"))}


def _seconds(moment: datetime) -> int:
    return round(moment.timestamp())
