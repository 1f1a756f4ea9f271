"""The models of a draft's preview. Those of a kitchen that a draft draws are separate from all others: another kitchen
of the same name may be in use by participants, and the grid changes while it is drawn. So are those that no study of
this server has loaded: they end after the preview.
"""

import asyncio
import hashlib
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Final

from models.inference.runner import ModelServer
from models.inference.supervised_worker import ModelsDown
from models.inference.wire import APART
from server.participation.episode_specs import layout_of
from server.required_models import required_models
from server.study.definition import KitchenChoice
from server.study.loader import StudyError, StudyFile

IDLE_S: Final = 300.0  # after which the separate models of a kitchen that nobody plays in end


class PreviewModels:
    """Loads the models of a round of a preview."""

    def __init__(self, models: ModelServer, idle_s: float = IDLE_S) -> None:
        self._models, self._idle_s = models, idle_s
        self._idle: dict[str, asyncio.TimerHandle] = {}  # kitchens of drafts in which nobody plays
        self._games: Counter[str] = Counter()
        self._ending: set[asyncio.Task[None]] = set()
        self._loading = asyncio.Lock()

    async def load(self, file: StudyFile, kitchen: KitchenChoice) -> str:
        """Load the study's models for one of its kitchens; return the name under which that kitchen's models are
        called. Raises StudyError."""
        required = required_models([file])
        here = [[one for one in names if one[0] == kitchen.name] for names in (required.agents, required.predictors)]
        checkpoints = file.study.checkpoints
        if kitchen.grid is None and not checkpoints and self._models.has(*here):
            return kitchen.name
        grid = layout_of(kitchen).text
        layout = f"{kitchen.name}{APART}{_digest(grid, *sorted(checkpoints.items()))}"
        agents, predictors = ([(layout, model) for _, model in names] for names in here)
        async with self._loading:
            await self._drop(*(other for other in self._idle if other != layout))
            try:
                await self._models.add(agents, predictors, {layout: grid}, required.paths)
            except ModelsDown as error:
                raise StudyError([f"{file.source}: {error}"]) from error
            if not self._games[layout]:
                self._wait(layout)
        return layout

    @asynccontextmanager
    async def playing(self, file: StudyFile, kitchen: KitchenChoice) -> AsyncIterator[str]:
        """Keep the models of a kitchen loaded while a round is played in it, like `load`."""
        layout = await self.load(file, kitchen)
        if layout == kitchen.name:
            yield layout
            return
        self._games[layout] += 1
        self._stop_waiting(layout)
        try:
            yield layout
        finally:
            self._games[layout] -= 1
            if not self._games[layout]:
                self._wait(layout)

    def _wait(self, layout: str) -> None:
        """End the models of a kitchen unless somebody plays in it soon."""
        self._stop_waiting(layout)
        self._idle[layout] = asyncio.get_running_loop().call_later(self._idle_s, self._end, layout)

    def _stop_waiting(self, layout: str) -> bool:
        """Return whether nobody played in the kitchen."""
        timer = self._idle.pop(layout, None)
        if timer is not None:
            timer.cancel()
        return timer is not None

    def _end(self, layout: str) -> None:
        task = asyncio.create_task(self._drop_alone(layout))
        self._ending.add(task)
        task.add_done_callback(self._ending.discard)

    async def _drop_alone(self, layout: str) -> None:
        async with self._loading:
            await self._drop(layout)

    async def _drop(self, *layouts: str) -> None:
        for layout in layouts:
            if self._stop_waiting(layout):
                await self._models.drop(layout)


def _digest(grid: str, *checkpoints: tuple[str, str]) -> str:
    return hashlib.sha256("\n".join((grid, *map("".join, checkpoints))).encode()).hexdigest()[:12]
