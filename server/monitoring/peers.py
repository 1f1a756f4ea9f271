"""The other processes of this server, if there are several: their games, and how to send them commands."""

from dataclasses import dataclass
from datetime import datetime
from typing import Any, Protocol

from server.monitoring.commands import AnyGameCommand, BroadcastCommand
from server.monitoring.rehearsals import Rehearsal
from server.participation.study_changes import ServedVersion


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
    display_violations: int = 0  # timesteps not shown as the condition requires
    display_late: int = 0  # those of them in which the models were late


@dataclass(frozen=True)
class Alert:
    """`key` stays the same as long as it lasts; `path` leads to the page where something can be done."""

    key: str
    text: str
    path: str = "/admin"
    study: str = ""  # empty: the whole server
    since: datetime | None = None  # when it was first seen
    by_leader: bool = False  # every process could see it, and only one sends it


@dataclass(frozen=True)
class Process:
    """The status of another process: its figures, its alerts, the studies it serves, and its rehearsals."""

    name: str
    figures: dict[str, float]
    alerts: tuple[Alert, ...] = ()
    served: tuple[ServedVersion, ...] = ()
    rehearsals: tuple[Rehearsal, ...] = ()


class Peers(Protocol):
    """The interface to the other processes. No method raises if they cannot be reached: the result is then empty."""

    name: str  # of this process

    async def views(self) -> list[View]:
        """Return their games, at most a few seconds old."""
        ...

    async def processes(self) -> list[Process]: ...

    async def run_at_owner(self, command: AnyGameCommand) -> bool:
        """Run the command in the process that plays the episode. False: no process plays it, or it failed."""
        ...

    async def run_at_all(self, command: BroadcastCommand) -> list[int]:
        """Run the command in every other process; return the sum of their answers within a second."""
        ...

    async def run_in_each(self, command: BroadcastCommand, within_s: float) -> bool:
        """Run the command in every other process; return whether it succeeded in each of them in time."""
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

    async def run_in_each(self, command: BroadcastCommand, within_s: float) -> bool:  # noqa: ARG002
        return True
