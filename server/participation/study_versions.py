"""Watch the served study files: report changes, and load new versions without a restart. Participants who have begun
keep their version, so its agents and predictors stay loaded; at the start, those that the newest version no longer
names are loaded for participants who are still in the study. Several processes serve the same version: all prepare a
new one before any opens it, and a process that missed this follows the others.
"""

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from sqlalchemy import Connection, select

from models.inference.runner import ModelServer
from models.inference.supervised_worker import ModelsDown
from server.participation.model_hashes import ModelHashes, changed_models
from server.participation.own_kitchens import (
    keep_own_models,
    load_with_kitchens,
    with_own_kitchens,
    with_own_models,
)
from server.participation.served_studies import Studies
from server.participation.study_changes import ChangedStudy, ServedVersion, Serving
from server.required_models import RequiredModels, required_models
from server.settings import Settings
from server.store import kitchens, study_openings
from server.store import studies as stored_studies
from server.store.database import Database, DatabaseDown
from server.store.tables import participants
from server.study.loader import PlacedProblem, StudyError, StudyFile, parse_study
from server.study.steps import has_rounds_for_two
from server.study_check import missing_problems

log = logging.getLogger(__name__)
LOOK_EVERY_S: Final = 3.0
NEVER_CHOSEN: Final = 0.0
_JOINED: Final = -1.0
_Stamp = tuple[int, int]  # modification time and size
_NOT_LOOKED: Final[_Stamp] = (-1, -1)
OtherProcesses = Callable[[], Awaitable[Sequence[Serving]]]  # the other processes of this server


class StudyVersions:
    """The files of a server; made once in server.main, `run` checks them until it is cancelled."""

    def __init__(
        self,
        settings: Settings,
        files: Sequence[StudyFile],
        models: ModelServer,
        studies: Studies,
        other_processes: OtherProcesses | None = None,
    ) -> None:
        self._settings, self._models, self._studies, self._other_processes = settings, models, studies, other_processes
        self._database: Database | None = None
        self._files = list(files)  # every one that was ever served here: participants may still be in it
        self._served = {file.study.name: file for file in files}
        self._from_files = frozenset(self._served)
        self._refused: set[str] = set()  # SHA-256 of versions from drafts that cannot be served
        self._stamps = {name: _stamp(Path(file.source)) for name, file in self._served.items()}
        self._hashes = ModelHashes()
        self._hashes.loaded(required_models(files))
        self._opened_at = dict.fromkeys(self._served, NEVER_CHOSEN)
        self._prepared: dict[str, tuple[int, StudyFile]] = {}  # by SHA-256
        self.changed: dict[str, ChangedStudy] = {}

    def served(self) -> tuple[ServedVersion, ...]:
        """Return what this process serves, for the others."""
        return tuple(ServedVersion(name, file.sha256, self._opened_at[name]) for name, file in self._served.items())

    def fingerprint(self, layout: str, model: str) -> str | None:
        """Return the SHA-256 that identifies a model in the data."""
        return self._hashes.of(layout, model)

    async def begin(self, database: Database, joins: bool = False) -> None:
        """Load the models that participants of earlier versions need. `joins`: other processes serve already, so this
        one serves the same versions; the files may have changed since they started."""
        self._database = database
        if joins:
            self._opened_at = dict.fromkeys(self._served, _JOINED)
            await self._follow()
        await self.serve_opened(database)
        await self.load_earlier(database)
        for name, file in self._served.items():
            for words in await database.read(changed_models, name, file.sha256, self.fingerprint):
                log.warning("%s: %s", name, words)

    async def run(self) -> None:
        """Check the files every few seconds, and the other processes if there are any."""
        while True:
            await asyncio.sleep(LOOK_EVERY_S)
            try:
                await asyncio.to_thread(self.find_changes)
                await self._follow()
            except DatabaseDown:
                pass
            except Exception:
                log.exception("the study files could not be checked")

    async def _follow(self) -> None:
        """Load every version that participants can be in, and serve the one that was chosen last."""
        database = self._database
        if self._other_processes is None or database is None:
            return
        await self.serve_opened(database)
        known = self._studies.every_version()
        await database.read(self._studies.learn)
        if self._studies.every_version() != known:
            await self.load_earlier(database)
        theirs = [version for process in await self._other_processes() for version in process.served]
        for version in sorted(theirs, key=lambda one: one.opened_at):
            if version.opened_at <= self._opened_at.get(version.study, version.opened_at):  # also one from a draft
                continue
            try:
                await self.prepare(database, version.study, version.sha256)
            except StudyError as error:
                log.warning("%s is not served as in other processes: %s", version.study, error)
            else:
                self.open(version)

    def find_changes(self) -> None:
        """Find the files that differ from the version served."""
        for name in self._from_files:
            file = self._served[name]
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
        """Read the current file. Raises StudyError, OSError."""
        settings = self._settings
        file = load_with_kitchens(served.source, self._kitchens, settings.models_folder, settings.own_models)
        if file.study.name != name:
            raise StudyError([f"{file.source}:1: the study is now called {file.study.name!r}, not {name!r}."])
        return self._usable(file)

    def _kitchens(self) -> dict[str, str]:
        return {} if self._database is None else self._database.read_now(kitchens.grids)

    def _usable(self, file: StudyFile) -> StudyFile:
        missing = [file.describe(problem) for problem in missing_problems(file, required_models([file]))]
        if missing:
            raise StudyError(missing)
        required_models([*self._files, file])  # participants may still be in the others: one name, one kitchen
        return file

    async def prepare_file(self, database: Database, name: str) -> ServedVersion:
        """Store the current content of the file as a version, and load its models; return the version to open. Raises
        StudyError (also for a model that does not load), OSError, DatabaseDown."""
        file = await asyncio.to_thread(self._checked, name, self._served[name])
        await self._have(database, file)
        return ServedVersion(name, file.sha256, time.time())

    async def prepare(self, database: Database, name: str, sha256: str) -> None:
        """Do the same for a version that another process has stored. Raises StudyError, DatabaseDown."""
        served = self._served.get(name)
        if served is not None and served.sha256 == sha256:
            return
        row = next((row for row in await database.read(stored_studies.every, name) if row.sha256 == sha256), None)
        if row is None:
            raise StudyError([f"{name} has no version {sha256[:12]}"])
        source, folder = (served.source, served.folder) if served is not None else (f"the draft of {name}", self.folder)
        file = replace(parse_study(row.source, source), folder=folder, own_models=self._settings.own_models)
        await self._have(database, await asyncio.to_thread(self._usable, file))

    async def _have(self, database: Database, file: StudyFile) -> None:
        await asyncio.to_thread(keep_own_models, file)
        required = required_models([*self._files, file])
        try:
            await self._load(required)
        except ModelsDown as error:
            raise StudyError([f"{file.source}: {error}"]) from error
        self._prepared[file.sha256] = (await self._studies.add(database, file), file)
        self._files.append(file)

    def open(self, version: ServedVersion) -> bool:
        """Serve a prepared version to new participants. False: it was not prepared here."""
        name, served = version.study, self._served.get(version.study)
        found = self._prepared.pop(version.sha256, None)
        if found is None and (served is None or served.sha256 != version.sha256):
            return False
        self._opened_at[name] = version.opened_at
        if found is not None:
            number, self._served[name] = found
            self._studies.let_into(name, number)
            self.changed.pop(name, None)
            self._stamps[name] = _NOT_LOOKED  # the file may have changed again
        return True

    @property
    def folder(self) -> Path:
        """Where relative paths of models start in a study that was written in the dashboard."""
        return self._settings.models_folder or (self._files[0].folder if self._files else Path.cwd())

    def as_opened(self, file: StudyFile, grids: Mapping[str, str]) -> StudyFile:
        """Return a study that was written in the dashboard as it would be opened now, with what it names."""
        whole = with_own_kitchens(replace(file, folder=self.folder), lambda: grids)
        return with_own_models(whole, self._settings.own_models)

    def clash(self, file: StudyFile) -> list[PlacedProblem]:
        """Return what keeps the study from being served next to the versions that are here."""
        try:
            required_models([*self._files, file])
        except StudyError as error:
            return list(error.placed)
        return []

    def of_files(self) -> tuple[StudyFile, ...]:
        """Return the studies that are served from files."""
        return tuple(self._served[name] for name in self._from_files)

    def file_of(self, name: str) -> StudyFile | None:
        """Return the version of a study that new participants get."""
        return self._served.get(name)

    async def prepare_draft(self, database: Database, file: StudyFile) -> tuple[ServedVersion, int]:
        """Store a study that was written in the dashboard as a version, and load its models; return the version to open
        and its number. Raises StudyError, DatabaseDown."""
        if file.study.name in self._from_files:
            reason = f"{file.study.name!r} is served from a file of this server"
            raise StudyError([f"{file.source}:1: {reason}. Choose another name."])
        if self._other_processes is not None and has_rounds_for_two(file.study):
            reason = "two people of one round must reach the same process, and this server has several"
            raise StudyError([f"{file.source}:1: {reason}. Serve the study with one worker."])
        await self._have(database, await asyncio.to_thread(self._usable, file))
        return ServedVersion(file.study.name, file.sha256, time.time()), self._prepared[file.sha256][0]

    async def serve_opened(self, database: Database) -> None:
        """Serve the studies that were opened in the dashboard. The log has those that cannot be served."""
        for one in await database.read(study_openings.needed):
            served = self._served.get(one.study)
            if one.study in self._from_files or one.sha256 in self._refused or (served and served.sha256 == one.sha256):
                continue
            try:
                await self.prepare(database, one.study, one.sha256)
            except (ValueError, OSError) as error:  # StudyError; a layout that a later version no longer has
                if not isinstance(error.__cause__, ModelsDown):  # that passes: it is tried again
                    self._refused.add(one.sha256)
                log.warning("%s, which %s opened, is not served: %s", one.study, one.opened_by, error)
            else:
                self.open(ServedVersion(one.study, one.sha256, one.opened_at.timestamp()))

    async def load_earlier(self, database: Database) -> None:
        """Load the models for participants of earlier versions who are still in the study. Failures are logged and do
        not affect other participants."""
        for study_id in await database.read(_in_use):
            study = self._studies.version(study_id)
            newest = self._served.get(study.name) if study is not None else None
            if study is None or (newest is not None and study == newest.study):
                continue
            try:
                if newest is None:
                    raise StudyError(["no version of the study is served"])
                file = replace(newest, study=study, source=f"{study.name} (an earlier version)")
                required = required_models([*self._files, file])
                await self._load(required)
            except (StudyError, ModelsDown) as error:
                log.warning("participants of an earlier version of %s play without its models: %s", study.name, error)
            else:
                self._files.append(file)

    async def _load(self, required: RequiredModels) -> None:
        await self._models.add(required.agents, required.predictors, required.grids, required.paths)
        self._hashes.loaded(required)


def _stamp(path: Path) -> _Stamp:
    try:
        found = path.stat()
    except OSError:
        return (0, 0)
    return (found.st_mtime_ns, found.st_size)


def _in_use(connection: Connection) -> list[int]:
    """Return the versions of active participants."""
    query = select(participants.c.study_id).where(participants.c.status == "active").distinct()
    return sorted(connection.execute(query).scalars())
