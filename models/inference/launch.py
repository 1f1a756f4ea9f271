"""Launch the process of a model worker. This module imports very little: the server launches workers before its own
imports, so that both start at the same time.
"""

import os
import shutil
import signal
import socket
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Launched:
    """A process of `models.inference.worker` that waits for its load command, and the server's end of its
    connection."""

    process: "subprocess.Popen[bytes]"
    connection: socket.socket

    def end(self) -> None:
        """Kill the process and close the connection. May be called twice."""
        self.connection.close()
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGKILL)
        self.process.wait()


def launch() -> Launched:
    """Start a process. It ends when the connection closes; on Linux as soon as this process dies, so that the next
    server does not share its cores with orphans that are still importing."""
    ours, theirs = socket.socketpair()
    one_thread = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    environment = {**os.environ, **one_thread, "PYTHONPATH": os.pathsep.join([str(_ROOT), *sys.path])}
    setpriv = shutil.which("setpriv")
    ends_with_us = [setpriv, "--pdeathsig", "KILL"] if setpriv else []
    command = [*ends_with_us, sys.executable, "-m", "models.inference.worker", str(theirs.fileno())]
    with theirs:
        process = subprocess.Popen(command, pass_fds=[theirs.fileno()], env=environment)  # noqa: S603
    return Launched(process, ours)
