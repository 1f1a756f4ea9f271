"""The other processes of this server, if it has several: what runs there, and how to reach it."""

from dataclasses import dataclass
from typing import Any, Protocol

from server.monitoring.commands import AnyGameCommand, BroadcastCommand


class ClusterDown(Exception):
    """Redis cannot be reached when the server starts."""


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

    async def run_at_owner(self, command: AnyGameCommand) -> bool:
        """Run the command in the process that plays the episode. False: no process plays it, or it failed."""
        ...

    async def run_at_all(self, command: BroadcastCommand) -> list[int]:
        """Run the command in every other process; return what they answered within a second."""
        ...


class SingleProcess:
    """The only process of its server."""

    name = "server"

    async def views(self) -> list[View]:
        return []

    async def processes(self) -> list[Process]:
        return []

    async def run_at_owner(self, command: AnyGameCommand) -> bool:  # noqa: ARG002
        return False

    async def run_at_all(self, command: BroadcastCommand) -> list[int]:  # noqa: ARG002
        return []
