"""Brings a database to the tables of this version, or makes a new one. `kitchenmind serve` runs it first.

Alembic is imported when there is something to do: usually there is nothing, and games wait for a server that starts.
"""

from contextlib import suppress
from pathlib import Path

from sqlalchemy import Connection, inspect, text
from sqlalchemy.exc import DBAPIError, OperationalError, ProgrammingError

from server.store import engines
from server.store.database import Database
from server.store.engines import DatabaseDown

MIGRATIONS = Path(__file__).resolve().parents[2] / "migrations"


class DatabaseTooNew(Exception):
    """The database, or a table of it, was made by a later version of this software."""


def migrate(url: str) -> None:
    """Create or upgrade the tables. Raises DatabaseInUse, DatabaseDown, DatabaseTooNew, ValueError (bad address)."""
    writer = engines.WriteConnection(engines.normal_url(url), lock_timeout_s=engines.BUSY_TIMEOUT_S)
    try:
        with writer.transaction() as connection:
            to_newest(connection)
    except DBAPIError as error:
        raise engines.translated(error) from error
    finally:
        writer.close()


def to_newest(connection: Connection) -> None:
    """Do the same as `migrate` on a database that is already open: closing it would fold a log of some megabytes into
    the file, and games wait for a server that starts. Raises DatabaseTooNew."""
    if revision_of(connection) != newest_revision():
        _upgrade(connection)


def _upgrade(connection: Connection) -> None:
    from alembic import command
    from alembic.config import Config
    from alembic.util import CommandError

    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS).replace("%", "%%"))
    config.attributes["connection"] = connection
    try:
        command.upgrade(config, "head")
    except CommandError as error:
        raise DatabaseTooNew(f"{error}. Use the kitchenmind that made this database, or a later one.") from None
    except (OperationalError, ProgrammingError) as error:
        if "already exists" not in str(error.orig):
            raise
        problem = str(error.orig).splitlines()[0]
        raise DatabaseTooNew(
            f"{problem}, although the database is of an earlier version. If a backup was restored over a later "
            "version, restore it into an empty database."
        ) from error


def migrate_shared(url: str) -> None:
    """Do the same as `migrate` for one of several processes: current tables are left alone, because other processes use
    them."""
    with suppress(DatabaseDown), Database(url, read_only=True, readers=1) as database:
        if database.read_now(revision_of) == newest_revision():
            return
    migrate(url)


def revision_of(connection: Connection) -> str | None:
    """Return which revision a database's tables are of; None if there are none."""
    if not inspect(connection).has_table("alembic_version"):
        return None
    revision: str | None = connection.execute(text("SELECT version_num FROM alembic_version")).scalar()
    return revision


def known_revisions() -> tuple[str, ...]:
    """Return every revision that this version knows, newest first: its number opens the name of its file."""
    return tuple(sorted((file.name[:4] for file in (MIGRATIONS / "versions").glob("[0-9]*.py")), reverse=True))


def newest_revision() -> str:
    """Return the revision that `migrate` leads to."""
    return known_revisions()[0]
