"""All games of this server: loaded when a participant connects, ended when they are over, unloaded when unused."""

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable, Coroutine, Iterator
from typing import Any, Final, Literal, Protocol

from models.protocols import Models
from server.play.clock import Clock
from server.play.close_codes import CloseCode
from server.play.game import Connection, Game
from server.play.loop import Loop
from server.play.pause_reasons import RESEARCHER, SERVER
from server.play.recorder import EpisodeRecord, EpisodeResult, GamesLost, Recorder, RecorderDown
from server.play.session import Session

log = logging.getLogger(__name__)
Load = Callable[[str], Awaitable[EpisodeRecord | None]]
AfterEnd = Callable[[EpisodeRecord, EpisodeResult], Awaitable[None]]
KEEP_EVERY_S: Final = 0.25
FORGET_AFTER_S: Final = 120.0  # after this many seconds a game without participants is unloaded; the database has it
STOP_TIMEOUT_S: Final = 5.0
_LOOK_AGAIN_S: Final = 0.002


class NoGame(Exception):
    """There is no such episode, it is over, or the server is stopping."""


class ServerStopping(NoGame):
    """The game continues after the restart, or in another process."""


class Owners(Protocol):
    """Ownership of games if several processes serve. `load` makes this process the owner."""

    async def still_mine(self, episode: str) -> bool:
        """Return whether this process still owns the game. Raises RecorderDown."""
        ...

    def let_go(self, episode: str) -> None:
        """Give up a game that is over, or that another process has taken over."""
        ...


class Games:
    """The live games by episode. `load` reads an episode from the database; `after_end` is called after every stored
    end."""

    def __init__(
        self,
        clock: Clock,
        models: Models,
        recorder: Recorder,
        load: Load,
        after_end: AfterEnd | None = None,
        owners: Owners | None = None,
    ) -> None:
        self.clock = clock
        self.loop = Loop(clock, models, recorder, self._over, self.let_go)
        self._owners = owners
        self._models, self._recorder, self._load, self._after_end = models, recorder, load, after_end
        self._games: dict[str, Game] = {}
        self._records: dict[str, EpisodeRecord] = {}
        self._opening: dict[str, asyncio.Task[Game]] = {}
        self._tasks: set[asyncio.Task[Any]] = set()
        self._keeper: asyncio.Task[None] | None = None
        self.stopping = False
        self.broken: set[str] = set()  # episodes that somebody wants to play and that cannot be taken up

    def __len__(self) -> int:
        return len(self._games)

    def __iter__(self) -> Iterator[Game]:
        return iter(list(self._games.values()))

    def with_recorder(self, recorder: Recorder, load: Load) -> "Games":
        """Return other games with the same clock and models."""
        return Games(self.clock, self._models, recorder, load)

    def get(self, episode: str) -> Game | None:
        """Return the game if it is live here."""
        return self._games.get(episode)

    async def join(self, episode: str, person: int, connection: Connection) -> Game:
        """Handle a page's Hello. Raises NoGame, RecorderDown, and what `load` and the re-simulation raise."""
        if self.stopping:
            raise ServerStopping("the server is going down")
        game = self._games.get(episode)
        if game is not None and self._owners is not None:
            if not await self._owners.still_mine(episode):
                self.let_go(game)
            game = self._games.get(episode)  # it may have been forgotten in the meantime
        if game is None:
            game = await self.open(episode)
        await self._until_stored(game)
        if game.session.phase == "ended":
            raise NoGame(f"episode {episode} is over")
        game.join(person, connection)
        return game

    async def taken_up(self, episode: str) -> Game | None:
        """Return the game if it is live here, also one that is just being taken up."""
        opening = self._opening.get(episode)
        if opening is not None:
            await asyncio.wait({opening})
        return self._games.get(episode)

    async def open(self, episode: str) -> Game:
        """Return the game, taken up from the database if it is not live here. Raises what `join` does."""
        if self.stopping:
            raise ServerStopping("the server is going down")
        game = self._games.get(episode)
        if game is not None:
            return game
        opening = self._opening.get(episode)
        if opening is None:
            opening = self._opening[episode] = asyncio.create_task(self._open(episode))
            opening.add_done_callback(lambda _: self._opening.pop(episode, None))
        try:
            game = await asyncio.shield(opening)
        except RecorderDown:
            raise
        except NoGame:
            self.broken.discard(episode)
            raise
        except Exception:
            self.broken.add(episode)
            raise
        self.broken.discard(episode)
        return game

    async def _until_stored(self, game: Game) -> None:
        """Return when the state can be shown: not before it is stored. The start state can be shown at once."""
        until = time.monotonic() + STOP_TIMEOUT_S
        while game.busy and game.session.phase != "ended" and game.session.simulation.timestep:
            if game.unstored is not None or time.monotonic() > until:
                raise RecorderDown("the newest timestep is not stored yet")
            await asyncio.sleep(_LOOK_AGAIN_S)

    async def _open(self, episode: str) -> Game:
        record = await self._load(episode)
        if record is None or record.status in ("done", "aborted"):
            raise NoGame(f"there is no episode {episode} to be played")
        session = Session(record, self.clock.now())
        game = Game(session, self.clock, self._recorder, self.loop.start, self.loop.stop)
        if session.resumed:
            game.interrupted(record.known_at)
        if record.is_paused:
            game.pause(RESEARCHER, "researcher")
        self._records[episode] = record
        self._games[episode] = game
        if session.over:
            game.store(session.end_pause(self.clock.now()))
            self._end(game, "done", "")
            raise NoGame(f"episode {episode} is over")
        if self._keeper is None:
            self._keeper = asyncio.create_task(self._keep())
        return game

    # Ends

    def _over(self, game: Game, error: str) -> None:
        self._end(game, "aborted" if error else "done", "error" if error else "")

    def abort(self, game: Game, reason: str) -> None:
        """End an episode before its time; what was played stays stored."""
        self._end(game, "aborted", reason)

    def _end(self, game: Game, status: Literal["done", "aborted"], reason: str) -> None:
        if game.session.phase != "ended":
            game.store(game.session.end_pause(self.clock.now()))
            result = game.session.result(status, reason)
            self.loop.stop(game)
            self._spawn(self._finish(game, result))

    async def _finish(self, game: Game, result: EpisodeResult) -> None:
        """Store the end, then tell the participants."""
        try:
            await game.retrying_writer.end(result)
            if self._after_end is not None:
                await self._after_end(self._records[game.episode], result)
        except GamesLost:
            self.let_go(game)
        except Exception:
            log.exception("the end of episode %s could not be stored", game.episode)
            for connection in game.connections.values():
                connection.close(CloseCode.FAILED, "the end of the episode could not be stored")
        else:
            game.tell_end(result)
        self._forget(game)

    def let_go(self, game: Game) -> None:
        """Give up a game that another process has taken over: nothing more is stored here, and connected participants
        are told."""
        if self._games.get(game.episode) is game:
            log.info("episode %s was taken up by another process", game.episode)
            self._forget(game)
        self.loop.stop(game)
        game.session.phase = "ended"
        game.dismiss_all()

    def _forget(self, game: Game) -> None:
        if self._games.get(game.episode) is not game:
            return  # it was taken up here again in the meantime
        self._models.forget(game.episode)
        self._games.pop(game.episode, None)
        self._records.pop(game.episode, None)
        if self._owners is not None:
            self._owners.let_go(game.episode)

    def _spawn(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    # Housekeeping

    async def _keep(self) -> None:
        while True:
            await self.clock.sleep(KEEP_EVERY_S)
            now = self.clock.now()
            for game in list(self._games.values()):
                if game.busy or game.session.moving or game.session.phase == "ended":
                    continue
                game.store_inputs()
                left_s = game.session.pause_reasons.left_s(now)
                if left_s is not None and left_s <= 0:
                    self.abort(game, "away")
                elif left_s is None and _is_forgettable(game, now):
                    self._forget(game)

    async def stop(self) -> None:
        """Pause running games durably, tell everybody that the server restarts, and close sockets with 1012."""
        self.stopping = True
        if self._keeper is not None:
            self._keeper.cancel()
        games = list(self._games.values())
        for game in games:
            game.pause(SERVER, "server")
            game.store(game.session.end_pause(self.clock.now()))  # the process that takes it over begins its own pause
        await self.loop.close()
        try:
            async with asyncio.timeout(STOP_TIMEOUT_S):
                await asyncio.gather(*(game.retrying_writer.flush() for game in games), *self._tasks)
        except TimeoutError:
            log.error("the last pauses were not stored within %s s", STOP_TIMEOUT_S)
        for game in games:
            for connection in game.connections.values():
                connection.close(CloseCode.RESTARTING, "the server is restarting")


def _is_forgettable(game: Game, now: float) -> bool:
    """Return whether nobody has been there for a while. A game that a researcher pauses is kept: it would continue
    without the researcher, or an absence would never end it."""
    paused = game.session.phase == "paused" and game.session.pause_reasons.of_researcher
    return not paused and not game.connections and now - game.idle_since > FORGET_AFTER_S
