"""Access to the database: `write` through one thread, `read` through a few.

Functions that wait to be written share one transaction, so that one fsync carries many games (group commit). When
`write` returns, its changes are durable. When the database cannot commit, `DatabaseDown` is raised and nothing was
acknowledged.
"""

import asyncio
import queue
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Concatenate, ParamSpec, TypeVar

from sqlalchemy import Connection, Engine
from sqlalchemy.exc import DBAPIError

from server.store import engines
from server.store.engines import DatabaseDown, DatabaseInUse
from server.store.tables import heartbeat

__all__ = ["Database", "DatabaseDown", "DatabaseInUse"]

P = ParamSpec("P")
T = TypeVar("T")
_Outcome = tuple[Any, Exception | None]
MAX_GROUP = 256
MAX_GROUP_S = 1.0  # several processes take turns, and one that waits for 4 s gives up (SERVER_LOCK_TIMEOUT_S)


@dataclass
class _Job:
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    keywords: dict[str, Any]
    future: "Future[Any]"


class Database:
    """One database, one writer. `url`: sqlite:///path/to/file.db or postgresql://user@host/name.

    Raises DatabaseInUse when another server has it open, DatabaseDown when it cannot be reached, ValueError for an
    address that is neither. `read_only`: for export and checks; takes no lock, `write` is refused. `shared`, `in_turn`:
    for one process of several, see `engines.Writer`.
    """

    def __init__(
        self, url: str, *, read_only: bool = False, readers: int = 4, shared: bool = False, in_turn: bool = False
    ) -> None:
        self.url = engines.normal_url(url)
        self.read_only = read_only
        self._reader_engine: Engine = engines.reader(self.url)
        self._readers = ThreadPoolExecutor(readers, thread_name_prefix="database-reader")
        self._jobs: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._closed = False
        if not read_only:
            self._writer = engines.WriteConnection(self.url, shared, in_turn)
            self._thread = threading.Thread(target=self._write_forever, name="database-writer", daemon=True)
            self._thread.start()

    async def write(self, function: Callable[Concatenate[Connection, P], T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Return what `function(connection, *args)` returns, once its transaction is durable.

        Its own exceptions come through and undo only its own work. It may be run twice (when another function of its
        group failed), so it should do nothing but read and write the database. Cancelled while it waits, it is never
        begun. Raises DatabaseDown: nothing was committed, the same call may be repeated.
        """
        return await asyncio.wrap_future(self._submit(function, args, kwargs))

    def write_now(self, function: Callable[Concatenate[Connection, P], T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Do the same as `write` for code outside an event loop; blocks."""
        result: T = self._submit(function, args, kwargs).result()
        return result

    async def read(self, function: Callable[Concatenate[Connection, P], T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Return what `function(connection, *args)` reads, from one consistent view. Raises DatabaseDown."""
        return await asyncio.get_running_loop().run_in_executor(
            self._readers, lambda: self.read_now(function, *args, **kwargs)
        )

    def read_now(self, function: Callable[Concatenate[Connection, P], T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Do the same as `read` for code outside an event loop; blocks."""
        try:
            with self._reader_engine.begin() as connection:
                return function(connection, *args, **kwargs)
        except DBAPIError as error:
            raise engines.translated(error) from error

    async def probe(self) -> None:
        """Return once a real commit went through. Raises DatabaseDown."""
        await self.write(_beat)

    def close(self) -> None:
        """Finish waiting writes, then release the database. May be called twice."""
        if self._closed:
            return
        self._closed = True
        self._jobs.put(None)
        self._readers.shutdown()
        self._reader_engine.dispose()
        if not self.read_only:
            self._thread.join()
            self._writer.close()  # last, so that SQLite's log is folded into the file

    def __enter__(self) -> "Database":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _submit(self, function: Callable[..., T], args: tuple[Any, ...], kwargs: dict[str, Any]) -> "Future[T]":
        if self.read_only:
            raise ValueError("this database was opened for reading only")
        if self._closed:
            raise DatabaseDown("the database has been closed")
        future: Future[T] = Future()
        self._jobs.put(_Job(function, args, kwargs, future))
        return future

    def _write_forever(self) -> None:
        while (job := self._jobs.get()) is not None:
            group = [job]
            stop = False
            while len(group) < MAX_GROUP and not stop:
                try:
                    waiting = self._jobs.get_nowait()
                except queue.Empty:
                    break
                stop = waiting is None
                if waiting is not None:
                    group.append(waiting)
            group = [job for job in group if job.future.set_running_or_notify_cancel()]
            while group:
                group = group[self._commit(group) :]
            if stop:
                return

    def _commit(self, group: list[_Job]) -> int:
        """Run the group in one transaction, then tell everybody in it. Of a group that takes long, only the first ones:
        return how many."""
        try:
            try:
                outcomes = self._run(group, apart=False)
            except Exception as error:
                if len(group) == 1 or engines.is_down(error):
                    raise
                outcomes = self._run(group, apart=True)
        except Exception as error:  # noqa: BLE001 - whatever it was, everybody in the group must hear of it
            reason = engines.translated(error)
            outcomes = [(None, reason)] * len(group)
        for job, (result, refusal) in zip(group, outcomes, strict=False):
            if refusal is None:
                job.future.set_result(result)
            else:
                job.future.set_exception(refusal)
        return len(outcomes)

    def _run(self, group: list[_Job], apart: bool) -> list[_Outcome]:
        """Return the outcomes of the group's first functions, committed: of those that began within MAX_GROUP_S.
        `apart`: each function in a savepoint, as one of them is known to fail."""
        outcomes: list[_Outcome] = []
        with self._writer.transaction() as connection:
            began = time.monotonic()
            for job in group:
                if outcomes and time.monotonic() - began > MAX_GROUP_S:
                    break
                outcomes.append(_apart(connection, job) if apart else (_result(connection, job), None))
        return outcomes


def _result(connection: Connection, job: _Job) -> Any:
    return job.function(connection, *job.arguments, **job.keywords)


def _apart(connection: Connection, job: _Job) -> _Outcome:
    """Run one function of a group: its error goes to its caller, and the others continue."""
    try:
        with connection.begin_nested():
            return _result(connection, job), None
    except Exception as error:
        if engines.is_down(error):
            raise
        return None, error


def _beat(connection: Connection) -> None:
    now = datetime.now(UTC)
    if connection.execute(heartbeat.update().values(at=now)).rowcount == 0:
        connection.execute(heartbeat.insert().values(id=1, at=now))
