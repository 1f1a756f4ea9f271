"""Run researchers' commands on the games of this process. The routes write the audit log."""

import asyncio
import logging
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Final

from server.background_tasks import ended
from server.monitoring.commands import (
    AnyGameCommand,
    Command,
    DismissParticipant,
    EndGame,
    EndGames,
    ExtendAbsence,
    MessageStudy,
    OpenVersion,
    PauseGame,
    PauseStudy,
    PrepareVersion,
    ResumeGame,
    ResumeStudy,
    SendMessage,
)
from server.participation.served_studies import Studies
from server.participation.study_changes import ServedVersion, Versions
from server.play.game import Game
from server.play.games import Games, NoGame
from server.play.messages import Notice
from server.play.pause_reasons import ENDING, RESEARCHER, STUDY, Holder
from server.play.recorder import RecorderDown
from server.store import events, interventions, overview, unplayable_episodes
from server.store.database import Database, DatabaseDown
from server.study.loader import StudyError

log = logging.getLogger(__name__)
LOOK_EVERY_S: Final = 0.25  # the countdown takes 3 s, so no game of a paused study can start
FOLLOW_EVERY_S: Final = 1.0
BUSY_S: Final = 3.0
_REASON: Final = "researcher"  # what participants and the data are told of all pauses by a researcher


class Control:
    """Runs the commands; keeps the games of paused studies paused. Made once in server.main."""

    def __init__(
        self,
        games: Games,
        database: Database,
        studies: Studies,
        versions: Versions | None = None,
        dismiss: Callable[[str], None] = lambda _: None,
    ) -> None:
        """`dismiss` closes the sockets of a participant who was deleted."""
        self._games, self._database, self._studies, self._versions = games, database, studies, versions
        self._dismiss = dismiss
        self._paused: set[str] = set()  # studies
        self._checked: dict[str, int] = {}  # episode -> version, of games seen while a study is paused
        self._keeper: asyncio.Task[None] | None = None
        self._follower: asyncio.Task[None] | None = None

    async def begin(self, shared: bool = False) -> None:
        """Restore the pauses that were in force when the server stopped. `shared`: other processes pause and resume
        studies too, and their commands may be lost."""
        for study in await self._database.read(interventions.paused_studies):
            self._pause_study(study)
        if shared:
            self._follower = asyncio.create_task(self._follow())

    async def stop(self) -> None:
        await ended(self._keeper, self._follower)

    async def run(self, command: Command) -> int:
        """Run a command on the games of this process; return how many games it reached."""
        match command:
            case EndGames(episodes):
                return await self._end_all(episodes)
            case DismissParticipant(participant):
                self._dismiss(participant)
                return 0
            case PauseStudy(study):
                return self._pause_study(study)
            case ResumeStudy(study):
                return self._resume_study(study)
            case MessageStudy(study, text):
                return sum(_show(game, text) for game in await self._of(self._studies.versions(study)))
            case PrepareVersion() | OpenVersion():
                return await self._run_on_versions(command)
            case _:
                game = await self._running(command.episode)
                return 0 if game is None else int(await self._run_on(game, command))

    async def _run_on_versions(self, command: PrepareVersion | OpenVersion) -> int:
        if self._versions is None:
            return 0
        if isinstance(command, OpenVersion):
            return int(self._versions.open(ServedVersion(command.study, command.sha256, command.at)))
        try:
            await self._versions.prepare(self._database, command.study, command.sha256)
        except (StudyError, OSError, DatabaseDown) as error:
            log.warning("the new version of %s cannot be served: %s", command.study, error)
            return 0
        return 1

    async def _run_on(self, game: Game, command: AnyGameCommand) -> bool:
        match command:
            case PauseGame():
                game.pause(RESEARCHER, _REASON)
            case ResumeGame():
                _release(game, RESEARCHER)
            case SendMessage(_, text):
                return _show(game, text)
            case ExtendAbsence(_, seconds):
                _extend(game, seconds)
            case EndGame():
                return await self._end_and_store(game)
        return True

    async def _end(self, game: Game, reason: str) -> bool:
        """End the game. False: its database is away, and the game is as it was."""
        game.pause(ENDING, _REASON)
        try:
            async with asyncio.timeout(BUSY_S):
                while game.busy:
                    await asyncio.sleep(0.01)
        except TimeoutError:
            _release(game, ENDING)
            return False
        self._games.abort(game, reason)
        return True

    async def _end_and_store(self, game: Game) -> bool:
        """End the game for a researcher, who sees next what is stored."""
        ended = await self._end(game, "researcher")
        if ended:
            await self._until_stored([game.episode])
        return ended

    async def _until_stored(self, over: Sequence[str]) -> None:
        """Return when the ends of these games are stored, or the database takes too long."""
        with suppress(TimeoutError):
            async with asyncio.timeout(BUSY_S):
                while any(self._games.get(episode) is not None for episode in over):
                    await asyncio.sleep(0.01)

    async def end_stored(self, episode: str) -> bool:
        """End an episode that no process plays, also one that can no longer be played. False: it is over, or the
        database is away."""
        if self._games.get(episode) is not None:
            return False  # it ends already, or could not be ended a moment ago
        try:
            game = await self._games.open(episode)
        except (NoGame, RecorderDown):
            return False
        except Exception:
            log.exception("episode %s cannot be taken up: it is ended as it is stored", episode)
            try:
                return await self._database.write(unplayable_episodes.end, episode)
            except DatabaseDown:
                return False
        return await self._end_and_store(game)

    async def _end_all(self, episodes: Sequence[str]) -> int:
        """End those of the games that run here; return when their ends are stored (or the database is away)."""
        running = [game for episode in episodes if (game := await self._running(episode)) is not None]
        over = [game.episode for game in running if await self._end(game, "withdrawn")]
        await self._until_stored(over)
        return len(over)

    def _pause_study(self, study: str) -> int:
        """Pause the games of a study, and those that are opened later."""
        self._paused.add(study)
        if self._keeper is None or self._keeper.done():
            self._keeper = asyncio.create_task(self._keep())
        return 0

    def _resume_study(self, study: str) -> int:
        """Let the games of a study continue, without those that a researcher has paused one by one. Nothing is read:
        the process that paused them knows them, and the database may be away."""
        self._paused.discard(study)
        versions = self._studies.versions(study)
        held = [game for game in self._games if STUDY in game.session.pause_reasons]
        mine = [game for game in held if self._checked.get(game.episode) in versions and game.session.phase != "ended"]
        for game in mine:
            _release(game, STUDY)
        return len(mine)

    async def _follow(self) -> None:
        """Pause, resume and extend absences as the database says: a command from another process may have been
        lost."""
        while True:
            await asyncio.sleep(FOLLOW_EVERY_S)
            with suppress(DatabaseDown):  # no game runs then anyway
                await self._follow_studies()
                await self._follow_games()
                await self._follow_absences()

    async def _follow_studies(self) -> None:
        before = set(self._paused)
        stored = await self._database.read(interventions.paused_studies)
        if self._paused != before:
            return  # a command arrived in between, which may be newer than the data read
        for study in stored - before:
            self._pause_study(study)
        for study in before - stored:
            self._resume_study(study)

    async def _follow_games(self) -> None:
        before = {game.episode: RESEARCHER in game.session.pause_reasons for game in self._games}
        stored = await self._database.read(interventions.paused_games, *before) if before else set()
        for game in self._games:
            is_paused = RESEARCHER in game.session.pause_reasons
            if game.session.phase == "ended" or before.get(game.episode) is not is_paused:
                continue  # new here, or a command arrived in between
            if is_paused and game.episode not in stored:
                _release(game, RESEARCHER)
            elif not is_paused and game.episode in stored:
                game.pause(RESEARCHER, _REASON)

    async def _follow_absences(self) -> None:
        here = [game.episode for game in self._games]
        more = await self._database.read(events.more_time_s, *here) if here else {}
        for game in self._games:
            _extend(game, more.get(game.episode, 0.0))

    async def _keep(self) -> None:
        while self._paused:
            try:
                for study in tuple(self._paused):
                    await self._pause_games(study)
            except DatabaseDown:
                pass  # no game runs then anyway
            await asyncio.sleep(LOOK_EVERY_S)
        self._checked.clear()

    async def _pause_games(self, study: str) -> None:
        for game in await self._of(self._studies.versions(study)):
            if study in self._paused and game.session.phase != "ended" and STUDY not in game.session.pause_reasons:
                game.pause(STUDY, _REASON)

    async def _of(self, versions: tuple[int, ...]) -> list[Game]:
        games = {game.episode: game for game in self._games}
        unknown = [episode for episode in games if episode not in self._checked]
        if unknown:
            found = await self._database.read(overview.played, *unknown)
            self._checked |= {episode: played.study_id for episode, played in found.items()}
        self._checked = {episode: version for episode, version in self._checked.items() if episode in games}
        return [game for episode, game in games.items() if self._checked.get(episode) in versions]

    async def _running(self, episode: str) -> Game | None:
        game = await self._games.taken_up(episode)
        return None if game is None or game.session.phase == "ended" else game


def _release(game: Game, holder: Holder) -> None:
    game.release(holder)
    game.tell_paused()


def _extend(game: Game, seconds: float) -> None:
    if game.session.pause_reasons.extend(seconds):
        game.tell_paused()


def _show(game: Game, text: str) -> bool:
    """Show the text to the participant. False: no participant is connected."""
    if game.session.phase == "ended":
        return False
    game.broadcast(Notice(text))
    return bool(game.connections)
