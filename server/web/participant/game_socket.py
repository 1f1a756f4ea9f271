"""The websocket of a game: access, incoming and outgoing messages, and closing."""

import asyncio
import itertools
import logging
import time
from collections.abc import Awaitable, Callable
from typing import Any, Final

from fastapi import APIRouter, WebSocket
from starlette.requests import HTTPConnection

from server.background_tasks import ended
from server.participation.game_seats import ConnectedPlayer
from server.participation.waiting_room import WaitingRoom
from server.play import messages
from server.play.close_codes import CloseCode
from server.play.game import Game
from server.play.games import Games, NoGame, ServerStopping
from server.play.recorder import RecorderDown
from server.play.send_queue import Close, SendQueue
from server.play.token_bucket import TokenBucket
from server.store.database import DatabaseDown
from server.web.participant.direct_frames import direct_frames
from server.web.participant.socket_input import DirectInput, Gate, bucket_of
from server.web.services import ServicesDep

log = logging.getLogger(__name__)
BEAT_EVERY_S: Final = 0.25
_BEAT_PARTS: Final = 10  # of all sockets, one after the other: many pings at once are many answers at once
MAX_OF_ONE: Final = 8  # sockets of one participant
CLIENT_ERRORS_PER_S: Final = 1 / 60  # of one participant that are passed on
CLIENT_ERRORS_BURST: Final = 10.0
_BUCKETS_KEPT: Final = 10_000


# (connection with the cookie, study) -> participant
FindPlayer = Callable[[HTTPConnection, str], Awaitable[ConnectedPlayer | None]]
IsOurs = Callable[[HTTPConnection], bool]
Report = Callable[[str, str], Awaitable[None]]  # (participant, text of a problem in their browser)


class NoPlace(Exception):
    """Nobody else can be let in now: the page tries again."""


class PlayerSocket:
    """One accepted socket, as the game and the heartbeat see it."""

    def __init__(self, socket: WebSocket, player: ConnectedPlayer) -> None:
        self.player = player
        self.tab = ""
        self.is_new_page = True
        self.next_url = player.next_url
        self.direct = direct_frames(socket.scope)
        self.send_queue = SendQueue(self.direct.write)
        self.reader: asyncio.Task[Any] | None = asyncio.current_task()
        self._socket = socket

    def send(self, message: messages.Outgoing) -> None:
        self.send_queue.send(message)

    def close(self, code: int, reason: str) -> None:
        self.send_queue.close(code, reason)

    async def write(self) -> None:
        """Send what waits until the socket closes. Returns when it is closed from either side."""
        while True:
            frame = await self.send_queue.next()
            if isinstance(frame, Close):
                await self._socket.send({"type": "websocket.close", "code": frame.code, "reason": frame.reason})
                return
            await self._socket.send({"type": "websocket.send", "text": frame.decode()})


class Sockets:
    """All open game sockets of this server."""

    def __init__(
        self,
        games: Games,
        find: FindPlayer,
        is_ours: IsOurs,
        report: Report | None = None,
        room: WaitingRoom | None = None,
    ) -> None:
        """`is_ours`: whether the page that opens the socket is one of ours (Origin check)."""
        self._games, self._find, self.is_ours, self._report, self._room = games, find, is_ours, report, room
        self._open: dict[PlayerSocket, None] = {}  # oldest first
        self._buckets: dict[str, TokenBucket] = {}
        self._client_errors: dict[str, TokenBucket] = {}
        self._heart: asyncio.Task[None] | None = None

    def __len__(self) -> int:
        return len(self._open)

    def rtts_ms(self) -> dict[str, float]:
        """Return the last measured round trip of every connected participant."""
        return {
            socket.player.participant: socket.send_queue.rtt_ms
            for socket in self._open
            if socket.send_queue.rtt_ms is not None
        }

    async def serve(self, socket: WebSocket, study: str) -> None:
        """Serve a socket from handshake to close. Foreign pages get a 403 before anything is accepted."""
        if not self.is_ours(socket):
            log.warning("a websocket from another origin was refused: %s", socket.headers.get("origin", "")[:100])
            return await socket.close(CloseCode.REFUSED)
        try:
            player = await self._find(socket, study)
        except DatabaseDown:
            await socket.accept()
            return await socket.close(CloseCode.TRY_LATER, "the database is away")
        except NoPlace:
            return await socket.close(CloseCode.REFUSED)
        if player is None:
            return await _turn_away(socket)
        await socket.accept()
        mine = PlayerSocket(socket, player)
        self._open[mine] = None
        self._bound(mine.player.participant)
        if self._heart is None or self._heart.done():
            self._heart = asyncio.create_task(self._beat())
        writer = asyncio.create_task(mine.write())
        reader = asyncio.create_task(self._read(socket, mine))
        mine.reader = reader
        try:
            await asyncio.wait({writer, reader}, return_when=asyncio.FIRST_COMPLETED)
            if reader.done():
                await self._settle(writer, reader, mine)
        finally:
            self._open.pop(mine, None)
            mine.send_queue.drop()
            await ended(writer, reader)

    def _bound(self, participant: str) -> None:
        """Limit a participant's sockets: a page has one, but a lost one stays open for seconds. The oldest of too many
        closes."""
        own = [one for one in self._open if one.player.participant == participant]
        for one in own[:-MAX_OF_ONE]:
            one.close(CloseCode.REFUSED, "too many connections")

    def dismiss(self, participant: str, reason: str, code: CloseCode = CloseCode.REFUSED) -> None:
        """Close every socket of a participant for good."""
        for one in [one for one in self._open if one.player.participant == participant]:
            one.close(code, reason)

    def dismiss_deleted(self, participant: str) -> None:
        """Close the sockets of somebody who was deleted: the page loads what there is for them now."""
        self.dismiss(participant, "this participant was deleted", CloseCode.NO_GAME)

    @staticmethod
    async def _settle(writer: asyncio.Task[None], reader: asyncio.Task[None], mine: PlayerSocket) -> None:
        """Let the last messages go out, but do not wait long for a dead peer."""
        if not reader.cancelled() and (error := reader.exception()) is not None:
            log.error("a game socket failed", exc_info=error)
            mine.close(CloseCode.FAILED, "the server failed")
        mine.close(CloseCode.FINISHED, "")  # the page has closed it
        await asyncio.wait({writer}, timeout=1.0)

    async def _beat(self) -> None:
        for part in itertools.cycle(range(_BEAT_PARTS)):
            if not self._open:
                return
            await asyncio.sleep(BEAT_EVERY_S / _BEAT_PARTS)
            now = time.monotonic()
            for mine in list(self._open)[part::_BEAT_PARTS]:
                if mine.send_queue.beat(now) and mine.reader is not None:
                    mine.close(CloseCode.SILENT, "no answer to a ping")
                    mine.reader.cancel()
            if len(self._client_errors) > _BUCKETS_KEPT:
                self._client_errors = {who: one for who, one in self._client_errors.items() if not one.is_full(now)}
            if len(self._buckets) > _BUCKETS_KEPT:
                here = {mine.player.participant for mine in self._open}
                self._buckets = {who: one for who, one in self._buckets.items() if who in here}

    async def _read(self, socket: WebSocket, mine: PlayerSocket) -> None:
        clock = self._games.clock
        gate = Gate(self._buckets.setdefault(mine.player.participant, bucket_of(clock)))
        direct = DirectInput(gate, mine, clock)
        mine.direct.take = direct.take
        try:
            while (event := await direct.receive(socket))["type"] != "websocket.disconnect":
                message = gate.let_in(event.get("text"), mine, clock.now())
                if message is not None:
                    direct.game = await self._handle(message, direct.game, mine)
                if mine.send_queue.closing:
                    return
        finally:
            if direct.game is not None:
                direct.game.leave(mine.player.seat, mine)
            elif self._room is not None:
                self._room.leave(mine.player.participant, mine)

    async def _handle(self, message: messages.Incoming, game: Game | None, mine: PlayerSocket) -> Game | None:
        """Do what one message asks; the game that the socket is in from now on."""
        match message:
            case messages.Hello():
                return await self._hello(message, game, mine)
            case messages.ClientError():
                await self._client_error(mine.player.participant, message.text)
            case messages.Pong():
                pass  # late, or not an answer to a Ping: ignore it
            case _ if game is None:
                mine.send(messages.Refused("hello_first", "the first message is hello"))
            case _:
                game.receive(mine.player.seat, mine, message)
        return game

    async def _client_error(self, participant: str, text: str) -> None:
        """Store an error of a browser. A page that fails on every frame repeats it: a few are enough."""
        now = time.monotonic()
        bucket = self._client_errors.setdefault(
            participant, TokenBucket(now, 1.0, CLIENT_ERRORS_PER_S, CLIENT_ERRORS_BURST)
        )
        if not bucket.spend(now):
            return
        log.info("error in a browser: %r", text)
        if self._report is not None:
            await self._report(participant, text)

    async def _hello(self, hello: messages.Hello, game: Game | None, mine: PlayerSocket) -> Game | None:
        player = mine.player
        mine.tab, mine.is_new_page = hello.tab, hello.last_timestep < 0
        if hello.protocol != messages.PROTOCOL:
            mine.send(messages.Refused("protocol", f"this server speaks protocol {messages.PROTOCOL}: reload the page"))
            mine.close(CloseCode.REFUSED, "another protocol")
        elif player.request is not None and self._room is not None:
            self._room.enter(player.participant, player.request, mine)
        elif player.episode is None:
            mine.send(messages.Refused("no_game", "no game is to be played now: reload the page"))
            mine.close(CloseCode.NO_GAME, "no game")
        else:
            try:
                return await self._games.join(player.episode, player.seat, mine)
            except ServerStopping as error:
                log.info("episode %s is not taken up: %s", player.episode, error)
                mine.close(CloseCode.RESTARTING, "the server is restarting")
            except NoGame as error:
                mine.send(messages.Refused("no_game", str(error)))
                mine.close(CloseCode.NO_GAME, "no game")
            except RecorderDown as error:
                mine.send(messages.Refused("database", str(error)))
                mine.close(CloseCode.TRY_LATER, "the database is away")
            except Exception:
                log.exception("episode %s cannot be taken up", player.episode)
                mine.send(messages.Refused("broken", "this game cannot be taken up; the researcher has been told"))
                mine.close(CloseCode.FAILED, "the game is broken")
        return game


async def _turn_away(socket: WebSocket) -> None:
    """Refuse somebody whom we do not know, or no longer. A browser does not show its page the status of a refused
    handshake: one of our pages, which names its origin, gets a close code, with which it loads the current step."""
    if "origin" not in socket.headers:
        return await socket.close(CloseCode.REFUSED)
    await socket.accept()
    await socket.close(CloseCode.NO_GAME, "unknown participant")


router = APIRouter()


@router.websocket("/s/{study}/socket")
async def play(socket: WebSocket, study: str, services: ServicesDep) -> None:
    """Play the participant's current step, if it is a game."""
    await services.sockets.serve(socket, study)
