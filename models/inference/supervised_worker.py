"""One model worker process seen from the server: started, fed, watched, killed, replaced by a spare. No torch here."""

import asyncio
import itertools
import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from msgspec.structs import replace

from models.inference.circuit_breaker import Breaker
from models.inference.launch import Launched, launch
from models.inference.wire import LENGTH, Answer, Failed, Forget, Load, Loaded, ModelRequest, Row, frame, from_worker
from models.protocols import History

MAX_WAITING = 256  # frames a worker may owe before it is asked nothing more
SPARE_AFTER_S = 2.0  # a server that has just started has more urgent work
_GRACE_S = 0.5  # after its deadline, before a worker that has not answered is replaced
_MAX_SLACK = 8  # a worker that replaces slow ones may take at most this many times as long
_NEWEST_WEIGHT = 0.2  # of the newest answer in the mean time of an answer
_QUICK_TO_TRUST = 25  # quick answers in a row after which the usual limit applies again
log = logging.getLogger("models")


class ModelsDown(Exception):
    """The models could not be started; the text names the model and what is wrong with it."""


class WorkerProcess:
    """A process of `models.inference.worker` and the connection to it. `ahead`: one that has been launched already."""

    def __init__(self, load: Load, ahead: Launched | None = None) -> None:
        self._load = load
        self._launched = ahead
        self._writer: asyncio.StreamWriter | None = None
        self._reader: asyncio.StreamReader | None = None
        self.memory = 1
        self.hashes: dict[str, str] = {}

    async def start(self) -> "WorkerProcess":
        """Return when everything is loaded and warm. Raises ModelsDown."""
        self._launched = self._launched or launch()
        try:
            self._reader, self._writer = await asyncio.open_unix_connection(sock=self._launched.connection)
            self.send(self._load)
            loaded = await self._loaded()
            self.memory, self.hashes = loaded.memory, loaded.hashes
        except BaseException:
            await self.end()
            raise
        return self

    async def _loaded(self) -> Loaded:
        """Return the worker's message once all its models answer."""
        try:
            first = from_worker(await self._receive())
        except (asyncio.IncompleteReadError, ConnectionError):
            raise ModelsDown("a model worker ended while it was loading; its last words are above") from None
        if isinstance(first, Failed):
            raise ModelsDown(first.reason)
        return first if isinstance(first, Loaded) else Loaded(1)

    @property
    def pid(self) -> int:
        return 0 if self._launched is None else self._launched.process.pid

    def send(self, message: Load | ModelRequest | Forget) -> None:
        if self._writer is not None and not self._writer.is_closing():
            self._writer.write(frame(message))

    async def answers(self, take: Callable[[Answer], None]) -> None:
        """Hand over answers until the process is gone."""
        try:
            while True:
                answer = from_worker(await self._receive())
                if isinstance(answer, Answer):
                    take(answer)
        except (asyncio.IncompleteReadError, ConnectionError, ValueError):
            return

    async def _receive(self) -> bytes:
        assert self._reader is not None  # noqa: S101 set by start
        (size,) = LENGTH.unpack(await self._reader.readexactly(LENGTH.size))
        return await self._reader.readexactly(size)

    async def end(self) -> None:
        """Kill the process and leave nothing behind. May be called twice."""
        if self._writer is not None:
            self._writer.close()
        if self._launched is not None:
            await asyncio.to_thread(self._launched.end)


@dataclass(frozen=True)
class _Waiting:
    """A frame that the worker owes an answer to."""

    answer: "asyncio.Future[Answer]"
    asked: float
    limit_s: float  # a worker that answers nothing for longer is replaced
    rows: list[Row]


class SupervisedWorker:
    """A worker that is replaced when it dies or no longer answers. `ahead`: a process that has been launched already,
    used first.
    """

    def __init__(self, load: Load, spares: int, hang_s: float, ahead: Launched | None = None) -> None:
        """`hang_s`: it is replaced when it answers nothing for longer, and longer than a question's own deadline. Its
        successor has to be sent the whole history of every game, so it gets more time: otherwise, on a machine that is
        too busy, each worker would be replaced while it reads."""
        self._load = load
        self._ahead = ahead
        self._hang_s = hang_s
        self._spares_wanted = spares
        self._spares: list[asyncio.Task[WorkerProcess]] = []
        self._worker: WorkerProcess | None = None
        self._known: dict[str, int] = {}  # game key -> newest timestep that the worker has seen
        self._held: set[str] = set()  # keys of games for which its predictors keep a state, also after a failure
        self._waiting: dict[int, _Waiting] = {}  # in the order asked
        self._ids = itertools.count()
        self._care: asyncio.Task[None] | None = None
        self._later: asyncio.TimerHandle | None = None
        self._breaker = Breaker(faults_to_open=3)
        self._answered_at, self._usual_s = 0.0, 0.0  # when it last answered, and the mean time of an answer
        self._slack, self._quick = 1, 0
        self.restarts = 0

    async def start(self) -> None:
        """Start the worker and keep it alive. Raises ModelsDown if a model does not load."""
        self._worker = await WorkerProcess(self._load, self._ahead).start()
        self._load = replace(self._load, hashes=self._worker.hashes)  # those that come after it load the same files
        self._care = asyncio.create_task(self._keep_alive())
        self._later = asyncio.get_running_loop().call_later(SPARE_AFTER_S, self._fill_spares)

    @property
    def pid(self) -> int:
        """The worker's process id; 0 while there is none."""
        return 0 if self._worker is None else self._worker.pid

    @property
    def memory(self) -> int:
        return 1 if self._worker is None else self._worker.memory

    def ready(self, patience_s: float) -> bool:
        """Return whether a question asked now will probably be answered within `patience_s`. One that would be late is
        not asked: a worker with too much to do would otherwise answer every question a little too late."""
        if self._worker is None or len(self._waiting) >= MAX_WAITING:
            return False
        oldest = next(iter(self._waiting.values()), None)
        if oldest is None:
            return True
        now = time.monotonic()
        begun = max(oldest.asked, self._answered_at)
        rest_s = max(0.0, self._usual_s - (now - begun))
        return now - oldest.asked < patience_s and rest_s + len(self._waiting) * self._usual_s < patience_s

    def missing(self, key: str, timestep: int) -> int:
        """Return how many of a game's last states the worker has not been sent; 0: its whole history is needed."""
        known = self._known.get(key)
        if known is None or not known < timestep < known + self.memory:
            return 0
        return timestep - known

    def saw(self, key: str, timestep: int) -> None:
        """Note that the state has been sent: the worker reads frames in order, however late it answers."""
        self._known[key] = timestep
        self._held.add(key)

    def forget(self, keys: list[str]) -> None:
        gone = [key for key in keys if key in self._held]
        self._held.difference_update(gone)
        for key in gone:
            self._known.pop(key, None)
        if gone and self._worker is not None:
            self._worker.send(Forget(gone))

    def ask(
        self, layout: str, rows: list[Row], histories: Sequence[History], patience_s: float
    ) -> "asyncio.Future[Answer]":
        """Return the future answer, which is wanted within `patience_s`. It is cancelled when the worker dies."""
        assert self._worker is not None  # noqa: S101 the caller looked at ready()
        players = b"".join([history.players for history in histories])
        contents = b"".join([history.contents for history in histories])
        actions = b"".join([history.actions for history in histories])
        question = ModelRequest(next(self._ids), layout, rows, players, contents, actions)
        answer: asyncio.Future[Answer] = asyncio.get_running_loop().create_future()
        now = time.monotonic()
        limit_s = max(self._hang_s, patience_s + _GRACE_S)  # a study may allow more time than `hang_s`
        self._waiting[question.id] = _Waiting(answer, now, limit_s, rows)
        self._worker.send(question)
        return answer

    async def close(self) -> None:
        if self._later is not None:
            self._later.cancel()
        if self._care is not None:
            self._care.cancel()
            await asyncio.gather(self._care, return_exceptions=True)
        for spare in self._spares:
            spare.cancel()
        started = await asyncio.gather(*self._spares, return_exceptions=True)
        workers = [worker for worker in started if isinstance(worker, WorkerProcess)]
        await asyncio.gather(*(worker.end() for worker in [*workers, self._worker] if worker is not None))
        self._drop_waiting()
        self._worker = None

    def _take(self, answer: Answer) -> None:
        waiting = self._waiting.pop(answer.id, None)
        if waiting is None:
            return
        now = time.monotonic()
        took_s = now - max(waiting.asked, self._answered_at)
        self._usual_s += _NEWEST_WEIGHT * (took_s - self._usual_s)
        self._answered_at = now
        self._quick = self._quick + 1 if now - waiting.asked < self._hang_s / 2 else 0
        if self._quick >= _QUICK_TO_TRUST:
            self._slack = 1
        for row, predicted in zip(waiting.rows, answer.predicted, strict=True):
            if row.predictor is not None and not predicted:  # the worker's memory of this game may be incomplete
                self._known.pop(row.key, None)
        if not waiting.answer.done():  # done: the deadline was over, nobody waits for it now
            waiting.answer.set_result(answer)
        self._breaker.worked()

    async def _keep_alive(self) -> None:
        """Replace the worker for as long as the server lives."""
        while self._worker is not None:
            listening = asyncio.create_task(self._worker.answers(self._take))
            watching = asyncio.create_task(self._until_it_hangs())
            try:
                await asyncio.wait([listening, watching], return_when=asyncio.FIRST_COMPLETED)
                if watching.done():
                    self._slack = min(2 * self._slack, _MAX_SLACK)
                    log.warning("a model worker answered nothing for too long and is replaced")
            finally:
                listening.cancel()
                watching.cancel()
            dead, self._worker = self._worker, None
            self._known.clear()
            self._held.clear()
            self._drop_waiting()
            await dead.end()
            self._worker = await self._replacement()
            self.restarts += 1
            self._fill_spares()

    async def _until_it_hangs(self) -> None:
        """Return when the worker owes an answer and has given none for too long."""
        while True:
            await asyncio.sleep(self._hang_s / 5)
            oldest = next(iter(self._waiting.values()), None)
            if oldest is None:
                continue
            if time.monotonic() - max(oldest.asked, self._answered_at) > oldest.limit_s * self._slack:
                return

    async def _replacement(self) -> WorkerProcess:
        while True:
            self._breaker.failed()
            while not self._breaker.closed:
                await asyncio.sleep(0.05)
            try:
                return await (self._spares.pop(0) if self._spares else WorkerProcess(self._load).start())
            except ModelsDown as error:
                log.error("a model worker does not start again: %s", error)

    def _fill_spares(self) -> None:
        while len(self._spares) < self._spares_wanted:
            self._spares.append(asyncio.create_task(WorkerProcess(self._load).start()))

    def _drop_waiting(self) -> None:
        for waiting in self._waiting.values():
            waiting.answer.cancel()
        self._waiting.clear()
