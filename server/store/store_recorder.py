"""The live game's recorder: stores ticks, inputs, pauses and ends of episodes in the database."""

import asyncio
from collections.abc import Sequence
from typing import Any, Final

from sqlalchemy.exc import IntegrityError

from server.play.recorder import EpisodeResult, InputRecord, PauseRecord, RecorderDown, TickRecord
from server.store import episodes
from server.store import inputs as input_rows
from server.store import ticks as tick_rows
from server.store.database import Database, DatabaseDown

PATIENCE_S: Final = 1.0


class TickConflict(Exception):
    """Another tick is stored in this place: two servers play the same episode, or the rules have changed."""


class StoreRecorder:
    """The live game's recorder. What takes longer than `patience_s` counts as RecorderDown, so that the game pauses and
    says so; asking again is safe, as what is stored already is not stored twice."""

    def __init__(self, database: Database, patience_s: float = PATIENCE_S) -> None:
        self._database = database
        self._patience_s = patience_s

    async def ticks(self, records: Sequence[TickRecord]) -> None:
        """Store ticks; drop those of an episode that was deleted (its participant withdrew). Raises TickConflict."""
        try:
            conflicts = await self._write(tick_rows.insert, records)
        except IntegrityError:
            conflicts = await self._write(tick_rows.insert_of_known, records)
        if conflicts:
            places = ", ".join(f"episode {episode} timestep {timestep}" for episode, timestep in conflicts)
            raise TickConflict(f"another tick is stored already: {places}")

    async def pause(self, record: PauseRecord) -> None:
        await self._write(episodes.pause, record)

    async def inputs(self, episode: str, records: Sequence[InputRecord]) -> None:
        await self._write(input_rows.insert_of_known, episode, records)

    async def end(self, result: EpisodeResult) -> None:
        await self._write(episodes.end, result)

    async def _write(self, function: Any, *arguments: Any) -> Any:
        try:
            async with asyncio.timeout(self._patience_s):
                return await self._database.write(function, *arguments)
        except TimeoutError:
            raise RecorderDown(f"the database did not commit within {self._patience_s} s") from None
        except DatabaseDown as error:
            raise RecorderDown(str(error)) from error
