"""The file of a SQLite database: the lock that keeps a second server out, and a check that the file is still there.

SQLite keeps writing to the file that it opened, even if somebody moves, deletes or replaces it: all commits would
succeed, and be lost when the server ends.
"""

import fcntl
import os
from contextlib import suppress
from pathlib import Path
from typing import IO, Final

from server.store import private_files
from server.store.database_errors import DatabaseDown, DatabaseInUse

# The file format says at this offset how a database is read: 2 with a log (every database that a server has opened), 1
# without one (what `VACUUM INTO` and so `kitchenmind backup` writes). https://sqlite.org/fileformat.html
_READ_VERSION: Final = 19
_WRITABLE: Final = "Give a database in a folder with free space, in which the server may write."
_WITHOUT_LOG: Final = b"\x01"


class OpenedFile:
    """The file of a database as it was when it was opened."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._identity = _identity(path)

    def check(self) -> None:
        """Raise DatabaseDown unless the address still leads to the file that was opened."""
        now = _identity(self._path)
        if now != self._identity:
            what = "moved or deleted" if now is None else "replaced by another file"
            raise DatabaseDown(
                f"{self._path} was {what} while the server uses it, so nothing more is stored. Put it back."
            )


def locked(path: Path) -> IO[str]:
    """Return the lock of the database, held while the server lives: the system releases it when the process dies,
    however it dies. Makes the database's files. Raises DatabaseInUse, DatabaseDown."""
    check_log(path)
    lock = Path(f"{path}.lock")
    was_there = lock.exists()
    try:
        private_files.make_database(path, lock)
        file = lock.open("a+", encoding="utf-8")
    except OSError as error:
        if not was_there:
            with suppress(OSError):
                lock.unlink()  # no trace of an address that does not work
        raise DatabaseDown(f"cannot open {error.filename or lock}: {error.strerror}. {_WRITABLE}") from error
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.seek(0)
        owner = file.read().strip() or "unknown"
        file.close()
        raise DatabaseInUse(
            f"another kitchenmind server (process {owner}) uses {path}. Stop it, or use another database."
        ) from None
    _sign(file)
    return file


def _sign(file: IO[str]) -> None:
    """Write who holds the lock, for the message to others."""
    file.truncate(0)
    try:
        os.write(file.fileno(), f"{os.getpid()}\n".encode())
    except OSError as error:  # a full disk
        path = file.name
        file.close()
        raise DatabaseDown(f"cannot write {path}: {error.strerror}. {_WRITABLE}") from error


def check_log(path: Path) -> None:
    """Raise DatabaseDown if SQLite's log is there without its database, or next to a copy that never had a log. SQLite
    would drop the log of the first, which has its newest data, and mix the pages of two databases in the second."""
    log = Path(f"{path}-wal")
    if _size(log) == 0:
        return
    if _size(path) == 0:
        raise DatabaseDown(
            f"{path} is missing, but its log {log.name} is there. Put the database back, or move the log away."
        )
    with path.open("rb") as file:
        header = file.read(_READ_VERSION + 1)
    if header[_READ_VERSION:] == _WITHOUT_LOG:
        raise DatabaseDown(
            f"{path} is a backup, but the log {log.name} of the database that it replaced is still there. Move the "
            f"log and {path.name}-shm away, or put the database back to which they belong."
        )


def _size(path: Path) -> int:
    """Return the bytes of a file; 0 if there is none, or it cannot be looked at (opening it will say why)."""
    try:
        return path.stat().st_size
    except OSError:
        return 0


def _identity(path: Path) -> tuple[int, int] | None:
    """Return the device and number of a file; None: there is none."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino
