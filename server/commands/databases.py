"""Open a command's database for reading only: the server may keep running."""

from collections.abc import Callable
from pathlib import Path
from typing import Concatenate, ParamSpec, TypeVar

from sqlalchemy import Connection, inspect
from sqlalchemy.exc import DBAPIError

from server.commands.server_data import ServerData
from server.participation.own_kitchens import load_with_kitchens
from server.store.database import Database, DatabaseDown
from server.store.database_file import check_log
from server.store.engines import normal_url, shown
from server.store.kitchens import grids_at
from server.store.migrate import known_revisions, newest_revision, revision_of
from server.study.loader import StudyError, StudyFile

P = ParamSpec("P")
T = TypeVar("T")
_REMEDY = "Give the right one with --data DIR or --database URL."


class NoStoredData(ValueError):
    """There is no database of kitchenmind at an address. `reason`: the message without the remedy."""

    def __init__(self, reason: str) -> None:
        super().__init__(f"{reason}. {_REMEDY}")
        self.reason = reason


class StoredDatabase(Database):
    """A database for reading that may be of another version, such as an old backup."""

    def read_now(self, function: Callable[Concatenate[Connection, P], T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Do the same as `Database.read_now`. Raises ValueError if the tables of another version do not have what is
        read."""
        try:
            return super().read_now(function, *args, **kwargs)
        except DBAPIError:
            revision = super().read_now(revision_of)
            if revision == newest_revision():
                raise
        named = shown(self.url)
        if revision not in known_revisions():
            raise ValueError(f"{named} was made by a later kitchenmind. Use that one, or a later one.")
        raise ValueError(
            f"{named} is of an earlier version ({revision}). Start `kitchenmind serve` once with it, or with a copy of "
            "it: that brings it up to date."
        )


def open_stored(url: str) -> Database:
    """Open the database at `url`. Raises ValueError: NoStoredData if there is none."""
    wanted = normal_url(url)
    named = shown(wanted)
    if wanted.get_backend_name() == "sqlite" and not Path(str(wanted.database)).is_file():
        raise NoStoredData(f"there is no database {wanted.database}")
    database = StoredDatabase(wanted.render_as_string(hide_password=False), read_only=True)
    try:
        if wanted.get_backend_name() == "sqlite":
            check_log(Path(str(wanted.database)))
        has_tables = database.read_now(lambda connection: inspect(connection).has_table("ticks"))
    except DatabaseDown as error:
        database.close()
        raise ValueError(f"cannot read {named}: {error}") from None
    if not has_tables:
        database.close()
        raise NoStoredData(f"{named} is not a kitchenmind database")
    return database


def load_stored(path: Path, server: ServerData) -> StudyFile:
    """Return the study in a file, with the kitchens and trained models of a server. Raises StudyError, OSError."""
    return load_with_kitchens(path, lambda: stored_kitchens(server), own_models=server.own_models)


def stored_kitchens(server: ServerData) -> dict[str, str]:
    """Read the grids of the kitchens that were drawn in a server's dashboard. Raises StudyError if they cannot be
    read."""
    where = "the database"
    try:
        url = server.url
        where = shown(normal_url(url))
        return grids_at(url)
    except (DatabaseDown, ValueError) as error:
        raise StudyError([f"{where}: the kitchens of the dashboard cannot be read ({error}). {_REMEDY}"]) from None
