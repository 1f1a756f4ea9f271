"""What the researchers' pages know of study files that have changed since they were loaded."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from server.store.database import Database


@dataclass(frozen=True)
class ChangedStudy:
    """A study file that is not as it is served. `problem`: why it cannot be served as it is now; empty: it can."""

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
    can_take: bool
    """Whether a new version can be served without a restart: with one server process."""

    async def take(self, database: Database, name: str) -> str:
        """Serve the new version of a study; return its SHA-256. Raises StudyError, OSError, DatabaseDown."""
        ...


def remedy(versions: Versions, name: str) -> str:
    """Return what can be done about a changed file, as a sentence."""
    changed: Mapping[str, ChangedStudy] = versions.changed
    if changed[name].problem:
        return "Correct it; `kitchenmind study check` says more."
    return (
        "The dashboard of the study offers the new version." if versions.can_take else "Restart the server to serve it."
    )
