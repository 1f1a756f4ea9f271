"""What monitoring needs of the application. `server.web.dependencies.Web` provides it."""

from typing import Protocol

from server.participation.served_studies import Studies
from server.store.database import Database


class RefusedPlaces(Protocol):
    """Counts of new participants who were refused because too many came from one address."""

    an_hour: int

    def turned_away(self, study: str) -> int: ...


class Site(Protocol):
    """The database, the served studies and the refused places of this server."""

    @property
    def database(self) -> Database: ...

    @property
    def studies(self) -> Studies: ...

    @property
    def places(self) -> RefusedPlaces: ...


class OpenSockets(Protocol):
    """The open game sockets of this process."""

    def rtts_ms(self) -> dict[str, float]:
        """Return the last round trip of each participant."""
        ...

    def __len__(self) -> int: ...
