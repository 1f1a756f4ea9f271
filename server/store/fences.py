"""One owner for each game where several processes serve one PostgreSQL: a number that grows with every owner, checked
in the transaction of every tick. A process with an older number can no longer store anything.

An owner locks its episodes' rows as a foreign key does (KEY SHARE, which the ticks need anyway); taking a game up locks
the row alone (UPDATE). So a commit is either whole before the game is taken up, or it sees the new number.
"""

import asyncio
from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy import Connection, select, update

from server.play.recorder import (
    EpisodeRecord,
    EpisodeResult,
    GamesLost,
    InputRecord,
    PauseRecord,
    RecorderDown,
    TickRecord,
)
from server.store import episodes as stored
from server.store import inputs as input_rows
from server.store import ticks as tick_rows
from server.store.database import Database, DatabaseDown
from server.store.store_recorder import PATIENCE_S, StoreRecorder, TickConflict
from server.store.tables import episodes

Fences = Mapping[str, int]  # episode -> the number of its owner


def take(connection: Connection, episode_id: str) -> tuple[int, EpisodeRecord] | None:
    """Make the caller the episode's owner: the new number, and the episode as the owner before left it."""
    here = episodes.c.id == episode_id
    before = connection.execute(select(episodes.c.fence).where(here).with_for_update()).scalar()
    record = None if before is None else stored.load(connection, episode_id)
    if before is None or record is None:
        return None
    connection.execute(update(episodes).where(here).values(fence=before + 1))
    return before + 1, record


def current(connection: Connection, episode_id: str) -> int | None:
    """Return the number of the episode's owner; None where there is no such episode."""
    return connection.execute(select(episodes.c.fence).where(episodes.c.id == episode_id)).scalar()


def held(connection: Connection, fences: Fences) -> tuple[set[str], set[str]]:
    """Return the episodes that are still owned with these numbers, and stay so until the transaction ends; and those
    that another process has taken up. Episodes that were deleted are in neither."""
    query = select(episodes.c.id, episodes.c.fence).where(episodes.c.id.in_(sorted(fences))).order_by(episodes.c.id)
    found = {row.id: row.fence for row in connection.execute(query.with_for_update(read=True, key_share=True))}
    mine = {episode for episode, fence in found.items() if fence == fences[episode]}
    return mine, found.keys() - mine


def store_ticks(
    connection: Connection, records: Sequence[TickRecord], fences: Fences
) -> tuple[set[str], tuple[tuple[str, int], ...]]:
    """Store the ticks of games that are still owned: the episodes that are not, and the conflicts (`ticks.insert`)."""
    mine, lost = held(connection, fences)
    return lost, tick_rows.insert(connection, [record for record in records if record.episode in mine])


class FencedRecorder(StoreRecorder):
    """`StoreRecorder` of one process among several. Raises GamesLost for games that another process took up."""

    def __init__(self, database: Database, patience_s: float = PATIENCE_S) -> None:
        super().__init__(database, patience_s)
        self._fences: dict[str, int] = {}

    async def take(self, episode: str) -> EpisodeRecord | None:
        """Take over the episode and return it. Raises RecorderDown."""
        taken: tuple[int, EpisodeRecord] | None = await self._guarded(self._database.write(take, episode))
        if taken is None:
            return None
        self._fences[episode], record = taken
        return record

    async def still_mine(self, episode: str) -> bool:
        """Return whether no other process has taken the game up. Raises RecorderDown."""
        mine = self._fences.get(episode)
        return mine is not None and await self._guarded(self._database.read(current, episode)) == mine

    def fence(self, episode: str) -> int:
        """Return the number with which this process owns a game; 0: it does not."""
        return self._fences.get(episode, 0)

    def let_go(self, episode: str) -> None:
        """Give up a game that is over or belongs to another process."""
        self._fences.pop(episode, None)

    async def ticks(self, records: Sequence[TickRecord]) -> None:
        fences = {record.episode: self.fence(record.episode) for record in records}
        lost, conflicts = await self._write(store_ticks, records, fences)
        if conflicts:
            raise TickConflict(f"other ticks are stored already (episode, timestep): {conflicts}")
        if lost:
            raise GamesLost(lost)

    async def pause(self, record: PauseRecord) -> None:
        """Store a pause, unless another process owns the game now: its owner knows better."""
        await self._write(_if_held, record.episode, self.fence(record.episode), stored.pause, record)

    async def inputs(self, episode: str, records: Sequence[InputRecord]) -> None:
        """As for pauses."""
        await self._write(_if_held, episode, self.fence(episode), input_rows.insert_of_known, episode, records)

    async def end(self, result: EpisodeResult) -> None:
        if not await self._write(_if_held, result.episode, self.fence(result.episode), stored.end, result):
            raise GamesLost({result.episode})

    async def _guarded(self, work: Any) -> Any:
        try:
            async with asyncio.timeout(self._patience_s):
                return await work
        except TimeoutError:
            raise RecorderDown(f"the database did not answer within {self._patience_s} s") from None
        except DatabaseDown as down:
            raise RecorderDown(str(down)) from down


def _if_held(connection: Connection, episode: str, fence: int, store: Any, *arguments: Any) -> bool:
    """Return false: another process has taken the game up, nothing was stored."""
    mine, lost = held(connection, {episode: fence})
    if mine:
        store(connection, *arguments)
    return not lost
