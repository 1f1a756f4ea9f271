"""Files and folders with people's data: readable only by the account that runs the server."""

import os
import stat
from pathlib import Path
from typing import Final

_FILE: Final = 0o600
_FOLDER: Final = 0o700


def make_folder(folder: Path) -> None:
    """Make a folder and those above it that are missing. One that is there keeps its rights. Raises OSError."""
    if folder.is_dir():
        return
    make_folder(folder.parent)
    folder.mkdir(mode=_FOLDER, exist_ok=True)


def make_file(path: Path) -> None:
    """Make an empty file if there is none, and take an existing one away from everybody else. Raises OSError.

    An existing file is not opened: closing it again would drop the locks that SQLite has on it in this process.
    """
    try:
        os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, _FILE))
    except FileExistsError:
        tighten(path)


def make_database(database: Path, lock: Path) -> None:
    """Make the folder and the files of a SQLite database, or take existing ones away from everybody else.

    The files that SQLite makes next to the database later gets the database's own rights. Raises OSError.
    """
    make_folder(database.parent)
    for path in (lock, database):
        make_file(path)
    for extra in (Path(f"{database}-wal"), Path(f"{database}-shm")):
        if extra.exists():
            tighten(extra)


def tighten(path: Path) -> None:
    """Remove other users' rights on a file, if it is ours. Rights of a group are kept."""
    found = path.stat()
    if stat.S_IMODE(found.st_mode) & 0o007 and found.st_uid == os.geteuid():
        path.chmod(_FILE)
