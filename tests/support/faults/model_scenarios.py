"""Models that are slow, failing or gone (rows 23, 24), in real worker processes; games continue, and the data record
it.
"""

import asyncio
import os
from itertools import pairwise
from pathlib import Path
from unittest.mock import patch

from sqlalchemy import select

from overcooked.constants import STAY
from server.store.database import Database
from server.store.tables import ticks
from tests.support.faults.fault_scenario import FaultResult, rounded
from tests.support.faults.group import LONG_STUDY, ClientGroup
from tests.support.faults.invariants import held_against, lateness_ms, p99
from tests.support.live_server import LiveServer

ROOT = Path(__file__).parents[3]


async def faulty(folder: Path, model: str, seconds: float, games: int = 3) -> FaultResult:
    """All partners are played by `model` of faulty_models."""
    study = LONG_STUDY.replace(
        "agents: [{name: planner, predictor: sp_predictor_stream}]",
        f'agents: [{{name: mine, model: "tests.support.faults.faulty_models:{model}", predictor: random}}]',
    )
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
    with (
        patch.dict(os.environ, PYTHONPATH=path),
        LiveServer(folder, study=study, speed=1.0, real_models=True) as live,
    ):
        async with ClientGroup(live.url, games, idle=0.8) as group:
            await asyncio.sleep(seconds)
        found = held_against(live.database, group.clients)
        ended = sum(len(one.log.ended) for one in group.clients)
        counts = await asyncio.to_thread(_partners, live.database)
        late_p99 = p99(lateness_ms(live.database))
    figure = found.figures() | counts | {"games_ended": ended, "late_p99_ms": rounded(late_p99)}
    passed = found.ok and not ended and counts["waits_without_flag"] == 0 and counts["flagged"] > 0
    row = 23 if model == "Slow" else 24
    return FaultResult(row, f"agent of the kind {model}", games, passed, figure)


def _partners(url: str) -> dict[str, int]:
    """In how many timesteps the partner had no answer in time, and whether each is flagged and was waited out."""
    query = select(ticks).order_by(ticks.c.episode_id, ticks.c.timestep)
    with Database(url, read_only=True) as database:
        rows = database.read_now(lambda connection: connection.execute(query).all())
    counts = {"timesteps": len(rows), "flagged": 0, "waits_without_flag": 0, "moved_without_answer": 0}
    for before, row in pairwise(rows):
        counts["flagged"] += bool(before.late)
        if before.next_action_1 is None and before.episode_id == row.episode_id:
            counts["waits_without_flag"] += not before.late
            counts["moved_without_answer"] += row.action_1 != STAY
    return counts
