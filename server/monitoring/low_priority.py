"""Start processes of the dashboard at low priority: exports, reports, files of recorded games."""

import os
import subprocess
import sys
from typing import IO

from server.settings import ROOT


def start_module(
    module: str,
    *words: str,
    database: str = "",
    standard_input: int = subprocess.DEVNULL,
    output: int,
    errors: int | IO[bytes],
) -> subprocess.Popen[bytes]:
    """Start `python -m module words`, which lowers its own priority first. Call it in a thread.

    The address of the database is passed in the environment, because it may hold a password. The event loop's own way
    to start a process is a fork, which copies the page tables of a large process and stopped all games for 30 ms. In a
    thread, the process is started without a copy (vfork).
    """
    environment = dict(os.environ)
    environment["PYTHONPATH"] = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    if database:
        environment["KITCHENMIND_DATABASE"] = database
    return subprocess.Popen(  # noqa: S603
        [sys.executable, "-W", "ignore", "-m", module, *words],
        env=environment,
        stdin=standard_input,
        stdout=output,
        stderr=errors,
    )
