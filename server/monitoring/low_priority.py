"""Processes of the dashboard that leave the processor to the games: exports and reports."""

import os
import subprocess
import sys
from typing import IO

from server.settings import ROOT


def start_module(
    module: str, *words: str, database: str, output: int, errors: int | IO[bytes]
) -> subprocess.Popen[bytes]:
    """Start `python -m module words`, which calls `give_way` first. Call it in a thread.

    The address of the database goes by the environment: it may hold a password. The event loop's own way to start a
    process forks: that copies the page tables of a large process and stopped all games for 30 ms. In a thread it is
    started without a copy (vfork).
    """
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    return subprocess.Popen(  # noqa: S603
        [sys.executable, "-W", "ignore", "-m", module, *words],
        env={**os.environ, "PYTHONPATH": path, "KITCHENMIND_DATABASE": database},
        stdin=subprocess.DEVNULL,
        stdout=output,
        stderr=errors,
    )
