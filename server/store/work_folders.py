"""Folders in which copies of people's data are made: backups, exports, reports. A process that is killed leaves its
folder behind, so the next one of the same kind removes it.
"""

import fcntl
import os
import shutil
import tempfile
import weakref
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Final, Self

_OPEN: Final = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC


class WorkFolder:
    """A new folder in `parent` that only this account can read, locked while this process lives. Raises OSError."""

    def __init__(self, prefix: str, parent: Path) -> None:
        self.path, lock = _made(prefix, parent)
        self._remove = weakref.finalize(self, _remove, self.path, lock)

    def remove(self) -> None:
        self._remove()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.remove()


def remove_abandoned(prefix: str, parent: Path) -> None:
    """Remove the folders with this prefix of processes that were killed."""
    for folder in parent.glob(f"{prefix}*"):
        try:
            lock = os.open(folder, _OPEN)
        except OSError:  # a link, or somebody else's
            continue
        try:
            if os.fstat(lock).st_uid == os.geteuid():
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(folder, ignore_errors=True)
        except OSError:
            pass  # in use, or on a network's file system without locks
        finally:
            os.close(lock)


def _made(prefix: str, parent: Path) -> tuple[Path, int]:
    """Return a new folder and the descriptor that holds its lock."""
    while True:
        path = Path(tempfile.mkdtemp(prefix=prefix, dir=parent))
        with suppress(FileNotFoundError):  # a process that starts took it for an abandoned one
            lock = os.open(path, _OPEN)
            with suppress(OSError):  # a network's file system may have no locks: then nobody removes it
                fcntl.flock(lock, fcntl.LOCK_EX)
            if path.exists():
                return path, lock
            os.close(lock)


def _remove(path: Path, lock: int) -> None:
    shutil.rmtree(path, ignore_errors=True)
    os.close(lock)
