"""Run simulated participants through a draft: `kitchenmind bots` in a separate process with its own database. One
rehearsal runs at a time, at low priority. The result is kept while the server runs, and permanently in the audit log.
"""

import asyncio
import contextlib
import json
import logging
import os
import signal
import sys
import tempfile
import time
from collections.abc import Awaitable, Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from server.background_tasks import ended

log = logging.getLogger(__name__)
MAX_BOTS: Final = 40
TIMEOUT_S: Final = 1800.0
_NICE: Final = 10
_END_TIMEOUT_S: Final = 5.0
_PROGRAM: Final = Path(__file__).parents[2] / "kitchenmind"
_MAX_MESSAGE: Final = 4000


@dataclass(frozen=True)
class Rehearsal:
    """One rehearsal of a draft. `outcome`: what `kitchenmind bots --json` printed; `failure`: why there is none;
    `began_at`: in Unix seconds."""

    draft: int
    revision: int
    number: int
    by: str
    is_running: bool = True
    outcome: dict[str, Any] = field(default_factory=dict)
    failure: str = ""
    began_at: float = field(default_factory=time.time)

    @property
    def minutes(self) -> int:
        """How long ago it began."""
        return int(max(0.0, time.time() - self.began_at) / 60)


Note = Callable[[Rehearsal], Awaitable[Any]]


class Rehearsals:
    """The newest rehearsal of each draft; made once in server.main."""

    def __init__(self, stack: contextlib.AsyncExitStack, data: Path | None = None) -> None:
        """`stack`: stops what is running at the server's end; `data`: the server's folder, with its trained models."""
        self._data = data
        self._newest: dict[int, Rehearsal] = {}
        self._task: asyncio.Task[None] | None = None
        stack.push_async_callback(self.stop)

    def of(self, draft: int, of_others: Iterable[Rehearsal] = ()) -> Rehearsal | None:
        """Return the newest rehearsal of a draft. `of_others`: those of other processes of this server."""
        found = [one for one in (*self._newest.values(), *of_others) if one.draft == draft]
        return max(found, key=lambda one: one.began_at, default=None)

    def shared(self) -> tuple[Rehearsal, ...]:
        """Return the rehearsals of this process for the pages of the others."""
        return tuple(self._newest.values())

    @property
    def is_busy(self) -> bool:
        return self._task is not None and not self._task.done()

    def start(self, rehearsal: Rehearsal, text: str, note: Note) -> bool:
        """Start a rehearsal, and call `note` at the end. False: another rehearsal is running."""
        if self.is_busy:
            return False
        self._newest[rehearsal.draft] = rehearsal
        self._task = asyncio.create_task(self._run(rehearsal, text, note))
        return True

    async def stop(self) -> None:
        await ended(self._task)

    async def _run(self, rehearsal: Rehearsal, text: str, note: Note) -> None:
        try:
            with tempfile.TemporaryDirectory(prefix="kitchenmind-rehearsal-") as folder:
                file = Path(folder) / "draft.yaml"
                file.write_text(text, encoding="utf-8")
                status, output, errors = await _bots(rehearsal.number, file, self._data)
        except OSError as error:  # a full disk, too many processes
            status, output, errors = None, "", str(error)
        outcome: dict[str, Any] = {}
        with contextlib.suppress(ValueError):
            outcome = json.loads(output)
        failure = "" if outcome else (errors.strip()[-_MAX_MESSAGE:] or f"the command ended with status {status}")
        over = replace(rehearsal, is_running=False, outcome=outcome, failure=failure)
        try:
            await note(over)
        except Exception:
            log.exception("the audit log could not note a rehearsal")
        self._newest[rehearsal.draft] = over


async def _bots(number: int, file: Path, data: Path | None) -> tuple[int | None, str, str]:
    """Run the command; return its status and what it printed. It is ended if it takes too long, or with the server."""
    words = ("bots", str(number), "--study", str(file), "--fast", "--json")
    pipe = asyncio.subprocess.PIPE
    environment = os.environ | ({"KITCHENMIND_DATA": str(data.absolute())} if data is not None else {})
    process = await asyncio.create_subprocess_exec(
        *("nice", "-n", str(_NICE), sys.executable, str(_PROGRAM), *words),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=pipe,
        stderr=pipe,
        start_new_session=True,
        env=environment,
    )
    try:
        async with asyncio.timeout(TIMEOUT_S):
            output, errors = await process.communicate()
        return process.returncode, output.decode(errors="replace"), errors.decode(errors="replace")
    except TimeoutError:
        return None, "", f"the bots took more than {TIMEOUT_S / 60:.0f} minutes"
    finally:
        if process.returncode is None:
            await _end(process)


async def _end(process: asyncio.subprocess.Process) -> None:
    """End the bots and the server that they started."""
    for how in (signal.SIGTERM, signal.SIGKILL):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, how)
        with contextlib.suppress(asyncio.CancelledError, TimeoutError):
            async with asyncio.timeout(_END_TIMEOUT_S):
                await process.communicate()
        if process.returncode is not None:
            return
