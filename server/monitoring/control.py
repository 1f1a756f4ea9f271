"""What a researcher does to running games: pause, go on, end, tell, give more time. Its callers write the audit log."""

import asyncio
from collections.abc import Sequence
from contextlib import suppress
from typing import Final

from server.background_tasks import ended
from server.participation.served_studies import Studies
from server.play.game import Game
from server.play.games import Games
from server.play.messages import Notice
from server.play.pause_reasons import RESEARCHER
from server.store import decisions, overview
from server.store.database import Database, DatabaseDown

LOOK_EVERY_S: Final = 0.25  # the countdown takes 3 s, so no game of a paused study gets to move
BUSY_S: Final = 3.0


class Control:
    """The researchers' hand on the games; made once in server.main."""

    def __init__(self, games: Games, database: Database, studies: Studies) -> None:
        self._games, self._database, self._studies = games, database, studies
        self._paused: dict[str, tuple[int, ...]] = {}  # study -> its versions
        self._checked: dict[str, int] = {}  # episode -> version, of games seen while a study is paused
        self._keeper: asyncio.Task[None] | None = None

    async def begin(self) -> None:
        """Takes up the pauses that were on when the server stopped."""
        for study in await self._database.read(decisions.paused_studies):
            self.pause_study(study)

    async def stop(self) -> None:
        await ended(self._keeper)

    def pause(self, episode: str) -> bool:
        """The game stands still until `resume`. False: it does not run here."""
        game = self._running(episode)
        if game is not None:
            game.pause(RESEARCHER, "researcher")
        return game is not None

    def resume(self, episode: str) -> bool:
        game = self._running(episode)
        if game is not None:
            game.release(RESEARCHER)
            game.tell_paused()
        return game is not None

    def tell(self, episode: str, text: str) -> bool:
        """Shows the words to the participant. False: nobody is there to read them."""
        game = self._running(episode)
        if game is not None:
            game.broadcast(Notice(text))
        return game is not None and bool(game.connections)

    def extend(self, episode: str, seconds: float) -> bool:
        """The participant may be away so much longer in this game."""
        game = self._running(episode)
        if game is not None:
            game.session.pause_reasons.extend(seconds)
            game.tell_paused()
        return game is not None

    async def end(self, episode: str, reason: str = "researcher") -> bool:
        """Ends the game; what was played stays stored. False: it does not run here, or the database is away."""
        game = self._running(episode)
        if game is None:
            return False
        game.pause(RESEARCHER, "researcher")
        try:
            async with asyncio.timeout(BUSY_S):
                while game.busy:
                    await asyncio.sleep(0.01)
        except TimeoutError:
            return False
        self._games.abort(game, reason)
        return True

    async def end_all(self, episodes: Sequence[str], reason: str = "withdrawn") -> None:
        """Ends those of the games that run here, and returns when their ends are stored (or the database is away)."""
        ended = [episode for episode in episodes if await self.end(episode, reason)]
        with suppress(TimeoutError):
            async with asyncio.timeout(BUSY_S):
                while any(self._games.get(episode) is not None for episode in ended):
                    await asyncio.sleep(0.01)

    # Whole studies

    def pause_study(self, study: str) -> None:
        """Its games stand still, and those that are taken up later too."""
        self._paused[study] = self._studies.versions(study)
        if self._keeper is None or self._keeper.done():
            self._keeper = asyncio.create_task(self._keep())

    async def resume_study(self, study: str) -> None:
        versions = self._paused.pop(study, ())
        for game in await self._of(versions):
            self.resume(game.episode)

    async def episodes_of(self, study: str) -> list[str]:
        """The running games of a study."""
        return [game.episode for game in await self._of(self._studies.versions(study))]

    async def _keep(self) -> None:
        while self._paused:
            try:
                for game in await self._of(tuple(number for versions in self._paused.values() for number in versions)):
                    if game.session.phase != "ended" and RESEARCHER not in game.session.pause_reasons:
                        game.pause(RESEARCHER, "researcher")
            except DatabaseDown:
                pass  # then no game runs anyway
            await asyncio.sleep(LOOK_EVERY_S)
        self._checked.clear()

    async def _of(self, versions: tuple[int, ...]) -> list[Game]:
        games = {game.episode: game for game in self._games}
        unknown = [episode for episode in games if episode not in self._checked]
        if unknown:
            found = await self._database.read(overview.played, *unknown)
            self._checked |= {episode: played.study_id for episode, played in found.items()}
        self._checked = {episode: version for episode, version in self._checked.items() if episode in games}
        return [game for episode, game in games.items() if self._checked.get(episode) in versions]

    def _running(self, episode: str) -> Game | None:
        game = self._games.get(episode)
        return None if game is None or game.session.phase == "ended" else game
