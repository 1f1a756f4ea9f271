"""Study files while they are served: says when one has changed, and takes the new version in without a restart.

Participants who have begun keep their version, so its agents and predictors stay loaded; those that the newest version
no longer names are loaded at the start for everybody who is still in the study.
"""

import asyncio
import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from sqlalchemy import Connection, select

from models.inference.runner import ModelServer
from models.inference.supervised_worker import ModelsDown
from server.participation.served_studies import Studies
from server.participation.study_changes import ChangedStudy
from server.required_models import RequiredModels, required_models
from server.settings import Settings
from server.store.database import Database
from server.store.tables import participants
from server.study.loader import StudyError, StudyFile, load_study
from server.study_check import missing_problems

log = logging.getLogger(__name__)
LOOK_EVERY_S: Final = 3.0
_Stamp = tuple[int, int]  # modification time and size


class StudyVersions:
    """The files of a server; made once in server.main, `run` looks at them until it is cancelled."""

    def __init__(self, settings: Settings, files: Sequence[StudyFile], models: ModelServer, studies: Studies) -> None:
        self._settings, self._models, self._studies = settings, models, studies
        self._files = list(files)  # every one that was ever served here: participants may still be in it
        self._served = {file.study.name: file for file in files}
        self._stamps = {name: _stamp(Path(file.source)) for name, file in self._served.items()}
        self._required = required_models(files)
        self.changed: dict[str, ChangedStudy] = {}
        self.can_take = settings.workers == 1 and settings.redis is None

    def fingerprint(self, layout: str, model: str) -> str | None:
        """Return the SHA-256 that names a model in the data."""
        return self._required.fingerprint(layout, model)

    async def run(self) -> None:
        """Look at the files every few seconds."""
        while True:
            await asyncio.sleep(LOOK_EVERY_S)
            try:
                await asyncio.to_thread(self.look)
            except Exception:
                log.exception("the study files could not be looked at")

    def look(self) -> None:
        """Find the files that are not as they are served."""
        for name, file in self._served.items():
            stamp = _stamp(Path(file.source))
            if stamp == self._stamps[name]:
                continue
            self._stamps[name] = stamp
            found = self._compared(name, file)
            if found is None:
                self.changed.pop(name, None)
            else:
                self.changed[name] = found
                log.warning("%s", found.text)

    def _compared(self, name: str, served: StudyFile) -> ChangedStudy | None:
        try:
            file = self._checked(name, served)
        except (StudyError, OSError) as error:
            return ChangedStudy(name, served.source, served.sha256, problem=str(error).splitlines()[0])
        if file.sha256 == served.sha256:
            return None
        return ChangedStudy(name, served.source, served.sha256, file.sha256)

    def _checked(self, name: str, served: StudyFile) -> StudyFile:
        """The file as it is now. Raises StudyError, OSError."""
        file = load_study(served.source, self._settings.models_folder)
        if file.study.name != name:
            raise StudyError([f"{file.source}:1: the study is now called {file.study.name!r}, not {name!r}."])
        missing = [file.describe(problem) for problem in missing_problems(file, required_models([file]))]
        if missing:
            raise StudyError(missing)
        required_models([*self._files, file])  # participants may still be in the others: one name, one kitchen
        return file

    async def take(self, database: Database, name: str) -> str:
        """Serve the file as it is now to those who come from now on; return its SHA-256. Raises StudyError (also for a
        model that does not load), OSError, DatabaseDown; then the version that was served stays."""
        file = await asyncio.to_thread(self._checked, name, self._served[name])
        required = required_models([*self._files, file])
        try:
            await self._load(required)
        except ModelsDown as error:
            raise StudyError([f"{file.source}: {error}"]) from error
        await self._studies.take(database, file)
        self._files.append(file)
        self._served[name], self._required = file, required
        self.changed.pop(name, None)
        return file.sha256

    async def load_earlier(self, database: Database) -> None:
        """Load what participants of earlier versions need, who are still in the study. What cannot be loaded is said
        in the log: it does not keep the others from playing."""
        for study_id in await database.read(_in_use):
            study = self._studies.version(study_id)
            newest = self._served.get(study.name) if study is not None else None
            if study is None or newest is None or study == newest.study:
                continue
            file = replace(newest, study=study, source=f"{study.name} (an earlier version)")
            try:
                required = required_models([*self._files, file])
                await self._load(required)
            except (StudyError, ModelsDown) as error:
                log.warning("participants of an earlier version of %s play without its models: %s", study.name, error)
            else:
                self._files.append(file)
                self._required = required

    async def _load(self, required: RequiredModels) -> None:
        await self._models.add(required.agents, required.predictors, required.grids, required.paths)


def _stamp(path: Path) -> _Stamp:
    try:
        found = path.stat()
    except OSError:
        return (0, 0)
    return (found.st_mtime_ns, found.st_size)


def _in_use(connection: Connection) -> list[int]:
    """The versions that active participants are in."""
    query = select(participants.c.study_id).where(participants.c.status == "active").distinct()
    return sorted(connection.execute(query).scalars())
