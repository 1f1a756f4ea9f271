"""The whole application in a thread of this process, with models that answer by rule: it starts quickly, and can be
killed like with `kill -9`, without any cleanup.
"""

import asyncio
import logging
import socket
import threading
from collections.abc import Callable, Coroutine
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any, TypeVar
from unittest.mock import patch

import uvicorn
from fastapi import FastAPI

import server.main
from models.inference.runner import ModelStatistics
from server.commands.serve import _server, listen
from server.settings import Settings
from server.store.database import DatabaseDown
from tests.support.databases import with_tables
from tests.support.live_fakes import RuleModels
from tests.support.real_server import SHORT_STUDY

T = TypeVar("T")


def _was_not_killed(record: logging.LogRecord) -> bool:
    """Ignore errors of requests that `kill` cuts off: a killed process would log nothing."""
    return not (record.exc_info and isinstance(record.exc_info[1], asyncio.CancelledError))


logging.getLogger("uvicorn.error").addFilter(_was_not_killed)
SECRET = "a secret of the tests, long enough"


class QuickModels(RuleModels):
    """As `ModelServer`, without processes."""

    def __call__(self, *_: Any, **__: Any) -> "QuickModels":
        return self

    async def start(self) -> None: ...

    async def close(self) -> None: ...

    async def add(self, *_: Any) -> None: ...

    async def drop(self, _: str) -> None: ...

    def has(self, *_: Any) -> bool:
        return True

    ready = True

    def statistics(self) -> ModelStatistics:
        return ModelStatistics(0, 0, {}, (0.0, 0.0, 0.0))


class LiveServer:
    """`with LiveServer(folder) as live:` serves at `live.url` until the end of the block."""

    def __init__(
        self, folder: Path, speed: float = 10.0, study: str = SHORT_STUDY, real_models: bool = False, **settings: Any
    ) -> None:
        """`more_studies`: files of other studies; `database`: another than SQLite; `port`: where it serves, else a
        free one; all else goes to the settings."""
        file = folder / "short.yaml"
        file.write_text(study, encoding="utf-8")
        self.database = str(settings.pop("database", None) or with_tables(folder / "study.sqlite3"))
        studies = (file, *settings.pop("more_studies", ()))
        self._port: int = settings.pop("port", 0)
        settings.setdefault("data", folder)
        self.settings = Settings(
            database=self.database, studies=studies, speed=speed, secret=SECRET, _env_file=None, **settings
        )
        self.models = QuickModels()
        self._real_models = real_models
        self.app: FastAPI
        self._thread: threading.Thread | None = None
        self._loop: asyncio.AbstractEventLoop
        self._server: uvicorn.Server
        self._failed: BaseException | None = None

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self._port}"

    @property
    def port(self) -> int:
        return self._port

    def start(self) -> None:
        """Return when pages can be opened; after the first time at the same address."""
        listening = listen("127.0.0.1", self._port)
        self._port = listening.getsockname()[1]
        started = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(listening, started), daemon=True)
        self._thread.start()
        assert started.wait(60)
        if self._failed is not None:
            raise self._failed

    def _run(self, listening: socket.socket, started: threading.Event) -> None:
        async def serve() -> None:
            self._loop, self._killed = asyncio.get_running_loop(), asyncio.Event()
            try:
                self.app = server.main.create_app(self.settings)
                async with AsyncExitStack() as stack:
                    models = server.main.ModelServer if self._real_models else self.models
                    with patch.object(server.main, "ModelServer", models):
                        await stack.enter_async_context(server.main.wired(self.app, self.settings))
                    self._server = _server(self.app, self.settings)
                    serving = asyncio.create_task(self._server.serve(sockets=[listening]))
                    while not self._server.started and not serving.done():
                        await asyncio.sleep(0.005)
                    started.set()
                    dying = asyncio.create_task(self._killed.wait())
                    await asyncio.wait({serving, dying}, return_when=asyncio.FIRST_COMPLETED)
                    if self._killed.is_set():
                        await self._die(listening)
                        stack.pop_all()
                    dying.cancel()
            except BaseException as error:  # noqa: BLE001 - raised in the thread that started us
                self._failed = error
                started.set()

        with listening:  # also when it never came to serving
            asyncio.run(serve())

    async def _die(self, listening: socket.socket) -> None:
        """Stop without closing sockets or a last commit: whatever was waiting is lost."""
        database = self.app.state.services.web.database

        def refuse(*_: Any) -> Any:
            raise DatabaseDown("the process is gone")

        database._submit = refuse
        while not database._jobs.empty():
            database._jobs.get_nowait()
        listening.close()
        for connection in list(self._server.server_state.connections):
            connection.transport.abort()
        mine = asyncio.current_task()
        others = [task for task in asyncio.all_tasks() if task is not mine]
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)
        await asyncio.to_thread(database.close)

    def kill(self) -> None:
        """At once."""
        self._loop.call_soon_threadsafe(self._killed.set)
        self._join()

    def stop(self) -> None:
        """As SIGTERM does."""
        self._loop.call_soon_threadsafe(setattr, self._server, "should_exit", True)
        self._join()

    def _join(self) -> None:
        assert self._thread is not None
        self._thread.join(30)
        assert not self._thread.is_alive(), "the server does not stop"
        self._thread = None

    def do(self, work: Callable[[], Coroutine[Any, Any, T]]) -> T:
        """Run something on the server's own loop."""
        return asyncio.run_coroutine_threadsafe(work(), self._loop).result(30)

    def __enter__(self) -> "LiveServer":
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._thread is not None:
            self.stop()
        if self._failed is not None:
            raise self._failed
