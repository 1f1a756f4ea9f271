"""Reports of studies, made by the dashboard: `kitchenmind report` in a process that leaves the processor to the games.

The database keeps the newest report of each study, for all server processes (server.store.study_reports).
"""

import asyncio
import contextlib
import json
import logging
import subprocess
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from sqlalchemy import Connection

from kitchenmind.extras import install_command
from server.background_tasks import ended
from server.monitoring.low_priority import start_module
from server.monitoring.temporary_folders import TemporaryFolder
from server.store import audit, study_reports
from server.store.database import Database

log = logging.getLogger(__name__)
STAGES: Final = ("Exporting the data", "Computing the statistics", "Drawing the figures")
ARCHIVE: Final = "report.zip"  # these two are what the process leaves in its folder
ABOUT: Final = "about.json"
PAGE: Final = "report.html"  # in the archive
MAX_BYTES: Final = 64 * 1024 * 1024
TIMEOUT_S: Final = 3600.0
_PACKAGES: Final = ("matplotlib", "scipy")
_PROGRAM: Final = "server.commands.report_archive"
_STAGE_FILE, _ERRORS = "stage", "errors"
_LOOK_EVERY_S: Final = 0.5
_MAX_MESSAGE: Final = 1000


class ReportFailed(Exception):
    """There is no report; the text says why."""


def missing_command() -> str:
    """Return what to type where the packages of reports are missing; empty if they are installed."""
    return "" if all(find_spec(name) for name in _PACKAGES) else install_command("analysis")


def write_stage(folder: Path, stage: str) -> None:
    """Say what the process that works in this folder does now."""
    new = folder / f"{_STAGE_FILE}.new"
    new.write_text(stage, encoding="utf-8")
    new.replace(folder / _STAGE_FILE)


class StudyReports:
    """Makes reports, one at a time; made once in server.main."""

    def __init__(self, database: Database, url: str, stack: contextlib.AsyncExitStack) -> None:
        """`url`: the address of the database. `stack`: stops what is running at the server's end."""
        self._database, self._url = database, url
        self._task: asyncio.Task[None] | None = None
        stack.push_async_callback(self.stop)

    async def start(self, study: str, by: str) -> bool:
        """Begin a report, with its line in the audit log. False: another one is being made."""
        if self._task is not None and not self._task.done():
            return False
        number = await self._database.write(_begin, study, by)
        if number is None:
            return False
        self._task = asyncio.create_task(self._run(number, study, by))
        return True

    async def stop(self) -> None:
        await ended(self._task)

    async def _run(self, number: int, study: str, by: str) -> None:
        try:
            try:
                with TemporaryFolder("report") as folder:
                    await self._make(number, folder.path, study)
            except (ReportFailed, OSError) as error:  # OSError: a full disk, too many processes
                await self._database.write(study_reports.fail, number, study, by, str(error))
        except Exception:
            log.exception("the report of %s could not be made", study)

    async def _make(self, number: int, folder: Path, study: str) -> None:
        """Keep the report in the database. Raises ReportFailed, OSError."""
        errors = folder / _ERRORS
        with errors.open("wb") as file:
            process = await asyncio.to_thread(
                start_module,
                *(_PROGRAM, str(folder), study),
                database=self._url,
                output=subprocess.DEVNULL,
                errors=file,
            )
        try:
            await self._wait(number, folder, process)
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()
        if process.returncode:
            raise ReportFailed(_reason(errors.read_text(errors="replace"), process.returncode))
        about = json.loads((folder / ABOUT).read_text(encoding="utf-8"))
        archive = await asyncio.to_thread((folder / ARCHIVE).read_bytes)
        if len(archive) > MAX_BYTES:
            raise ReportFailed("The report is too large to be kept here. Use `kitchenmind report`.")
        if not await self._database.write(
            study_reports.finish, number, archive, about["participants"], about["simulated"]
        ):
            raise ReportFailed(study_reports.WITHDRAWN)

    async def _wait(self, number: int, folder: Path, process: subprocess.Popen[bytes]) -> None:
        """Return when the process has ended; tell the database what it does. Raises ReportFailed."""
        began = seen = time.monotonic()
        stage = STAGES[0]
        while process.poll() is None:
            await asyncio.sleep(_LOOK_EVERY_S)
            now = time.monotonic()
            if now - began > TIMEOUT_S:
                raise ReportFailed(f"The report took more than {TIMEOUT_S / 60:.0f} minutes and was stopped.")
            before = stage
            with contextlib.suppress(FileNotFoundError):  # there is none in the first stage
                stage = (folder / _STAGE_FILE).read_text(encoding="utf-8")
            if stage != before or now - seen > study_reports.SEEN_EVERY.total_seconds():
                seen = now
                await self._database.write(study_reports.progress, number, stage)


def _begin(connection: Connection, study: str, by: str) -> int | None:
    number = study_reports.begin(connection, study, by, STAGES[0])
    if number is not None:
        audit.add(connection, by, "report", {"study": study})
    return number


def _reason(words: str, status: int) -> str:
    """Return the process's last message; of an error in the code, its last line."""
    message = words.strip().removeprefix("kitchenmind export: ")
    if "Traceback (most recent call last)" in message:
        log.error("a report failed:\n%s", words)
        message = message.splitlines()[-1]
    return message[-_MAX_MESSAGE:] or f"The process ended with status {status}."
