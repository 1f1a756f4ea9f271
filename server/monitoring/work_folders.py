"""Temporary folders in which exports and reports are made. They hold people's data, so they are removed even if the
server is killed: by the process that works in them, or by the next server.
"""

import fcntl
import os
import shutil
import tempfile
import threading
import time
import weakref
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Final, Literal, Self

Kind = Literal["export", "report"]
_KINDS: Final[tuple[Kind, ...]] = ("export", "report")
_LOOK_EVERY_S: Final = 0.5
_OPEN: Final = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC


class WorkFolder:
    """A new folder that only the server's account can read. It is locked while this process lives."""

    def __init__(self, kind: Kind) -> None:
        self.path, lock = _made(kind)
        self._remove = weakref.finalize(self, _remove, self.path, lock)

    def remove(self) -> None:
        self._remove()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.remove()


def _made(kind: Kind) -> tuple[Path, int]:
    """Return a new folder and the descriptor that holds its lock."""
    while True:
        path = Path(tempfile.mkdtemp(prefix=f"kitchenmind-{kind}-"))
        with suppress(FileNotFoundError):  # a server that starts took it for an abandoned one
            lock = os.open(path, _OPEN)
            fcntl.flock(lock, fcntl.LOCK_EX)
            if path.exists():
                return path, lock
            os.close(lock)


def _remove(path: Path, lock: int) -> None:
    shutil.rmtree(path, ignore_errors=True)
    os.close(lock)


def remove_abandoned() -> None:
    """Remove the folders of servers that were killed."""
    for folder in _folders():
        try:
            lock = os.open(folder, _OPEN)
        except OSError:  # a link, or somebody else's
            continue
        try:
            if os.fstat(lock).st_uid == os.geteuid():
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(folder, ignore_errors=True)
        except BlockingIOError:
            pass  # in use
        finally:
            os.close(lock)


def end_with_the_server(folder: Path) -> None:
    """End this process, which the server started, and remove its folder as soon as the server has died."""
    server = os.getppid()

    def watch() -> None:
        while os.getppid() == server:
            time.sleep(_LOOK_EVERY_S)
        shutil.rmtree(folder, ignore_errors=True)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _folders() -> Iterator[Path]:
    for kind in _KINDS:
        yield from Path(tempfile.gettempdir()).glob(f"kitchenmind-{kind}-*")
