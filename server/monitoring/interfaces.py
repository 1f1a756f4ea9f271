"""What monitoring needs of the application. `server.web.dependencies.Web` provides it."""

from typing import Protocol

from server.participation.served_studies import Studies
from server.store.database import Database


class HourlyLimit(Protocol):
    """The limit on new participants from one address per hour."""

    an_hour: int


class MonitoredServer(Protocol):
    """The database, the served studies and the limit on new participants of this server."""

    @property
    def database(self) -> Database: ...

    @property
    def studies(self) -> Studies: ...

    @property
    def enrolment_limits(self) -> HourlyLimit: ...


class OpenSockets(Protocol):
    """The open game sockets of this process."""

    def rtts_ms(self) -> dict[str, float]:
        """Return the last round trip of each participant."""
        ...

    def __len__(self) -> int: ...
