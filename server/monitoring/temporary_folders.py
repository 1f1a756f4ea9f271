"""Folders of exports and reports that a server makes. They are removed even if the server is killed: by the process
that works in them, or by the next server.
"""

import os
import shutil
import tempfile
import threading
import time
from pathlib import Path
from typing import Final, Literal

from server.store import work_folders
from server.store.work_folders import WorkFolder

Kind = Literal["export", "report"]
_KINDS: Final[tuple[Kind, ...]] = ("export", "report")
_LOOK_EVERY_S: Final = 0.5


class TemporaryFolder(WorkFolder):
    """A new folder among the system's temporary ones."""

    def __init__(self, kind: Kind) -> None:
        super().__init__(_prefix(kind), Path(tempfile.gettempdir()))


def remove_abandoned() -> None:
    """Remove the folders of servers that were killed."""
    for kind in _KINDS:
        work_folders.remove_abandoned(_prefix(kind), Path(tempfile.gettempdir()))


def end_with_the_server(folder: Path) -> None:
    """End this process, which the server started, and remove its folder as soon as the server has died."""
    server = os.getppid()

    def watch() -> None:
        while os.getppid() == server:
            time.sleep(_LOOK_EVERY_S)
        shutil.rmtree(folder, ignore_errors=True)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _prefix(kind: Kind) -> str:
    return f"kitchenmind-{kind}-"
