"""Several server processes on one listening socket: started, watched, started again when they die, stopped together.

It serves nothing itself. Any free process accepts the next connection; when one dies, its connections close, and the
browsers reconnect to the others.
"""

import logging
import os
import signal
import socket
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Final

from models.inference.circuit_breaker import Breaker

log = logging.getLogger(__name__)
_ENTRY: Final = Path(__file__).resolve().parents[2] / "kitchenmind"
# "socket,lifeline,first": two descriptors, and whether the process prints the address
OF_SUPERVISOR: Final = "KITCHENMIND_SUPERVISED"


@dataclass
class _Process:
    number: int
    running: subprocess.Popen[bytes]
    breaker: Breaker
    starts: int = 1


class Supervisor:
    """Runs `words` (the command line of `kitchenmind`) in several processes until SIGTERM or SIGINT. What has not
    stopped `kill_after_s` later is killed."""

    def __init__(self, words: list[str], listening: socket.socket, workers: int, kill_after_s: float) -> None:
        self._words, self._listening = words, listening
        self._processes: list[_Process] = []
        self._lifeline, self._ours = os.pipe()  # closes when this process dies, however it dies: then they stop too
        self._workers, self._kill_after_s = workers, kill_after_s
        self._stopping = False

    def run(self) -> int:
        """Return the exit status: 0 after a clean stop, that of the first process that refused to start otherwise."""
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._stop)
        self._processes = [
            _Process(number, self._spawn(number), Breaker(faults_to_open=3)) for number in range(self._workers)
        ]
        status = 0
        while not self._stopping and status == 0:
            time.sleep(0.1)
            status = self._replace_dead()
        self._end_all()
        return status

    def _replace_dead(self) -> int:
        """Replace a process that died. Not 0: a process refuses to start."""
        for process in self._processes:
            status = process.running.poll()
            if status is None or self._stopping or not process.breaker.closed:
                continue
            if status > 0 and process.starts == 1:  # it has reported a permanent problem: a restart would not help
                return status
            process.breaker.failed()
            log.error("server process %d ended with status %s and is restarted", process.number, status)
            process.starts += 1
            process.running = self._spawn(process.number, first=False)
        return 0

    def _spawn(self, number: int, first: bool = True) -> subprocess.Popen[bytes]:
        descriptors = (self._listening.fileno(), self._lifeline)
        passed = ",".join(map(str, (*descriptors, int(first and number == 0), int(not first))))
        command = [sys.executable, str(_ENTRY), *self._words]
        return subprocess.Popen(  # noqa: S603
            command, pass_fds=descriptors, env={**os.environ, OF_SUPERVISOR: passed}, start_new_session=True
        )

    def _stop(self, number: int, frame: FrameType | None) -> None:  # noqa: ARG002
        self._stopping = True

    def _end_all(self) -> None:
        running = [process.running for process in self._processes]
        for process in running:
            process.terminate()
        until = time.monotonic() + self._kill_after_s
        for process in running:
            try:
                process.wait(max(0.0, until - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


@dataclass(frozen=True)
class Supervised:
    """What a process gets from its supervisor."""

    listening: socket.socket
    lifeline: int  # readable when the supervisor has ended
    first: bool  # it prints the address
    again: bool  # it takes the place of a process that died


def supervised() -> Supervised | None:
    """Return what the supervisor gave this process; None for a process without a supervisor."""
    passed = os.environ.pop(OF_SUPERVISOR, "")
    if not passed:
        return None
    descriptor, lifeline, first, again = map(int, passed.split(","))
    listening = socket.socket(fileno=descriptor)
    listening.setblocking(False)
    return Supervised(listening, lifeline, bool(first), bool(again))
