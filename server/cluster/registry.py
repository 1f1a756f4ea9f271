"""Connect the processes of one server by Redis: owners of games, data for dashboards, and commands. The authoritative
owner of a game is in PostgreSQL, where it is checked with every tick (`server.store.fences`). Without Redis games
continue; only the dashboard then shows just the games of its own process.
"""

import asyncio
import logging
import os
import secrets
import socket
from collections.abc import Awaitable, Callable
from contextlib import suppress
from hashlib import sha256
from typing import Final, Protocol

import msgspec
from msgspec import Struct
from redis.asyncio import Redis
from redis.asyncio.client import PubSub
from redis.exceptions import RedisError

from server.background_tasks import ended
from server.monitoring.commands import AnyGameCommand, BroadcastCommand, Command
from server.monitoring.peers import ClusterDown, Process, View

log = logging.getLogger(__name__)
BEAT_S: Final = 0.5
LEASE_S: Final = 3  # a process without a sign of life for so long is ignored
FORGET_S: Final = 86_400  # names of processes that have ended do no harm
ANSWER_S: Final = 1.0
AWAY_S: Final = 10.0  # seconds between attempts to reach Redis, each of which is logged
_DOWN: Final = (RedisError, OSError, TimeoutError)


class LetGo(Struct, frozen=True, tag_field="command", tag="let_go"):
    """The sender took over the episode with this fence: a process that still plays it must stop."""

    episode: str
    fence: int


class PeerRequest(Struct, frozen=True):
    """A request to another process to run a command. `id`: of the reply that it waits for; empty: none."""

    id: str
    sender: str
    command: Command | LetGo


class Reply(Struct, frozen=True):
    """How many games the command reached in one process."""

    id: str
    value: int


class Here(Protocol):
    """The interface of this process to the cluster."""

    def leases(self) -> list[str]:
        """Return the games that are played here."""
        ...

    async def views(self) -> list[View]: ...

    def process(self, name: str) -> Process:
        """Return the status of this process."""
        ...

    async def run(self, command: Command | LetGo) -> int:
        """Run a command of another process; return how many games it reached."""
        ...


class Cluster:
    """This process among the others (its `Peers`). Call `start` first; `close` releases everything at once."""

    def __init__(self, redis_url: str, database_url: str) -> None:
        """Servers of one database find each other; those of others may share the Redis."""
        self.name = f"{socket.gethostname()}-{os.getpid()}-{secrets.token_hex(2)}"
        self._prefix = f"kitchenmind:{sha256(database_url.encode()).hexdigest()[:12]}:"
        self._redis: Redis = Redis.from_url(
            redis_url,
            decode_responses=True,
            socket_timeout=ANSWER_S,
            socket_connect_timeout=ANSWER_S,
            health_check_interval=5,
        )
        self._here: Here | None = None
        self._waiting: dict[str, list[int]] = {}
        self._tasks: list[asyncio.Task[None]] = []
        self._commands: set[asyncio.Task[None]] = set()
        self._complained = -1e9

    async def reach(self) -> None:
        """Check that Redis answers. Raises ClusterDown with the reason."""
        try:
            await self._redis.ping()
        except _DOWN as error:
            raise ClusterDown(f"Redis cannot be reached: {error}. Check --redis.") from None

    def start(self, here: Here) -> None:
        self._here = here
        self._tasks = [asyncio.create_task(self._again(work)) for work in (self._beat, self._listen)]

    async def close(self) -> None:
        await ended(*self._tasks, *self._commands)
        if self._here is not None:
            with suppress(*_DOWN):
                games = [self._key("game", episode) for episode in self._here.leases()]
                await self._redis.delete(self._key("process", self.name), self._key("views", self.name), *games)
                await self._redis.srem(self._key("names"), self.name)
        await self._redis.aclose()

    # Messages to others

    async def _beat(self) -> None:
        while True:
            await self._tell()
            await asyncio.sleep(BEAT_S)

    async def _tell(self) -> None:
        assert self._here is not None  # noqa: S101 set by start
        watched = await self._redis.exists(self._key("watched"))
        views = await self._here.views() if watched else []
        async with self._redis.pipeline(transaction=False) as pipe:
            process = self._here.process(self.name)
            pipe.set(self._key("process", self.name), msgspec.json.encode(process), ex=LEASE_S)
            pipe.sadd(self._key("names"), self.name)
            pipe.expire(self._key("names"), FORGET_S)
            for episode in self._here.leases():
                pipe.set(self._key("game", episode), self.name, ex=LEASE_S)
            if watched:
                pipe.set(self._key("views", self.name), msgspec.json.encode(views), ex=LEASE_S)
            await pipe.execute()

    async def taken(self, episode: str, fence: int) -> None:
        """Tell the former owner that the game continues here. If the message is lost, its next tick finds out."""
        with suppress(*_DOWN):
            await self._send("all", LetGo(episode, fence))
            await self._redis.set(self._key("game", episode), self.name, ex=LEASE_S)

    # Messages from others (Peers)

    async def views(self) -> list[View]:
        try:
            await self._redis.set(self._key("watched"), 1, ex=LEASE_S)
            found = await self._of_others("views")
        except _DOWN as error:
            self._complain(error)
            return []
        return [view for one in found for view in msgspec.json.decode(one, type=list[View])]

    async def processes(self) -> list[Process]:
        try:
            return [msgspec.json.decode(one, type=Process) for one in await self._of_others("process")]
        except _DOWN as error:
            self._complain(error)
            return []

    async def run_at_owner(self, command: AnyGameCommand) -> bool:
        try:
            owner = await self._redis.get(self._key("game", command.episode))
            if owner is None or owner == self.name:
                return False
            return any(await self._asked(str(owner), 1, command))
        except _DOWN as error:
            self._complain(error)
            return False

    async def run_at_all(self, command: BroadcastCommand) -> list[int]:
        try:
            others = len(await self._of_others("process"))
            return await self._asked("all", others, command) if others else []
        except _DOWN as error:
            self._complain(error)
            return []

    async def run_in_each(self, command: BroadcastCommand, within_s: float) -> bool:
        try:
            others = len(await self._of_others("process"))
            answers = await self._asked("all", others, command, within_s) if others else []
        except _DOWN as error:
            self._complain(error)
            return False
        return len(answers) >= others and all(answers)

    async def _of_others(self, kind: str) -> list[str]:
        names = sorted(map(str, await self._redis.smembers(self._key("names"))))
        others = [name for name in names if name != self.name]
        found = await self._redis.mget([self._key(kind, name) for name in others]) if others else []
        return [str(value) for value in found if value is not None]

    async def _asked(self, whom: str, expected: int, command: Command, within_s: float = ANSWER_S) -> list[int]:
        """Return their answers: as many as expected, or those that came in time."""
        number = secrets.token_hex(8)
        replies = self._waiting[number] = []
        try:
            await self._send(whom, command, number)
            async with asyncio.timeout(within_s):
                while len(replies) < expected:
                    await asyncio.sleep(0.01)
        except TimeoutError:
            log.warning("%d of %d processes did not answer: %s", expected - len(replies), expected, command)
        finally:
            del self._waiting[number]
        return replies

    async def _send(self, whom: str, command: Command | LetGo, number: str = "") -> None:
        request = PeerRequest(number, self.name, command)
        await self._redis.publish(self._key("asks", whom), msgspec.json.encode(request))

    # Requests to this process

    async def _listen(self) -> None:
        heard: PubSub
        async with self._redis.pubsub(ignore_subscribe_messages=True) as heard:
            replies = self._key("replies", self.name)
            await heard.subscribe(self._key("asks", "all"), self._key("asks", self.name), replies)
            while True:
                message = await heard.get_message(timeout=ANSWER_S / 2)
                if message is None:
                    continue
                if message["channel"] == replies:
                    reply = msgspec.json.decode(message["data"], type=Reply)
                    self._waiting.get(reply.id, []).append(reply.value)
                else:
                    self._begin(msgspec.json.decode(message["data"], type=PeerRequest))

    def _begin(self, request: PeerRequest) -> None:
        if request.sender != self.name:
            task = asyncio.create_task(self._run(request))
            self._commands.add(task)
            task.add_done_callback(self._commands.discard)

    async def _run(self, request: PeerRequest) -> None:
        assert self._here is not None  # noqa: S101 set by start
        try:
            value = await self._here.run(request.command)
            if request.id:
                reply = msgspec.json.encode(Reply(request.id, value))
                await self._redis.publish(self._key("replies", request.sender), reply)
        except _DOWN as error:
            self._complain(error)
        except Exception:
            log.exception("%s, asked for by %s, failed", request.command, request.sender)

    async def _again(self, work: Callable[[], Awaitable[None]]) -> None:
        while True:
            try:
                await work()
            except _DOWN as error:
                self._complain(error)
            except Exception:
                log.exception("the exchange between the processes failed; it starts again")
            await asyncio.sleep(BEAT_S)

    def _complain(self, error: BaseException) -> None:
        now = asyncio.get_running_loop().time()
        if now - self._complained > AWAY_S:
            self._complained = now
            log.warning("Redis cannot be reached, each process shows only its own games: %s", error)

    def _key(self, *parts: str) -> str:
        return self._prefix + ":".join(parts)
