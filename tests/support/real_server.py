"""A real `kitchenmind serve` in its own process, on a free port, with its own database; to be killed and restarted."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

from tests.support import command_line
from tests.support.study_text import study_head

ROOT = Path(__file__).resolve().parents[2]
START_S = 240.0

# Scripted agents: no weights are needed, and an episode is over in seconds.
SHORT_STUDY = (
    study_head("short", "A short study")
    + """
conditions: [{name: tom, predictor: tom}, {name: random, predictor: random}, {name: none, predictor: none}]
agents: [{name: planner, predictor: sp_predictor_stream}]
layouts: [{name: coordination_ring, title: {en: Ring}}, {name: matrix, title: {en: Matrix}}]
game: {horizon: 60}
questionnaires:
  teamwork:
    title: {en: "How was it?"}
    questions:
      - {key: satisfied, type: scale, text: {en: "Satisfied?"}, low: {en: No}, high: {en: Yes}}
after_episode: teamwork
flow: [introduction, tutorial, episodes, thanks]
"""
)


class RealServer:
    """`with RealServer(folder) as server:` serves until the end of the block."""

    def __init__(self, folder: Path, speed: float = 10.0, study: str = SHORT_STUDY) -> None:
        self.study = folder / "short.yaml"
        self.study.write_text(study, encoding="utf-8")
        self.database = f"sqlite:///{folder / 'study.sqlite3'}"
        self.log = folder / "server.log"
        self.url = ""
        self.more_words: list[str] = []
        self._port, self._speed = 0, speed
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def pid(self) -> int:
        assert self._process is not None
        return self._process.pid

    def start(self) -> None:
        """Return when pages can be opened; after the first time at the same address."""
        words = ["serve", "--port", str(self._port), "--study", str(self.study), "--database", self.database]
        words += self.more_words
        with self.log.open("w") as log:
            self._process = subprocess.Popen(
                [sys.executable, str(ROOT / "kitchenmind"), *words, "--speed", str(self._speed)],
                stdout=log,
                stderr=subprocess.STDOUT,
                env={**os.environ, "KITCHENMIND_SECRET": "a secret of the tests, long enough"},
            )
        deadline = time.monotonic() + START_S
        while not (found := re.search(r"http://127\.0\.0\.1:(\d+)", self.log.read_text())):
            assert self._process.poll() is None, f"the server ended before it could be opened:\n{self.log.read_text()}"
            assert time.monotonic() < deadline, f"the server does not start:\n{self.log.read_text()}"
            time.sleep(0.05)
        self.url, self._port = found.group(0), int(found.group(1))

    def end(self, how: signal.Signals = signal.SIGTERM) -> int:
        """Send the signal and wait; the exit status."""
        assert self._process is not None
        self._process.send_signal(how)
        return self._process.wait(30)

    def command(self, *words: str) -> "subprocess.CompletedProcess[str]":
        """Run another kitchenmind command than `serve` on this server's database."""
        return command_line.run(*words, "--database", self.database)

    def __enter__(self) -> "RealServer":
        try:
            self.start()
        except BaseException:
            self._clear_away()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._clear_away()

    def _clear_away(self) -> None:
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(10)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait(10)
