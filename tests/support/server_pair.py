"""Two server processes with one database and one Redis."""

import asyncio
from typing import Any

from tests.support.live_server import LiveServer
from tests.support.real_server import SHORT_STUDY

PAIR_STUDY = SHORT_STUDY.replace("tutorial, ", "").replace("horizon: 60", "horizon: 2000")
Pair = tuple[LiveServer, LiveServer]


async def until(condition: Any, seconds: float = 20.0) -> Any:
    async with asyncio.timeout(seconds):
        while not (found := condition()):
            await asyncio.sleep(0.02)
        return found
