"""A copy of a SQLite database while a server continues writing. PostgreSQL has its own tools: docs/guides/backup.md."""

import os
import sqlite3
from pathlib import Path
from typing import Final
from urllib.parse import quote

from sqlalchemy.engine import URL

from server.store import private_files
from server.store.engines import BUSY_TIMEOUT_S, DatabaseDown
from server.store.work_folders import WorkFolder, remove_abandoned

_UNFINISHED: Final = ".kitchenmind-backup-"


def copy_to(url: URL, path: Path) -> None:
    """Copy a SQLite database consistently to a new file, complete or not at all; the server may write at the same time.

    Raises ValueError for PostgreSQL and for a file that exists, DatabaseDown when it cannot be written.
    """
    if url.get_backend_name() != "sqlite":
        raise ValueError("this copies SQLite files. For PostgreSQL use pg_dump, see docs/guides/backup.md.")
    if path.exists():
        raise ValueError(f"{path} exists already. Choose a new file.")
    parent = path.absolute().parent
    try:
        remove_abandoned(_UNFINISHED, parent)
        with WorkFolder(_UNFINISHED, parent) as folder:
            making = folder.path / path.name
            private_files.make_file(making)  # SQLite fills an empty file
            connection = sqlite3.connect(f"file:{quote(str(url.database))}?mode=ro", timeout=BUSY_TIMEOUT_S, uri=True)
            try:
                connection.execute("VACUUM INTO ?", (str(making),))
            finally:
                connection.close()
            with making.open("rb") as file:
                os.fsync(file.fileno())
            making.replace(path)
    except sqlite3.Error as error:
        raise DatabaseDown(str(error)) from error
    except OSError as error:
        raise DatabaseDown(f"cannot write {path}: {error.strerror}. Give a folder with room for the copy.") from error
