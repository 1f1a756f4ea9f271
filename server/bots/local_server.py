"""A `kitchenmind serve` process for tests and bots: start on a free port, stop, kill, restart at the same address."""

import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Final, Self

from server.settings import ROOT

START_TIMEOUT_S: Final = 240.0
STOP_TIMEOUT_S: Final = 60.0
LOCAL: Final = {"KITCHENMIND_MODE": "local", "KITCHENMIND_HOST": "127.0.0.1", "KITCHENMIND_PUBLIC_URL": ""}
# Countdowns and absences run five times as fast; if they ran faster still, a delay on a busy machine would count as an
# absence.
QUICK: Final = {"KITCHENMIND_SPEED": "5", "KITCHENMIND_PATIENCE_S": "2"}


class ServerFailed(Exception):
    """The server did not start; the message is its output."""


class OwnServer:
    """`with OwnServer(...) as server:` serves until the end of the block."""

    def __init__(self, database: str, study: Path, environment: Mapping[str, str] | None = None) -> None:
        self.url, self.database = "", database
        self._words = ["--study", str(study), "--database", database]
        own = {name: value for name, value in os.environ.items() if not name.startswith("KITCHENMIND_")}
        self._environment = own | LOCAL | dict(environment or {})
        self._port = 0
        self._process: subprocess.Popen[bytes] | None = None
        self._log = Path(tempfile.mkstemp(prefix="kitchenmind-", suffix=".log")[1])

    def add_study(self, study: Path) -> None:
        """Serve this study too, from the next start on."""
        self._words += ["--study", str(study)]

    def start(self) -> None:
        """Start the server and wait until pages can be opened; a restart uses the same address. Raises ServerFailed."""
        words = [sys.executable, str(ROOT / "kitchenmind"), "serve", "--port", str(self._port), *self._words]
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(words, stdout=log, stderr=log, env=self._environment)  # noqa: S603
        deadline = time.monotonic() + START_TIMEOUT_S
        while not (found := re.search(r"http://127\.0\.0\.1:(\d+)", self.output)):
            if self._process.poll() is not None or time.monotonic() > deadline:
                raise ServerFailed(
                    self.output.strip()
                    or f"the server did not start within {START_TIMEOUT_S:g} s. Try again when the machine is less busy"
                )
            time.sleep(0.05)
        self.url, self._port = found.group(0), int(found.group(1))

    @property
    def output(self) -> str:
        """Return the server's output (standard output and error) since its last start."""
        return self._log.read_text(encoding="utf-8", errors="replace")

    def end(self, how: signal.Signals = signal.SIGTERM) -> int:
        """Send the signal, wait, and return the exit status."""
        if self._process is None:
            return 0
        self._process.send_signal(how)
        return self._process.wait(STOP_TIMEOUT_S)

    def __enter__(self) -> Self:
        try:
            self.start()
        except BaseException:
            self._clear_away()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, simulation: TracebackType | None
    ) -> None:
        self._clear_away()

    def _clear_away(self) -> None:
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(STOP_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._log.unlink(missing_ok=True)


def kitchenmind(*words: str) -> Sequence[str]:
    """Return the command line of another verb, in this Python."""
    return [sys.executable, str(ROOT / "kitchenmind"), *words]
