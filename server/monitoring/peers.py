"""The other processes of this server, where it has several: what runs there, and how to reach it. Knows no network."""

from dataclasses import dataclass
from typing import Any, Protocol


class ClusterDown(Exception):
    """What joins the processes cannot be reached when the server starts."""


@dataclass(frozen=True)
class View:
    """A game that another process plays, as the dashboard shows it (fields: `server.monitoring.live_games`)."""

    id: str
    study_id: int
    condition: str
    phase: str
    card: dict[str, Any]
    board: dict[str, Any]
    still: dict[str, Any]


@dataclass(frozen=True)
class Process:
    """How another process is."""

    name: str
    figures: dict[str, float]


class Peers(Protocol):
    """The other processes. Nothing here raises when they cannot be reached: then nothing is known of them."""

    name: str  # of this process

    async def views(self) -> list[View]:
        """Their games, not older than some seconds."""
        ...

    async def processes(self) -> list[Process]: ...

    async def owner_does(self, deed: str, episode: str, *given: Any) -> bool:
        """Lets the process that plays the episode do it. False: no process does, or it could not."""
        ...

    async def all_do(self, deed: str, *given: Any) -> list[Any]:
        """Lets every other process do it: what they answered within a second."""
        ...


class SingleProcess:
    """One process is all there is."""

    name = "server"

    async def views(self) -> list[View]:
        return []

    async def processes(self) -> list[Process]:
        return []

    async def owner_does(self, deed: str, episode: str, *given: Any) -> bool:  # noqa: ARG002
        return False

    async def all_do(self, deed: str, *given: Any) -> list[Any]:  # noqa: ARG002
        return []
