"""Apply the quality rules to ended episodes, a few at a time, so that games are not delayed."""

import asyncio
import importlib
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from sqlalchemy import Connection

from server.store.database import Database

if TYPE_CHECKING:
    from server.export.quality_inputs import Key

AT_ONCE: Final = 4  # episodes of a call
A_LOOK: Final = 24  # episodes of a look


@dataclass(frozen=True)
class EpisodeQuality:
    """`proposal`: keep, look or drop. `rules`: the names of the rules that apply."""

    proposal: str
    rules: str


class DataQuality:
    """Keeps the results; one per server."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._known: dict[str, tuple[set[Key], EpisodeQuality]] = {}  # by episode, with a key for each of its people
        self._checking = asyncio.Lock()

    async def check_new(self, study_ids: tuple[int, ...]) -> int:
        """Check some that are new, latest first; return how many are still to be checked. Raises DatabaseDown."""
        async with self._checking:
            keys: dict[str, set[Key]] = {}
            for key in await self._database.read(_over, study_ids):
                keys.setdefault(key[0], set()).add(key)
            new = [episode for episode, its_keys in keys.items() if self._is_new(episode, its_keys)]
            for start in range(0, min(A_LOOK, len(new)), AT_ONCE):
                some = new[start : start + AT_ONCE]
                found = await self._database.read(_proposals, some)
                self._known |= {each: (keys[each], found.get(each, EpisodeQuality("keep", ""))) for each in some}
            return max(0, len(new) - A_LOOK)

    def of(self, episode: str) -> EpisodeQuality | None:
        """Return the result for an episode; None if it is not over or not checked yet."""
        known = self._known.get(episode)
        return known[1] if known else None

    def by_person(self) -> dict[str, Counter[str]]:
        """Return how often each participant's episodes were proposed to be kept, looked at or dropped."""
        found: dict[str, Counter[str]] = {}
        for keys, one in self._known.values():
            for _, person, _ in keys:
                found.setdefault(person, Counter())[one.proposal] += 1
        return found

    def _is_new(self, episode: str, keys: "set[Key]") -> bool:
        known = self._known.get(episode)
        return known is None or known[0] != keys


def load_rules() -> None:
    """Import the analysis (0.8 s): done at the first dashboard instead, it would delay running games by 40 ms."""
    importlib.import_module("analysis.episode_quality")
    importlib.import_module("server.export.quality_inputs")


def _over(connection: Connection, study_ids: tuple[int, ...]) -> "list[Key]":
    from server.export import quality_inputs  # inside the function: the server starts faster without polars

    return quality_inputs.over(connection, study_ids)


def _proposals(connection: Connection, episodes: list[str]) -> dict[str, EpisodeQuality]:
    from analysis.episode_quality import episode_proposals
    from server.export import quality_inputs

    tables: dict[str, Any] = quality_inputs.tables(connection, episodes)
    return {episode: EpisodeQuality(*proposal) for episode, proposal in episode_proposals(tables, episodes).items()}
