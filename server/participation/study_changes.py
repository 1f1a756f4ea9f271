"""The interface for changed study files, as the researchers' pages use it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from server.store.database import Database
from server.study.loader import PlacedProblem, StudyFile


@dataclass(frozen=True)
class ServedVersion:
    """The version of a study that new participants of a process get. `opened_at`: when a researcher chose it; 0: since
    the start; less: the same, of a process that was restarted while others run."""

    study: str
    sha256: str
    opened_at: float


class Serving(Protocol):
    """The studies of a process."""

    @property
    def served(self) -> Sequence[ServedVersion]: ...


@dataclass(frozen=True)
class ChangedStudy:
    """A study file that differs from the version served. `problem`: why its current content cannot be served; empty: it
    can."""

    name: str
    source: str
    served_sha256: str
    sha256: str = ""
    problem: str = ""

    @property
    def text(self) -> str:
        """Say it in a sentence or two."""
        served = f"version {self.served_sha256[:12]} is still served"
        if self.problem:
            return f"{self.name}: the study file has changed and cannot be served ({self.problem}); {served}."
        return f"{self.name}: the study file has changed (now {self.sha256[:12]}); {served}."


class Versions(Protocol):
    """The study files of this server."""

    changed: dict[str, ChangedStudy]

    def fingerprint(self, layout: str, model: str) -> str | None:
        """Return the SHA-256 of a loaded model; None for one without files."""
        ...

    def find_changes(self) -> None:
        """Find the files that differ from the version served."""
        ...

    async def prepare_file(self, database: Database, name: str) -> ServedVersion:
        """Store the current content of the file as a version, and load its models. Raises StudyError, OSError,
        DatabaseDown."""
        ...

    async def prepare(self, database: Database, name: str, sha256: str) -> None:
        """Read a stored version and load its models, before participants get it. Raises StudyError, DatabaseDown."""
        ...

    def open(self, version: ServedVersion) -> bool:
        """Serve a version that was prepared; False if it was not."""
        ...

    @property
    def folder(self) -> Path:
        """Where relative paths of models start in a study that was written in the dashboard."""
        ...

    def as_opened(self, file: StudyFile, grids: Mapping[str, str]) -> StudyFile:
        """Return a study that was written in the dashboard as it would be opened now: with the grids of the kitchens
        that it names, and the SHA-256 of its trained models."""
        ...

    def clash(self, file: StudyFile) -> list[PlacedProblem]:
        """Return what keeps the study from being served next to the versions that this server has: another kitchen or
        model of the same name."""
        ...

    def of_files(self) -> tuple[StudyFile, ...]:
        """Return the studies that are served from files."""
        ...

    def file_of(self, name: str) -> StudyFile | None:
        """Return the version of a study that new participants get."""
        ...

    async def prepare_draft(self, database: Database, file: StudyFile) -> tuple[ServedVersion, int]:
        """Store a study that was written in the dashboard as a version, and load its models; return the version to open
        and its number. Raises StudyError, DatabaseDown."""
        ...


def remedy(versions: Versions, name: str) -> str:
    """Return what can be done about a changed file, as a sentence."""
    changed: Mapping[str, ChangedStudy] = versions.changed
    if changed[name].problem:
        return "Correct it; `kitchenmind study check` says more."
    return "The dashboard of the study offers the new version."
